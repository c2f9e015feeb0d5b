"""The truss that commands of OpenSees make, one after the other."""

from __future__ import annotations

import numpy as np

from .lines import Lines
from .text import finite, wrong

TRUSSES = ("truss", "corottruss")
FORMATS = {
    "model": "model basic -ndm 2 or 3",
    "node": "node tag x y [z] [-mass m ...]",
    "fix": "fix tag 1 or 0 for each direction",
    "fixX": "fixX x 1 or 0 for each direction",
    "mass": "mass tag m for each direction, all equal",
    "uniaxialMaterial": "uniaxialMaterial Elastic tag E [eta] [Eneg], ENT tag E, ElasticPPGap tag E Fy gap,"
    " InitStrainMaterial tag other strain or InitStressMaterial tag other stress",
    "element": "element truss or corotTruss tag i j A material [-rho m]",
    "timeSeries": "timeSeries Linear or Constant tag [-factor c]",
    "pattern": "pattern Plain tag series [-fact c]",
    "load": "load tag F for each direction",
    "sp": "sp tag direction displacement",
}
FORMATS["fixY"] = FORMATS["fixZ"] = FORMATS["fixX"]
BUILDING = frozenset(FORMATS)
#: Commands that make what a truss has not
REFUSED = frozenset({
    "equalDOF", "equalDOF_Mixed", "rigidLink", "rigidDiaphragm", "section", "geomTransf", "nDMaterial", "eleLoad",
    "groundMotion", "imposedMotion", "imposedSupportMotion", "block2D", "block3D", "frictionModel", "beamIntegration",
    "remove", "mesh", "setNodeCoord", "pressureConstraint", "parameter", "updateParameter",
})  # fmt: skip
#: Commands of an analysis and of its results, and those of Tcl that go with them
LEFT_OUT = frozenset({
    "wipe", "wipeAnalysis", "puts", "print", "printModel", "printA", "printB", "recorder", "record", "constraints",
    "numberer", "system", "test", "algorithm", "integrator", "analysis", "analyze", "eigen", "loadConst", "setTime",
    "reactions", "reset", "initialize", "region", "rayleigh", "modalProperties", "database", "save", "logFile",
    "nodeDisp", "nodeReaction", "nodeCoord", "eleForce", "eleResponse", "basicForce", "getTime",
    "open", "close", "file", "exit", "unset", "incr", "lappend", "global", "package", "return", "display",
})  # fmt: skip
FACTOR_FLAGS = ("-fact", "-factor", "-cfactor")


class Model:
    """What commands have made so far.

    Parameters
    ----------
    path : Path
        The script, for messages.
    """

    def __init__(self, path):
        self.path, self.dim = path, None
        self.node, self.points, self.fixed, self.prescribed, self.loads, self.masses = {}, [], [], [], [], []
        self.material, self.series, self.factor = {}, {}, None
        self.elements, self.ends, self.rows, self.laws, self.notes = {}, [], [], {}, []
        self.turning = []  # whether each element is a corotTruss

    def take(self, row, command, words):
        """Carry out a command; its words are texts. Raises ValueError with the line of the file."""
        if command not in BUILDING:
            wrong(self.path, row, f"'{command}' is not known", f"trusses only: {', '.join(sorted(BUILDING))}")
        self.row, self.command, self.words = row, command, list(words)
        getattr(self, "_fix_at" if command.startswith("fix") and command != "fix" else f"_{command}")()

    def _wrong(self, what=None):
        what = what or f"'{' '.join([self.command, *self.words])[:80]}'"
        wrong(self.path, self.row, what, FORMATS[self.command])

    def _number(self, word):
        number = finite(word)
        if number is None:
            self._wrong(f"'{word}' in '{' '.join([self.command, *self.words])[:80]}' is no number")
        return number

    def _tag(self, word):
        number = self._number(word)
        if number != int(number):
            self._wrong(f"the tag '{word}' is no whole number")
        return int(number)

    def _split(self, least):
        """Return the words before the first flag, at least so many, and the numbers after each flag."""
        flags = [at for at, word in enumerate(self.words) if word[:1] == "-" and word[1:2].isalpha()]
        plain = self.words[: flags[0]] if flags else self.words
        if len(plain) < least:
            self._wrong()
        after = {self.words[a].lower(): self.words[a + 1 : b] for a, b in zip(flags, [*flags[1:], len(self.words)])}
        return plain, after

    def _known(self, word):
        tag = self._tag(word)
        if tag not in self.node:
            self._wrong(f"there is no node {tag} so far")
        return self.node[tag]

    def _of_axes(self, words, least=1):
        """Return numbers for the axes of the space; those of rotations must be zero or a support."""
        if self.dim is None:
            self._wrong("there is no 'model' before")
        if len(words) < least:
            self._wrong()
        numbers = [self._number(word) for word in words]
        return numbers, [*numbers[: self.dim], 0.0, 0.0, 0.0][:3]

    # ---- commands: one a method, with the name of the command ----

    def _model(self):
        _, flags = self._split(0)
        dim = flags.get("-ndm", [None])
        if not dim or dim[0] not in ("2", "3"):
            self._wrong()
        if self.node:
            self._wrong("a second 'model' after nodes")
        self.dim = int(dim[0])

    def _node(self):
        if self.dim is None:
            self._wrong("there is no 'model' before")
        plain, flags = self._split(1 + self.dim)
        tag = self._tag(plain[0])
        if tag in self.node:
            self._wrong(f"node {tag} is there already")
        if len(plain) != 1 + self.dim:
            self._wrong(f"node {tag} has {len(plain) - 1} coordinates in {self.dim}D")
        self.node[tag] = len(self.points)
        self.points.append(self._of_axes(plain[1:])[1])
        for values, empty in ((self.fixed, False), (self.prescribed, 0.0), (self.loads, 0.0)):
            values.append([empty] * 3)
        self.masses.append(0.0)
        if "-mass" in flags:
            self._add_mass(self.node[tag], flags["-mass"])

    def _fix(self):
        if len(self.words) < 2:
            self._wrong()
        self._hold([self._known(self.words[0])], self.words[1:])

    def _fix_at(self):
        plain, flags = self._split(2)
        axis, at = "XYZ".index(self.command[3]), self._number(plain[0])
        near = self._number(flags["-tol"][0]) if flags.get("-tol") else 1e-10
        self._hold([n for n, point in enumerate(self.points) if abs(point[axis] - at) <= near], plain[1:])

    def _hold(self, nodes, words):
        numbers, axes = self._of_axes(words)
        if any(number not in (0.0, 1.0) for number in numbers) or len(numbers) < self.dim:
            self._wrong()
        for node in nodes:
            self.fixed[node] = [a or b == 1.0 for a, b in zip(self.fixed[node], axes)]

    def _mass(self):
        if len(self.words) < 2:
            self._wrong()
        self._add_mass(self._known(self.words[0]), self.words[1:])

    def _add_mass(self, node, words):
        axes = self._of_axes(words)[1][: self.dim]
        if len(set(axes)) > 1 or axes[0] < 0.0:
            self._wrong("a mass that differs between directions, or is negative")
        self.masses[node] += axes[0]

    def _uniaxialMaterial(self):
        if len(self.words) < 3:
            self._wrong()
        kind, tag = self.words[0], self._tag(self.words[1])
        if tag in self.material:
            self._wrong(f"material {tag} is there already")
        numbers = [self._number(word) for word in self.words[2:] if word not in ("damage", "noDamage")]
        law, strain = "bar", 0.0
        if kind in ("InitStrainMaterial", "InitStressMaterial") and len(numbers) == 2:
            if int(numbers[0]) not in self.material:
                self._wrong(f"there is no material {numbers[0]:g} so far")
            law, modulus, before = self.material[int(numbers[0])]
            strain = before + numbers[1] if kind == "InitStrainMaterial" else numbers[1] / modulus
            wrong_way = {"cable": -1.0, "compression_only": 1.0}.get(law, 0.0) * strain > 0.0
            if kind == "InitStressMaterial" and wrong_way:
                self._wrong(f"a stress of {numbers[1]:g} that material {numbers[0]:g} cannot have")
        elif kind == "Elastic" and len(numbers) <= 3:
            modulus, behind = numbers[0], numbers[2] if len(numbers) == 3 else numbers[0]
            if behind not in (0.0, modulus):
                self._wrong(f"Eneg = {behind:g}, which is neither E nor 0")
            law = "bar" if behind else "cable"
        elif kind == "ENT":
            modulus, law = numbers[0], "compression_only"
        elif kind == "ElasticPPGap" and len(numbers) in (3, 4):
            modulus, limit, gap = numbers[:3]
            if limit * gap < 0.0 or limit == 0.0:
                self._wrong("Fy and gap of an ElasticPPGap have one sign: positive in tension")
            law, strain = "cable" if limit > 0.0 else "compression_only", -gap
            self.notes.append(f"line {self.row}: elastic, right for stresses up to Fy = {limit:g} alone")
        else:
            self._wrong()
        if modulus <= 0.0:
            self._wrong(f"E = {modulus:g} is not positive")
        self.material[tag] = (law, modulus, strain)

    def _element(self):
        plain, flags = self._split(2)
        if plain[0].lower() not in TRUSSES or len(plain) != 6:
            self._wrong()
        tag, material, area = self._tag(plain[1]), self._tag(plain[5]), self._number(plain[4])
        if tag in self.elements:
            self._wrong(f"element {tag} is there already, on line {self.elements[tag]}")
        if material not in self.material:
            self._wrong(f"there is no material {material} so far")
        if area <= 0.0:
            self._wrong(f"the area {area:g} is not positive")
        ends = [self._known(word) for word in plain[2:4]]
        if ends[0] == ends[1]:
            self._wrong(f"element {tag} joins node {plain[2]} to itself")
        self.turning.append(plain[0].lower() == "corottruss")
        self.elements[tag] = self.row
        self.laws.setdefault((material, area), []).append(len(self.ends))
        self.ends.append(ends)
        self.rows.append(self.row)
        if flags.get("-rho"):
            length = np.linalg.norm(np.subtract(*(self.points[end] for end in ends)))
            for end in ends:
                self.masses[end] += self._number(flags["-rho"][0]) * length / 2.0

    def _timeSeries(self):
        plain, flags = self._split(2)
        if plain[0] not in ("Linear", "Constant"):
            self._wrong()
        self.series[plain[1]] = self._factor(flags)

    def _factor(self, flags):
        found = [flags[flag] for flag in FACTOR_FLAGS if flag in flags]
        return self._number(found[0][0]) if found and found[0] else 1.0

    def _pattern(self):
        plain, flags = self._split(3)
        if plain[0] != "Plain":
            self._wrong()
        series = plain[2].strip().strip('"{}').split() or [""]
        if plain[2] not in self.series and series[0] not in ("Linear", "Constant"):
            self._wrong(f"there is no timeSeries {plain[2]} so far")
        self.factor = self._factor(flags) * self.series.get(plain[2], 1.0)

    def _load(self):
        if self.factor is None or len(self.words) < 2:
            self._wrong("a load outside of a pattern" if self.factor is None else None)
        node = self._known(self.words[0])
        words = self.words[1:]
        words = words[: next((at for at, word in enumerate(words) if word in ("-const", "-pattern")), len(words))]
        numbers, axes = self._of_axes(words, self.dim)
        if any(numbers[self.dim :]):
            self._wrong("a moment, which a truss cannot bear")
        self.loads[node] = [a + self.factor * b for a, b in zip(self.loads[node], axes)]

    def _sp(self):
        if self.factor is None or len(self.words) < 3:
            self._wrong("a displacement outside of a pattern" if self.factor is None else None)
        node, axis = self._known(self.words[0]), self._tag(self.words[1])
        if not 1 <= axis <= (self.dim or 0):
            self._wrong(f"direction {axis} in {self.dim}D")
        self.fixed[node][axis - 1] = True
        self.prescribed[node][axis - 1] = self.factor * self._number(self.words[2])

    def lines(self):
        """Return what has been made."""
        if not self.ends:
            wrong(self.path, None, "holds no truss element", FORMATS["element"])
        if any(self.turning) and not all(self.turning):
            self.notes.append("truss beside corotTruss: displacements are small here, directions do not turn")
        laws = []
        for (tag, area), chosen in self.laws.items():
            law, modulus, strain = self.material[tag]
            entries = {"law": law, "EA": modulus * area, **({"strain": strain} if strain else {})}
            laws.append((f"{self.path}, line {self.rows[chosen[0]]}", np.array(chosen), entries))
        return Lines(
            self.path, self.points, self.ends, {"truss": np.arange(len(self.ends))}, rows=np.array(self.rows),
            dim=self.dim, laws=laws, fixed=np.array(self.fixed), prescribed=np.array(self.prescribed),
            load=np.array(self.loads), mass=np.array(self.masses), notes=self.notes,
            geometry="large" if all(self.turning) else "linear", point_names=list(self.node),
            line_names=list(self.elements),
        )  # fmt: skip
