"""What is handed out: versions, recipes, forms; a source distribution, a wheel, a C library away from the tree."""

import os
import re
import shutil
import subprocess
import sys
import tomllib
import zipfile
from pathlib import Path

import pytest
from conftest import PETSC_FOLDERS, ROOT, run
from petsc4py import PETSc
from support import HDF5
from test_cli import latinpc as command

import latinpc
from latinpc.options import preset_files

yaml = pytest.importorskip("yaml")
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
SPACK = [ROOT / "packaging" / "spack" / "packages" / name / "package.py" for name in ("latinpc", "py-latinpc")]
FORMS = sorted((ROOT / ".github" / "ISSUE_TEMPLATE").glob("*.yml"))
PKG_CONFIG = os.pathsep.join(str(path / "lib" / "pkgconfig") for path in PETSC_FOLDERS)


def read_yaml(*names):
    return yaml.safe_load(ROOT.joinpath(*names).read_text(encoding="utf-8"))


# ---- what stands in files -------------------------------------------------------------------------


def test_one_version():
    header = (ROOT / "latinpc" / "include" / "latinpc.h").read_text()
    numbers = re.findall(r"LATINPC_VERSION_(?:MAJOR|MINOR|SUBMINOR) +(\d+)", header)
    assert PROJECT["version"] == ".".join(numbers) == latinpc.__version__
    assert read_yaml("CITATION.cff")["version"] == PROJECT["version"]
    assert read_yaml("packaging", "conda", "recipe.yaml")["context"]["version"] == PROJECT["version"]
    for file in SPACK:
        assert f'version("{PROJECT["version"]}", branch="main")' in file.read_text()


def test_citation_is_that_of_the_article():
    cited = read_yaml("CITATION.cff")
    assert cited["cff-version"] == "1.2.0" and cited["message"] and cited["authors"]
    article = cited["references"][0]
    assert article["doi"] == "10.1016/j.cma.2007.05.002" and article["doi"] in (ROOT / "README.md").read_text()
    assert [author["family-names"] for author in article["authors"]] == ["Alart", "Dureisseix"]
    assert (article["volume"], article["start"], article["end"], article["year"]) == (197, 319, 331, 2008)


def requirements():
    """The names of what pyproject.toml requires, and petsc4py."""
    table = tomllib.loads((ROOT / "pyproject.toml").read_text())["tool"]["scikit-build"]["metadata"]["dependencies"]
    return {re.match(r"[\w-]+", text).group() for text in table["requirements"]} | {"petsc4py"}


def test_recipes_require_what_the_package_requires():
    recipe = read_yaml("packaging", "conda", "recipe.yaml")
    text = " ".join(map(str, recipe["requirements"]["run"]))
    renamed = {"matplotlib": "matplotlib-base"}
    for name in requirements() - {"contourpy"}:  # which matplotlib brings
        assert renamed.get(name, name) in text, name
    assert recipe["about"]["license_file"] == "LICENSE" and recipe["source"]["path"] == "../.."
    assert read_yaml("packaging", "spack", "repo.yaml")["repo"]["namespace"] == "latinpc"
    for file in [*SPACK, SPACK[0].parents[1] / "py-meshio" / "package.py"]:
        source = file.read_text()
        compile(source, file, "exec")
        name = "".join(word.capitalize() for word in file.parent.name.split("-"))
        assert f"class {name}(" in source
    python = SPACK[1].read_text()
    for name in requirements() - {"contourpy"}:
        assert f'"py-{name}@' in python, name


def test_the_conda_recipe_is_rendered_by_its_builder():
    """The parser and renderer of rattler-build, with the variants that conda-forge would give."""
    builder = pytest.importorskip("rattler_build")
    recipe = builder.Stage0Recipe.from_file(ROOT / "packaging" / "conda" / "recipe.yaml")
    keys = {"c_compiler": ["gcc"], "c_stdlib": ["sysroot"], "python": ["3.12.* *_cpython"]}
    (variant,) = recipe.render(builder.VariantConfig.from_yaml(yaml.safe_dump(keys)))
    rendered = variant.recipe.to_dict()
    assert rendered["package"] == {"name": "latinpc", "version": PROJECT["version"]}
    assert "openmpi_py312" in rendered["build"]["string"]
    host, needed = rendered["requirements"]["host"], rendered["requirements"]["run"]
    assert "python" in host and "python" in needed  # the variant has its version
    assert "petsc >=3.18 real_*" in host  # conda-forge has complex ones
    assert {"name": "petsc4py", "lower_bound": "x.x.x.x.x.x", "upper_bound": "x.x"} in [
        one["pin_compatible"] for one in needed if isinstance(one, dict)
    ]


def test_spack_packages_are_fetched_from_their_clone():
    """spack audit refuses a version without a place to fetch it from."""
    for file in SPACK:
        names = {"__file__": str(file), "CMakePackage": object, "PythonPackage": object}
        names |= dict.fromkeys(("license", "version", "depends_on"), lambda *args, **how: None)
        exec(file.read_text().replace("from spack.package import *", ""), names)
        (package,) = (found for name, found in names.items() if name.lower().endswith("latinpc"))
        assert package.git == f"file://{ROOT}" and all(len(line) < 100 for line in file.read_text().splitlines())


def test_issue_forms_ask_what_is_needed():
    forms = {file.stem: yaml.safe_load(file.read_text(encoding="utf-8")) for file in FORMS if file.stem != "config"}
    assert set(forms) == {"bug", "convergence", "feature"}
    for name, form in forms.items():
        assert form["name"] and form["description"]
        fields = [field for field in form["body"] if field["type"] != "markdown"]
        ids = [field["id"] for field in fields]
        assert len(ids) == len(set(ids)) and all(field["attributes"]["label"] for field in fields)
        assert {field["type"] for field in form["body"]} <= {"markdown", "textarea", "input", "dropdown", "checkboxes"}
        assert name == "feature" or "info" in ids
    ids = {field.get("id"): field for field in forms["convergence"]["body"]}
    asked = {"command", "output", "info", "structure", "size", "contrast", "held", "tried", "wanted"}
    assert asked <= set(ids) and "-snes_monitor" in ids["output"]["attributes"]["label"]


def test_a_wheel_requires_the_petsc4py_it_is_built_with(monkeypatch):
    monkeypatch.syspath_prepend(ROOT / "packaging")
    import bound_petsc

    major, minor, _ = PETSc.Sys.getVersion()
    assert bound_petsc.requirement() == f"petsc4py=={major}.{minor}.*"
    found = bound_petsc.dynamic_metadata("dependencies", {"requirements": ["numpy>=1.24"]})
    assert found == [f"petsc4py=={major}.{minor}.*", "numpy>=1.24"]
    monkeypatch.setattr(bound_petsc, "ASK", "raise SystemExit(1)")
    assert bound_petsc.requirement() == "petsc4py>=3.18"
    with pytest.raises(ValueError, match="only dependencies"):
        bound_petsc.dynamic_metadata("version", {})


def test_info_says_what_a_report_needs(tmp_path):
    import json

    found = json.loads(command("info", "--json", "-").stdout)
    assert found["versions"]["petsc"] == ".".join(map(str, PETSc.Sys.getVersion())) and found["ranks"] == 1
    assert found["built"]["petsc"].startswith(".".join(map(str, PETSc.Sys.getVersion()[:2])))
    assert re.fullmatch(r"\d+\.\d+\.\d+", found["built"]["metis"]) and found["built"]["compiler"]
    assert set(found["presets"]) == set(preset_files()) >= {"fast", "balanced", "accurate"}
    assert found["threads"]["OMP_NUM_THREADS"] == "1" and found["cores"] >= 1
    text = command("info", ranks=2).stdout
    plain = re.sub(r"\x1b\[\d*m", "", text)
    assert re.search(r"ranks\s+2 on 1 host", plain)
    for word in ("MUMPS", "CHOLMOD", "METIS", "configured", "threads", "built with", "presets"):
        assert plain.count(f" {word} ") >= 1, word


# ---- away from the tree ---------------------------------------------------------------------------


@pytest.fixture(scope="module")
def sources(tmp_path_factory):
    """The source distribution, unpacked in an empty folder."""
    folder = tmp_path_factory.mktemp("sdist")
    build = f"import sys; from scikit_build_core.build import build_sdist; build_sdist({str(folder)!r})"
    run([sys.executable, "-c", build], cwd=ROOT)
    (archive,) = folder.glob("*.tar.gz")
    shutil.unpack_archive(archive, folder)
    (unpacked,) = (path for path in folder.iterdir() if path.is_dir())
    return unpacked


@pytest.mark.skipif(not (ROOT / ".git").exists(), reason="no clone")
def test_the_source_distribution_is_complete(sources):
    tracked = subprocess.run(["git", "ls-files"], cwd=ROOT, capture_output=True, text=True, check=True).stdout.split(
        "\n"
    )
    missing = [name for name in tracked if name and (ROOT / name).exists() and not (sources / name).exists()]
    assert not missing
    assert not [path for path in sources.rglob("*") if path.suffix in (".so", ".pyc") or path.name == "built.json"]


@pytest.mark.slow
@pytest.mark.timeout(1800)
def test_a_wheel_works_wherever_it_is_put(sources, tmp_path):
    """Built from the source distribution, moved after it was installed, run beside no source tree."""
    run([sys.executable, "-m", "pip", "wheel", "-q", "--no-deps", "--no-build-isolation", sources, "-w", tmp_path],
        timeout=1500)  # fmt: skip
    (wheel,) = tmp_path.glob("*.whl")
    with zipfile.ZipFile(wheel) as archive:
        names = archive.namelist()
        (about,) = (name for name in names if name.endswith(".dist-info/METADATA"))
        metadata = archive.read(about).decode()
    major, minor, _ = PETSc.Sys.getVersion()
    assert re.search(rf"^Requires-Dist: petsc4py==\s*{major}\.{minor}\.\*$", metadata, re.MULTILINE), metadata
    assert {f"latinpc/presets/{name}.opts" for name in preset_files()} <= set(names)
    assert {"latinpc/liblatinpc.so", "latinpc/include/latinpc.h", "latinpc/built.json"} <= set(names)
    assert not [name for name in names if name.endswith((".c", ".pyx", ".pxd", ".pxi", ".cmake"))]
    run([sys.executable, "-m", "pip", "install", "-q", "--no-deps", "--target", tmp_path / "first", wheel])
    shutil.rmtree(sources / "latinpc")
    (tmp_path / "first").rename(tmp_path / "moved")
    (tmp_path / "empty").mkdir()
    how = {"cwd": tmp_path / "empty", "env": {"PYTHONPATH": str(tmp_path / "moved")}}
    where = "import latinpc; print(latinpc.__file__, latinpc.get_library())"
    out = run([sys.executable, "-c", where], **how).stdout.split()
    assert all(path.startswith(str(tmp_path / "moved")) for path in out)
    latin = [sys.executable, "-P", "-c", "from latinpc.cli import main; main()"]
    solved = run([*latin, "solve", "tensegrity-grid", "--modules", 8, "--preset", "fast", "--picture", "a.png"], **how)
    assert "converged in" in solved.stdout and (tmp_path / "empty" / "a.png").stat().st_size > 10000
    assert "fast" in run([*latin, "info"], **how).stdout


CMAKE = """
cmake_minimum_required(VERSION 3.20)
project(net C)
find_package(latinpc 0.1 REQUIRED)
add_executable(net 01_net.c)
target_link_libraries(net PRIVATE latinpc::latinpc)
"""
CMAKE_FORTRAN = """
enable_language(Fortran)
add_executable(netf 01_net.F90)
find_package(MPI REQUIRED COMPONENTS Fortran)
target_link_libraries(netf PRIVATE latinpc::fortran MPI::MPI_Fortran)
"""


def test_a_petsc_dir_without_petsc_is_refused(tmp_path):
    """Not another PETSc in its place, which pkg-config may find."""
    result = run(["cmake", "-S", ROOT / "latinpc", "-B", tmp_path, "-G", "Ninja", "-DLATINPC_PYTHON=OFF",
                  f"-DPETSC_DIR={tmp_path}"], env={"PKG_CONFIG_PATH": PKG_CONFIG}, check=False)  # fmt: skip
    assert result.returncode
    assert "PETSC_DIR and PETSC_ARCH are wrong" in " ".join(result.stderr.split())


@pytest.mark.slow
@pytest.mark.timeout(1800)
def test_the_c_library_is_installed_without_python(tmp_path):
    """Then moved; a C and a Fortran program are built against it in an empty folder, by pkg-config and by CMake."""
    environment = {"PKG_CONFIG_PATH": PKG_CONFIG}
    build, prefix, empty = tmp_path / "build", tmp_path / "prefix", tmp_path / "empty"
    run(["cmake", "-S", ROOT / "latinpc", "-B", build, "-G", "Ninja", "-DLATINPC_PYTHON=OFF"], env=environment)
    run(["cmake", "--build", build], timeout=1500)
    run(["cmake", "--install", build, "--prefix", tmp_path / "first"])
    (tmp_path / "first").rename(prefix)
    library = next(prefix.rglob("liblatinpc.so")).parent
    assert {path.name for path in library.glob("liblatinpc.so*")} == {
        f"liblatinpc.so{end}" for end in ("", ".0.1", ".0.1.0")
    }
    assert (prefix / "share" / "latinpc" / "options" / "fast.opts").is_file()
    assert (b"H5Fopen" in (library / "liblatinpc.so").read_bytes()) == HDF5  # as in the Python package
    empty.mkdir()
    for name in ("01_net.c", "01_net.F90"):
        shutil.copy(ROOT / "examples" / name, empty)
    environment["PKG_CONFIG_PATH"] += os.pathsep + str(library / "pkgconfig")
    name = run(["sh", "-c", "pkg-config --exists PETSc && echo PETSc || echo petsc"], env=environment).stdout.strip()
    flags = f"$(pkg-config --cflags --libs latinpc {name})"
    flags += " -Wl,-rpath,$(pkg-config --variable=libdir latinpc)"  # as the page on installation has it
    found = {"env": environment, "cwd": empty}
    assert "1.0000 mm" in run(["sh", "-c", f"mpicc 01_net.c -o net {flags} && ./net"], **found).stdout
    if shutil.which("mpif90"):
        module = prefix / "include" / "latinpc.F90"
        build_f = f"mpif90 -ffree-line-length-0 {module} 01_net.F90 -o netf {flags} && ./netf"
        assert "1.0000 mm" in run(["sh", "-c", build_f], **found).stdout
    fortran = shutil.which("gfortran") and shutil.which("mpif90")
    (empty / "CMakeLists.txt").write_text(CMAKE + (CMAKE_FORTRAN if fortran else ""))
    run(["cmake", "-S", ".", "-B", "out", f"-DCMAKE_PREFIX_PATH={prefix}"], cwd=empty)
    run(["cmake", "--build", "out"], cwd=empty)
    assert "1.0000 mm" in run([Path("out") / "net"], cwd=empty).stdout  # no LD_LIBRARY_PATH: CMake writes a run path
    if fortran:
        assert "1.0000 mm" in run([Path("out") / "netf"], cwd=empty).stdout
    if shutil.which("c++"):
        (empty / "CMakeLists.txt").write_text(CMAKE.replace("net C)", "net CXX)").replace("01_net.c", "net.cpp"))
        (empty / "net.cpp").write_text("#include <latinpc.h>\nint main() { return 0; }\n")
        run(["cmake", "-S", ".", "-B", "plus", f"-DCMAKE_PREFIX_PATH={prefix}"], cwd=empty)
        run(["cmake", "--build", "plus"], cwd=empty)
