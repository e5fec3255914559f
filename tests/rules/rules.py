#!/usr/bin/python3
"""The rules of the house: what may include what, what links to what, how sources look, what their words name.

Usage: rules.py ROOT    prints each violation as "rule: file:line: what"; exit status 1 if there are any.
"""
import re
import subprocess
import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent))
from references import references  # noqa: E402

TOP_LEVEL = {"CMakeLists.txt", "precompute", "runtime", "common", "schemas", "tests", "examples", "docs", "README.md", "LICENSE",
             "CHANGELOG.md", "CONTRIBUTING.md", "CMakePresets.json", "install-dependencies", "pyproject.toml", "setup.py"}
# What may include what: from top to bottom, a folder sees itself and those below it.
LAYERS = {
    "common": "bundle hdf5 console config surface_io model mesh elastic core",
    "runtime": "ports viewer/app viewer/panels viewer/script viewer/studio viewer/recording viewer/drawing viewer/simulation viewer/scene viewer/view"
               " app export api capacity bench scene output sim/world sim/lanes sim/space/full sim/step sim/contact sim/examples sim/frame sim/solver sim/elasticity kernels",
    "precompute": "app study/worlds study/sweep study/sources study/stability study/measure pipeline training examples inputs posing meshing/mesher meshing cache"
                  " full_space alignment render shape_space targets polynomial cubature modes contact mesh_io solvers fem drawing",
}
INNER = {f"{stage}/{folder}": (stage, depth) for stage, folders in LAYERS.items() for depth, folder in enumerate(folders.split())}
OUTER = {"runtime/include", "runtime/python"}
SEEN_FROM = {"common": (), "runtime": ("common/",), "precompute": ("common/", "runtime/sim/", "runtime/kernels")}
WIDEST = 120  # columns of a line of a page
LEAN = ("common/core", "common/mesh", "common/elastic", "common/model", "runtime/kernels", "runtime/sim")
LEAN_INCLUDES = LEAN + ("exmat",)
POSIX = {"fcntl.h", "immintrin.h", "pthread.h", "sched.h", "sys/stat.h", "unistd.h"}  # of these sources alone
POSIX_SOURCES = {"common/core/atomic_file.cpp", "common/core/command_files.cpp", "common/core/thread_team.cpp"}
STREAMS = {"iostream", "fstream", "sstream", "ostream", "istream", "iomanip", "cstdio"}
PRIVATE_HEADERS = {f"precompute/solvers/{name}.h": "precompute/solvers" for name in ("petsc_handles", "solver_access", "team")}
INCLUDE = re.compile(r'^\s*#\s*include\s*([<"])([^>"]+)[>"]')
OWN = re.compile(r"^(common|precompute|runtime|tests)/")


def sources(root, folders=("common", "precompute", "runtime")):
    for folder in folders:
        for path in sorted((root / folder).rglob("*")):
            if path.suffix in (".h", ".hpp", ".c", ".cpp"):
                yield path.relative_to(root).as_posix(), path


def includes(path):
    for number, line in enumerate(path.read_text().splitlines(), 1):
        match = INCLUDE.match(line)
        if match:
            yield number, match.group(2)


def without_comments_and_strings(text):
    pattern = re.compile(r'//[^\n]*|/\*.*?\*/|"(?:\\.|[^"\\\n])*"', re.S)
    return pattern.sub(lambda m: re.sub(r"[^\n]", " ", m.group()), text)


def folder_of(name):
    """The folder of the layers that a source or header is in; None where it is in none."""
    return next((folder for folder in sorted(OUTER | INNER.keys(), key=len, reverse=True) if name.startswith(folder + "/")), None)


def direction(root):
    """Every source is in a folder of the layers and includes its own folder and those below it alone; precompute measures with
    runtime/sim and sees no more of the run time, but for precompute/study, which runs scenes and writes their trajectories."""
    for name, path in sources(root):
        folder = folder_of(name)
        if folder is None:
            yield f"{name}:1: its folder is not in the layers"
            continue
        for number, header in includes(path):
            if OWN.match(header) and not may_include(folder, folder_of(header)):
                yield f"{name}:{number}: includes {header}"


def may_include(folder, other):
    if other is None or folder in OUTER:
        return other == folder
    (stage, depth), (other_stage, other_depth) = INNER[folder], INNER.get(other, (None, 0))
    if stage == other_stage:
        return depth <= other_depth
    return other is not None and other.startswith(SEEN_FROM[stage] + (("runtime/scene", "runtime/output") if folder.startswith("precompute/study/") else ()))


def lean(root):
    """The shared kernels and the hot path use the standard library and Eigen only."""
    for name, path in sources(root):
        if not name.startswith(LEAN):
            continue
        for number, header in includes(path):
            own = OWN.match(header) and header.startswith(LEAN_INCLUDES)
            standard = re.fullmatch(r"[a-z_0-9]+", header)
            posix = header in POSIX and name in POSIX_SOURCES
            if not (own or standard or posix or header.startswith(("Eigen/", "unsupported/Eigen/", "exmat/"))):
                yield f"{name}:{number}: includes {header}"


def hot_path(root):
    """No streams and no exceptions in runtime/sim."""
    for name, path in sources(root, ("runtime/sim",)):
        for number, header in includes(path):
            if header in STREAMS:
                yield f"{name}:{number}: includes {header}"
        for number, line in enumerate(without_comments_and_strings(path.read_text()).splitlines(), 1):
            if re.search(r"\b(throw|try|catch)\b", line):
                yield f"{name}:{number}: {line.strip()}"


def petsc(root):
    """PETSc and SLEPc are seen in precompute/solvers alone."""
    for name, path in sources(root):
        inside = name.startswith("precompute/solvers/")
        for number, header in includes(path):
            foreign = re.match(r"(petsc|slepc|mpi)", header)
            public = inside and path.suffix == ".h" and name not in PRIVATE_HEADERS
            if (foreign and (not inside or public)) or (header in PRIVATE_HEADERS and (not inside or public)):
                yield f"{name}:{number}: includes {header}"


def decompositions(root):
    """What uses a decomposition of Eigen's includes common/core/decompositions.h, where those of MatrixXd are compiled once."""
    one = "common/core/decompositions.h"
    used = re.compile(r"\b(LLT|LDLT|PartialPivLU|\w*HouseholderQR|\w+SVD|\w*EigenSolver)<|[.](llt|ldlt|partialPivLu|lu|\w*[hH]ouseholderQr|completeOrthogonalDecomposition|\w+Svd)\(")
    for name, path in sources(root, ("common", "precompute", "runtime", "tests")):
        if name in (one, "common/core/decompositions.cpp"):
            continue
        headers = {header for _, header in includes(path)}
        for header in headers:
            if re.fullmatch(r"Eigen/(Eigenvalues|SVD|QR|Cholesky|Dense)", header):
                yield f"{name}: includes {header}"
        if one not in headers and used.search(without_comments_and_strings(path.read_text())):
            yield f"{name}: does not include {one}"


def hdf5(root):
    """HDF5 is seen in common/hdf5 alone."""
    for name, path in sources(root):
        for number, header in includes(path):
            if re.match(r"(hdf5|H5)", header) and not name.startswith("common/hdf5/"):
                yield f"{name}:{number}: includes {header}"


def public_headers(root):
    """What is installed includes the standard library and itself: no internals, nothing that a consumer would have to have."""
    for name, path in sources(root, ("runtime/include",)):
        standard = r"(std[a-z]+\.h|exmat/[a-z]+\.h)" if path.suffix == ".h" else r"([a-z_0-9]+|exmat/[a-z]+\.hp*)"
        for number, header in includes(path):
            if not re.fullmatch(standard, header):
                yield f"{name}:{number}: includes {header}"


def layouts(root):
    """The structs that the web package reads and writes have there the members of the C interface, no other and no fewer."""
    name = "runtime/ports/wasi/layouts.cpp"
    listed = set(re.findall(r"(?<!define )EXMAT_MEMBER\((\w+), (\w+)\)", (root / name).read_text())) if (root / name).exists() else set()
    structs = {struct for struct, _ in listed}
    declared = {(struct, member) for _, path in sources(root, ("runtime/include",))
                for struct, body in re.findall(r"typedef struct exmat_(\w+) \{(.*?)\}", without_comments_and_strings(path.read_text()), re.S)
                for member in re.findall(r"(\w+)\s*(?:\[\w+\])?\s*[;,]", body) if struct in structs and member != "reserved"}
    for struct, member in sorted(listed ^ declared):
        yield f"{name}: {struct}.{member} is {'not there' if (struct, member) in declared else 'of no public header'}"


def python_module(root):
    """The Python package sees the public interface, pybind11 and the standard library: what it can do, any program can."""
    for name, path in sources(root, ("runtime/python",)):
        for number, header in includes(path):
            if not re.fullmatch(r"[a-z_0-9]+|exmat/exmat\.hp*|pybind11/.*|runtime/python/.*", header):
                yield f"{name}:{number}: includes {header}"


def viewer(root):
    """The viewer sees the public interface, what reads JSON and writes files, and its own libraries: what it can do, any program can. OpenGL,
    GLFW and Dear ImGui are seen there alone; what its tests run without a picture is without them."""
    graphics = re.compile(r"epoxy/|GLFW/|imgui|backends/imgui|stb/")
    shown = ("runtime/viewer/app/", "runtime/viewer/panels/", "runtime/viewer/drawing/", "runtime/viewer/recording/")
    for name, path in sources(root):
        inside = name.startswith("runtime/viewer/")
        for number, header in includes(path):
            own = header.startswith(("runtime/viewer/", "common/config/", "common/core/", "common/console/"))
            if (inside and OWN.match(header) and not own) or (graphics.match(header) and not name.startswith(shown)):
                yield f"{name}:{number}: includes {header}"


def one_header(root):
    """In runtime/sim each source has a header of its name: a class has one of either."""
    for name, path in sources(root, ("runtime/sim",)):
        if path.suffix == ".cpp" and not path.with_suffix(".h").exists():
            yield f"{name}: has no header of its name"


def mirrored_tests(root):
    """A unit test lies where its subject does."""
    for stage in ("common", "precompute", "runtime"):
        for path in sorted((root / "tests" / stage).rglob("*_test.cpp")):
            folder = path.parent.relative_to(root / "tests")
            if not (root / folder).is_dir():
                yield f"tests/{folder}/{path.name}: there is no folder {folder}"


def columns(root):
    """Lines of pages fit beside another window: at most 120 columns, but for rows of tables, what programs print (fences)
    and a line that is one link, one picture or one word. The changelog is a list for search, not a page."""
    for path in sorted({*root.glob("*.md"), *(root / "docs").rglob("*.md"), *(root / "examples").rglob("*.md")}):
        fenced = False
        for number, line in enumerate(path.read_text().splitlines(), 1):
            fenced ^= line.startswith("```")
            whole = line.startswith(("|", "![")) or fenced or " " not in re.sub(r"\[[^\]]*\]\(\S*\)\S*", "", line.strip())
            if len(line) > WIDEST and not whole and path.name != "CHANGELOG.md":
                yield f"{path.relative_to(root)}:{number}: {len(line)} columns, more than {WIDEST}"


def top_level(root):
    """Nothing but what the architecture names stands at the top."""
    listed = subprocess.run(["git", "-C", str(root), "ls-files"], capture_output=True, text=True)
    names = {line.split("/")[0] for line in listed.stdout.splitlines()} or {path.name for path in root.iterdir()}
    for name in sorted(names):
        if name not in TOP_LEVEL and not name.startswith("."):
            yield f"{name}: not in the list"


def formatting(root):
    """clang-format has nothing to change."""
    files = [str(path) for _, path in sources(root, ("common", "precompute", "runtime", "tests"))]
    result = subprocess.run(["clang-format", "--dry-run", f"--style=file:{Path(__file__).parents[2] / '.clang-format'}", *files],
                            capture_output=True, text=True)
    for line in result.stderr.splitlines():
        if "warning:" in line or "error:" in line:
            yield line


RULES = {rule.__name__: rule for rule in (direction, lean, hot_path, petsc, decompositions, hdf5, public_headers, layouts, python_module, viewer, one_header, mirrored_tests, references, columns, top_level,
                                        formatting)}


def violations(root):
    return [f"{name}: {found}" for name, rule in RULES.items() for found in rule(root)]


def main():
    found = violations(Path(sys.argv[1]).resolve())
    print("\n".join(found) if found else f"{len(RULES)} rules hold")
    return 1 if found else 0


if __name__ == "__main__":
    sys.exit(main())
