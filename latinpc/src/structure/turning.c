#include "structure/structureimpl.h"
#include "structure/midpoint.h"
#include "structure/turned.h"

/*
   Residual, tensions and energy of rotating links, geometries prestress and large. For geometry linear see structure/residual.c.

   large      f = tau r / R, r = r0 + d; its derivative is k_t n n^t + tau / R (1 - n n^t) with n = r / R
   prestress  f = tau n + t0 / l (1 - n n^t) d; n, l and the tension t0 as drawn: linearisation of large at d = 0

   d is the displacement of the second node minus that of the first. A link with a fixed direction n, as a contact, has f = tau n in geometry large
   as well. A time step of geometry large has the mean force of structure/midpoint.h.
*/

const char *const LatinGeometries[] = {"linear", "prestress", "large", "LatinGeometry", "LATIN_GEOMETRY_", NULL};

/* Sets x, tension, across and change of *link to those of the mean force of a time step; d and size are set */
static void LatinTurnedMean(LatinStructure structure, PetscInt l, LatinTurned *link)
{
  const PetscInt   dim = structure->dim;
  const LatinLaw  *law = &LatinLaws[structure->law[l]];
  const PetscReal *r0  = structure->span + dim * l;
  PetscReal        R0 = 0.0, R1 = 0.0, stretch = 0.0, slope = 0.0;

  for (PetscInt c = 0; c < dim; c++) {
    R0 += PetscSqr(r0[c]);
    R1 += PetscSqr(r0[c] + 2.0 * link->d[c]);
    stretch += 4.0 * (r0[c] + link->d[c]) * link->d[c];
  }
  R0            = PetscSqrtReal(R0);
  R1            = PetscSqrtReal(R1);
  link->x       = structure->e0[l] + (R0 + R1 > 0.0 ? stretch / (R0 + R1) : 0.0); /* strain at the end of the step, without cancellation */
  link->across  = R0 + R1 > 0.0 ? LatinMidpointForce(law, structure->stiffness[l], structure->e0[l], link->x, R0 + R1, &slope) : 0.0;
  link->tension = link->across * link->size;
  for (PetscInt c = 0; c < dim; c++) link->change[c] = R1 > 0.0 ? 2.0 * link->size * slope * (r0[c] + 2.0 * link->d[c]) / R1 : 0.0;
}

/* Sets *link for a link with a fixed direction; in a time step with the mean tension */
static void LatinTurnedKeep(LatinStructure structure, const PetscReal rigid[], PetscInt l, const PetscScalar a[], LatinTurned *link)
{
  const LatinLaw *law   = &LatinLaws[structure->law[l]];
  const PetscReal e     = LatinStructureElongation(structure, l, a);
  PetscReal       slope = 0.0;

  for (PetscInt c = 0; c < structure->dim; c++) {
    link->n[c] = structure->direction[structure->dim * l + c];
    link->d[c] = PetscRealPart(a[structure->dim * structure->ends[2 * l + 1] + c] - a[structure->dim * structure->ends[2 * l] + c]);
  }
  link->size = link->across = 0.0;
  link->x                   = structure->e0[l] + (structure->midpoint ? 2.0 * e : e);
  link->tension             = structure->midpoint ? LatinMidpointTension(law, structure->stiffness[l], structure->e0[l], link->x, &slope) : LatinStructureTension(structure, rigid, l, link->x);
  for (PetscInt c = 0; c < structure->dim && structure->midpoint; c++) link->change[c] = 2.0 * slope * link->n[c];
}

void LatinTurnedLink(LatinStructure structure, const PetscReal rigid[], PetscInt l, const PetscScalar a[], LatinTurned *link)
{
  const PetscInt     dim = structure->dim;
  const PetscReal   *r0 = structure->span + dim * l, e0 = structure->e0[l];
  const PetscScalar *ua = a + dim * structure->ends[2 * l], *ub = a + dim * structure->ends[2 * l + 1];
  PetscReal          length = 0.0, size = 0.0, stretch = 0.0;

  if (LatinStructureKeeps(structure, l)) {
    LatinTurnedKeep(structure, rigid, l, a, link);
    return;
  }
  for (PetscInt c = 0; c < dim; c++) {
    const PetscReal d = PetscRealPart(ub[c] - ua[c]);

    link->d[c] = d;
    link->n[c] = structure->geometry == LATIN_GEOMETRY_LARGE ? r0[c] + d : r0[c];
    length += PetscSqr(r0[c]);
    size += PetscSqr(link->n[c]);
    stretch += structure->geometry == LATIN_GEOMETRY_LARGE ? (2.0 * r0[c] + d) * d : r0[c] * d;
  }
  length = PetscSqrtReal(length);
  size   = PetscSqrtReal(size);
  for (PetscInt c = 0; c < dim; c++) link->n[c] /= size > 0.0 ? size : 1.0;
  link->size = size;
  if (structure->midpoint) LatinTurnedMean(structure, l, link);
  else if (structure->geometry == LATIN_GEOMETRY_LARGE) {
    link->x       = stretch / (size + length) + e0; /* R - l without cancellation */
    link->tension = LatinStructureTension(structure, rigid, l, link->x);
    link->across  = size > 0.0 ? link->tension / size : 0.0;
  } else {
    link->x       = stretch / length + e0;
    link->tension = LatinStructureTension(structure, rigid, l, link->x);
    link->across  = LatinStructureTension(structure, NULL, l, e0) / length;
  }
}

/* Adds link l to the stiffness J. k: derivative of its force by the relative displacement d of its ends, [dim][dim]. Not collective */
PetscErrorCode LatinTurnedAdd_Private(LatinStructure structure, PetscInt l, const PetscReal k[], Mat J)
{
  const PetscInt dim = structure->dim, n = 2 * dim;
  PetscInt       row[6];
  PetscScalar    block[36];

  PetscFunctionBegin;
  for (PetscInt i = 0; i < n; i++) row[i] = dim * structure->ends[2 * l + i / dim] + i % dim;
  for (PetscInt i = 0; i < n * n; i++) block[i] = (i / n / dim == i % n / dim ? 1.0 : -1.0) * k[dim * (i / n % dim) + i % n % dim];
  PetscCall(MatSetValuesLocal(J, n, row, n, row, block, ADD_VALUES));
  PetscFunctionReturn(0);
}

/*
   Computes r: nodal forces of the links and of springs to the ground at u, minus load (or NULL). f: [links_local][dim] forces on second nodes.
   Collective on structure
*/
PetscErrorCode LatinTurningForces_Private(LatinStructure structure, const PetscReal f[], Vec u, Vec load, Vec r)
{
  const PetscInt dim = structure->dim;
  Vec            local;
  PetscScalar   *v;

  PetscFunctionBegin;
  PetscCall(LatinStructureOpenForces_Private(structure, &local, &v));
  for (PetscInt l = 0; l < structure->links_local; l++) {
    for (PetscInt c = 0; c < dim; c++) v[dim * structure->ends[2 * l] + c] -= f[dim * l + c];
    for (PetscInt c = 0; c < dim; c++) v[dim * structure->ends[2 * l + 1] + c] += f[dim * l + c];
  }
  PetscCall(LatinStructureCloseForces_Private(structure, &local, &v, u, load, r));
  PetscFunctionReturn(0);
}

/* Computes the tensions at u, [links_local]. rigid: tensions of rigid links. Collective on structure */
PetscErrorCode LatinTurningTensions_Private(LatinStructure structure, const PetscReal rigid[], Vec u, PetscReal tension[])
{
  const PetscScalar *a;
  LatinTurned        link;
  Vec                local;

  PetscFunctionBegin;
  PetscCall(LatinStructureOpen_Private(structure, structure->vertex_prescribed, u, &local, &a));
  for (PetscInt l = 0; l < structure->links_local; l++) {
    LatinTurnedLink(structure, rigid, l, a, &link);
    tension[l] = link.tension;
  }
  PetscCall(LatinStructureClose_Private(structure, &local, &a));
  PetscFunctionReturn(0);
}

/*
   Computes the strains at u + part * step, linearised about u, and the tensions of the laws at them. held: step of prescribed vertices, NULL: zero.
   Collective on structure
*/
PetscErrorCode LatinTurningAhead_Private(LatinStructure structure, Vec u, const PetscReal held[], Vec step, PetscReal part, PetscReal tension[], PetscReal strain[])
{
  const PetscInt     dim = structure->dim;
  const PetscScalar *a, *s;
  LatinTurned        link;
  Vec                at, along;

  PetscFunctionBegin;
  PetscCall(LatinStructureOpen_Private(structure, structure->vertex_prescribed, u, &at, &a));
  PetscCall(LatinStructureOpen_Private(structure, held, step, &along, &s));
  for (PetscInt l = 0; l < structure->links_local; l++) {
    const PetscScalar *sa = s + dim * structure->ends[2 * l], *sb = s + dim * structure->ends[2 * l + 1];

    LatinTurnedLink(structure, NULL, l, a, &link);
    for (PetscInt c = 0; c < dim; c++) link.x += part * link.n[c] * PetscRealPart(sb[c] - sa[c]);
    strain[l]  = link.x;
    tension[l] = LatinStructureTension(structure, NULL, l, link.x);
  }
  PetscCall(LatinStructureClose_Private(structure, &along, &s));
  PetscCall(LatinStructureClose_Private(structure, &at, &a));
  PetscFunctionReturn(0);
}

/* Computes the nodal unbalance r at u, with laws linearised about structure->strain if it is set. rigid: tensions of rigid links. Collective on structure */
PetscErrorCode LatinTurningResidual_Private(LatinStructure structure, const PetscReal rigid[], Vec u, Vec r)
{
  const PetscInt     dim = structure->dim;
  const PetscScalar *a;
  PetscReal         *f;
  Vec                local;

  PetscFunctionBegin;
  PetscCall(DMGetWorkArray(structure->dm, dim * structure->links_local, MPIU_REAL, &f));
  PetscCall(LatinStructureOpen_Private(structure, structure->vertex_prescribed, u, &local, &a));
  for (PetscInt l = 0; l < structure->links_local; l++) {
    LatinTurned link;
    PetscReal   along = 0.0;

    LatinTurnedLink(structure, rigid, l, a, &link);
    if (structure->strain) link.tension = structure->ahead[l] + LatinStructureTangent(structure, l, structure->strain[l]) * (link.x - structure->strain[l]);
    for (PetscInt c = 0; c < dim; c++) along += link.n[c] * link.d[c];
    for (PetscInt c = 0; c < dim; c++) f[dim * l + c] = link.tension * link.n[c] + (structure->geometry == LATIN_GEOMETRY_LARGE ? 0.0 : link.across * (link.d[c] - along * link.n[c]));
  }
  PetscCall(LatinStructureClose_Private(structure, &local, &a));
  PetscCall(LatinTurningForces_Private(structure, f, u, structure->load, r));
  PetscCall(DMRestoreWorkArray(structure->dm, dim * structure->links_local, MPIU_REAL, &f));
  PetscFunctionReturn(0);
}

/* Computes span, the vectors from first to second nodes at u, and the strains x there. held: displacements of prescribed vertices. Collective on structure */
PetscErrorCode LatinTurningMove_Private(LatinStructure structure, const PetscReal held[], Vec u, PetscReal span[], PetscReal x[])
{
  const PetscInt     dim = structure->dim;
  const PetscScalar *a;
  LatinTurned        link;
  Vec                local;

  PetscFunctionBegin;
  PetscCall(LatinStructureOpen_Private(structure, held, u, &local, &a));
  for (PetscInt l = 0; l < structure->links_local; l++) {
    LatinTurnedLink(structure, NULL, l, a, &link);
    for (PetscInt c = 0; c < dim; c++) span[dim * l + c] = structure->span[dim * l + c] + link.d[c];
    x[l] = link.x;
  }
  PetscCall(LatinStructureClose_Private(structure, &local, &a));
  PetscFunctionReturn(0);
}

/* Computes the strain energy of the links, rigid ones as springs, minus the work of the loads. Collective on structure */
PetscErrorCode LatinTurningEnergy_Private(LatinStructure structure, Vec u, PetscReal *energy)
{
  const PetscInt     dim = structure->dim;
  const PetscScalar *a;
  PetscReal          sum = 0.0;
  PetscScalar        work;
  Vec                local;

  PetscFunctionBegin;
  PetscCall(LatinStructureOpen_Private(structure, structure->vertex_prescribed, u, &local, &a));
  for (PetscInt l = 0; l < structure->links_local; l++) {
    const LatinLaw *law   = &LatinLaws[structure->law[l]];
    PetscReal       along = 0.0, whole = 0.0;
    LatinTurned     link;

    LatinTurnedLink(structure, NULL, l, a, &link);
    if (!law->rigid) sum += law->energy(structure->stiffness[l], link.x, law->ctx);
    else if (structure->penalty) sum += 0.5 * PetscSqr(link.tension) / structure->penalty[l];
    for (PetscInt c = 0; c < dim; c++) {
      along += link.n[c] * link.d[c];
      whole += PetscSqr(link.d[c]);
    }
    if (structure->geometry == LATIN_GEOMETRY_PRESTRESS) sum += 0.5 * link.across * (whole - along * along);
  }
  PetscCall(LatinStructureClose_Private(structure, &local, &a));
  PetscCall(MPIU_Allreduce(&sum, energy, 1, MPIU_REAL, MPIU_SUM, PetscObjectComm((PetscObject)structure)));
  PetscCall(VecDot(structure->load, u, &work));
  *energy -= PetscRealPart(work);
  PetscFunctionReturn(0);
}

/* ---- set-up and checks ---- */

/*
   Checks that the natural length l - e0 of each rotating link is not negative. e0: [links_local] initial elongations, NULL: zero. Links of a given force
   density have the length zero to rounding. Collective on structure
*/
PetscErrorCode LatinTurningNatural_Private(LatinStructure structure, const PetscReal e0[])
{
  const PetscInt dim    = structure->dim;
  PetscInt       bad    = -1;
  PetscReal      length = 0.0, most = 0.0;

  PetscFunctionBegin;
  for (PetscInt l = 0; e0 && l < structure->links_local && bad < 0; l++) {
    PetscReal squares = 0.0;

    if (structure->keeps[l] || structure->law[l] == LATIN_LAW_CONTACT) continue;
    for (PetscInt c = 0; c < dim; c++) squares += PetscSqr(structure->span[dim * l + c]);
    length = PetscSqrtReal(squares);
    most   = e0[l];
    if (most > length * (1.0 + PETSC_SQRT_MACHINE_EPSILON)) bad = l;
  }
  LatinAgree(PetscObjectComm((PetscObject)structure), bad >= 0, PETSC_ERR_ARG_OUTOFRANGE,
             "Link %" PetscInt_FMT ", of length %g, has the initial elongation %g: its length without tension would be %g. With geometry large a prestress is at most the stiffness, EA / length, times the length: was EA given as the stiffness?",
             structure->links_start + bad, (double)length, (double)most, (double)(length - most));
  PetscFunctionReturn(0);
}

/* Sets span and keeps for the present geometry, and checks that it allows the laws and the directions of the links. Collective on structure */
PetscErrorCode LatinTurningSetUp_Private(LatinStructure structure)
{
  const PetscInt     dim  = structure->dim;
  MPI_Comm           comm = PetscObjectComm((PetscObject)structure);
  const PetscScalar *x;
  Vec                coordinates;
  PetscInt           own = -1, rigid = -1;
  const char        *cure;

  PetscFunctionBegin;
  PetscCall(PetscFree(structure->keeps));
  if (structure->geometry == LATIN_GEOMETRY_LINEAR) {
    PetscCall(PetscFree(structure->span));
    PetscFunctionReturn(0);
  }
  for (PetscInt l = 0; l < structure->links_local && rigid < 0; l++)
    if (LatinLaws[structure->law[l]].rigid && (structure->geometry == LATIN_GEOMETRY_PRESTRESS || (structure->law[l] != LATIN_LAW_INEXTENSIBLE && structure->law[l] != LATIN_LAW_CONTACT))) rigid = structure->law[l];
  cure = LatinLaws[PetscMax(0, rigid)].cure;
  if (rigid == LATIN_LAW_FRICTION || rigid == LATIN_LAW_TANGENT) /* friction is for small displacements */
    cure = structure->geometry == LATIN_GEOMETRY_LARGE ? "the law contact, which slides without friction" : "the elastic law compression_only, which slides without friction";
  LatinAgree(comm, rigid >= 0, PETSC_ERR_SUP, "Geometry %s does not take links of the law %s, as the structure has them: take %s, or the geometry linear", LatinGeometries[structure->geometry], LatinLaws[PetscMax(0, rigid)].name, cure);
  if (!structure->span) PetscCall(PetscMalloc1(dim * structure->links_local + 1, &structure->span));                       /* + 1: never NULL */
  if (structure->geometry == LATIN_GEOMETRY_LARGE) PetscCall(PetscMalloc1(structure->links_local + 1, &structure->keeps)); /* the same */
  PetscCall(DMGetCoordinatesLocal(structure->dm, &coordinates));
  PetscCall(VecGetArrayRead(coordinates, &x));
  for (PetscInt l = structure->links_local - 1; l >= 0; l--) {
    PetscReal *r0 = structure->span + dim * l;

    for (PetscInt c = 0; c < dim; c++) r0[c] = PetscRealPart(x[dim * structure->ends[2 * l + 1] + c] - x[dim * structure->ends[2 * l] + c]);
    if (structure->keeps) structure->keeps[l] = (PetscBool)(LatinStructureOwnDirection(structure, l, r0) || structure->law[l] == LATIN_LAW_CONTACT);
    else if (LatinStructureOwnDirection(structure, l, r0)) own = l;
  }
  PetscCall(VecRestoreArrayRead(coordinates, &x));
  LatinAgree(comm, own >= 0, PETSC_ERR_SUP, "Link %" PetscInt_FMT " has a direction of its own, and geometry %s turns links with their nodes: leave out its direction, or take -snes_latin_geometry large, or linear", structure->links_start + own,
             LatinGeometries[structure->geometry]);
  if (structure->keeps) PetscCall(LatinTurningNatural_Private(structure, structure->e0));
  PetscFunctionReturn(0);
}

/* Checks that the geometry is linear. what: subject and verb of the message. Collective on structure */
PetscErrorCode LatinStructureCheckLinear_Private(LatinStructure structure, const char what[])
{
  PetscFunctionBegin;
  PetscCheck(structure->geometry == LATIN_GEOMETRY_LINEAR, PetscObjectComm((PetscObject)structure), PETSC_ERR_SUP, "%s links that keep their direction, and the geometry of the structure is %s: take -snes_latin_geometry linear", what,
             LatinGeometries[structure->geometry]);
  PetscFunctionReturn(0);
}

/*@C
  LatinStructureSetGeometry - Sets whether links rotate with the displacements, for all solvers of a structure.

  Collective on structure

  Input Parameter:
. geometry - `LATIN_GEOMETRY_LINEAR`, the default: equilibrium in the drawn configuration; `LATIN_GEOMETRY_PRESTRESS`: small
             rotations, with the geometric stiffness of the drawn configuration, tension over length; `LATIN_GEOMETRY_LARGE`:
             equilibrium in the displaced configuration; the strain of a link is |r| - l + e0, with r the vector from its
             first to its second node and l its length as drawn

  Options Database Key:
. -snes_latin_geometry <linear,prestress,large> - the same, when a SNES latin is set up

  Level: beginner

  Note:
  Prestress and large support elastic links in the direction of their nodes. Large also supports links with a direction of their own and,
  in statics, inextensible cables and contacts; directions of contacts and directions of their own stay fixed. Motions support linear and large.

.seealso: `SNESLATIN`, `LatinStructureSetPrestress()`
@*/
PetscErrorCode LatinStructureSetGeometry(LatinStructure structure, LatinGeometry geometry)
{
  LatinGeometry  before;
  PetscErrorCode refused;

  PetscFunctionBegin;
  PetscValidHeaderSpecific(structure, LATIN_STRUCTURE_CLASSID, 1);
  PetscCall(LatinCheckChoice_Private((PetscObject)structure, LatinGeometries, (int)geometry));
  if (geometry == structure->geometry) PetscFunctionReturn(0);
  before              = structure->geometry;
  structure->geometry = geometry;
  refused             = structure->set_up ? LatinTurningSetUp_Private(structure) : 0;
  if (refused) { /* restores the structure, as its solvers do not check it again */
    structure->geometry = before;
    PetscCall(LatinTurningSetUp_Private(structure));
  }
  PetscCall(refused);
  PetscCall(PetscObjectStateIncrease((PetscObject)structure));
  PetscFunctionReturn(0);
}

/*@C
  LatinStructureGetGeometry - Gets whether links rotate with the displacements.

  Not collective

  Input Parameter:
. structure - the structure

  Output Parameter:
. geometry - as `LatinStructureSetGeometry()` has set it, linear by default

  Level: beginner

.seealso: `LatinStructureSetGeometry()`
@*/
PetscErrorCode LatinStructureGetGeometry(LatinStructure structure, LatinGeometry *geometry)
{
  PetscFunctionBegin;
  PetscValidHeaderSpecific(structure, LATIN_STRUCTURE_CLASSID, 1);
  PetscAssertPointer(geometry, 2);
  *geometry = structure->geometry;
  PetscFunctionReturn(0);
}
