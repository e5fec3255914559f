"""Lines and regions of the readers that inputs of the fuzz targets reach, as a table on stdout.

    cmake --preset fuzz-coverage && cmake --build --preset fuzz-coverage
    python3 tests/fuzz/coverage.py build/fuzz-coverage [TARGET [CORPUS...]] [--missed] [--least FOLDER]

Without corpora those of tests/fuzz/corpus. --missed lists the lines that no input reaches; --least copies to FOLDER few
inputs that together reach as much as all do.
"""
import argparse
import json
import hashlib
import pathlib
import shutil
import subprocess
import sys
import tempfile

ROOT = pathlib.Path(__file__).resolve().parents[2]
MESH_IO = "precompute/mesh_io/"
SURFACE_IO = "common/surface_io/"
BUNDLE = ["common/bundle/bundle.cpp", "common/bundle/bundle_reader.cpp", "common/hdf5/hdf5_file.cpp",
          "common/bundle/validate.cpp", "common/hdf5/value_checks.cpp"]
# What is each target's own, by the beginning of the path, and what the mesh readers share.
SOURCES = {
    "veg": [MESH_IO + "veg_reader.cpp"],
    "msh": [MESH_IO + "msh_"],
    "mesh": [MESH_IO + "medit_reader.cpp"],
    "vtk": [MESH_IO + "vtk_"],
    "node": [MESH_IO + "tetgen_reader.cpp"],
    "obj": [SURFACE_IO + "obj_reader.cpp"],
    "ply": [SURFACE_IO + "ply_reader.cpp"],
    "stl": [SURFACE_IO + "stl_reader.cpp"],
    "glb": [MESH_IO + "gltf_"],
    "gltf": [MESH_IO + "gltf_"],
    "csv": [SURFACE_IO + "height_reader.cpp"],
    "pc2": [MESH_IO + "point_cache_reader.cpp"],
    "json": ["common/config/"],
    "skeleton": ["precompute/inputs/skeleton_file.cpp", MESH_IO + "animation_frames.cpp"],
    "bundle": BUNDLE,
    "bundle_edits": BUNDLE,
    "pack": ["common/bundle/"],
}
SHARED = [MESH_IO + "mesh_tables.cpp"] + [SURFACE_IO + name for name in ("commented_lines.cpp", "surface_parts.cpp",
                                                                         "text_input.cpp", "value_cursor.cpp")]


def replay(program, corpora, folder):
    """The profile of a target's run on files."""
    raw, merged = folder / "raw", folder / program.name
    environment = {"LLVM_PROFILE_FILE": str(raw)}
    run = subprocess.run([program, "-runs=0", *corpora], env=environment, capture_output=True, text=True)
    if run.returncode != 0:
        sys.exit(f"coverage: {program} failed:\n{run.stderr[-2000:]}")
    subprocess.run(["llvm-profdata", "merge", "-sparse", raw, "-o", merged], check=True)
    return merged


def files_of(programs, profiles, sources):
    """What llvm-cov says of sources after runs of programs, by paths in the repository."""
    merged = profiles[0].with_suffix(".all")
    subprocess.run(["llvm-profdata", "merge", "-sparse", *profiles, "-o", merged], check=True)
    objects = [f"-object={program}" for program in programs[1:]]
    command = ["llvm-cov", "export", programs[0], *objects, f"-instr-profile={merged}"]
    found = json.loads(subprocess.run(command, check=True, capture_output=True).stdout)["data"][0]["files"]
    files = {pathlib.Path(file["filename"]).resolve().relative_to(ROOT).as_posix(): file for file in found
             if pathlib.Path(file["filename"]).resolve().is_relative_to(ROOT)}
    return {name: file for name, file in files.items()
            if name.endswith(".cpp") and any(name.startswith(source) for source in sources)}


def missed_lines(file):
    """Numbers of the lines where code begins that was never run."""
    return sorted({line for line, _, count, has_count, is_entry, is_gap in file["segments"]
                   if has_count and is_entry and count == 0 and not is_gap})


def regions_of(program, target, corpora):
    """Where the regions of code begin that inputs reach."""
    with tempfile.TemporaryDirectory() as folder:
        files = files_of([program], [replay(program, corpora, pathlib.Path(folder))], SOURCES[target] + SHARED)
    return {(name, line, column) for name, file in files.items()
            for line, column, count, has_count, is_entry, _ in file["segments"] if has_count and is_entry and count > 0}


def copy_least(program, target, corpora, folder):
    """Takes, as long as there is one, the input that adds most; of two that add the same, the smaller."""
    inputs = sorted({file for corpus in corpora for file in pathlib.Path(corpus).iterdir()})
    reached = {file: regions_of(program, target, [file]) for file in inputs}
    left = set().union(*reached.values())
    folder.mkdir(parents=True, exist_ok=True)
    while left:
        best = max(inputs, key=lambda file: (len(reached[file] & left), -file.stat().st_size))
        left -= reached[best]
        shutil.copy(best, folder / hashlib.sha1(best.read_bytes()).hexdigest()[:12])


def percent(files, kind):
    counts = [file["summary"][kind] for file in files]
    return 100 * sum(count["covered"] for count in counts) / sum(count["count"] for count in counts)


def print_files(target, files, with_missed):
    for name, file in files.items():
        print(f"| {target} | {name} | {percent([file], 'lines'):.1f} % | {percent([file], 'regions'):.1f} % |")
        if with_missed:
            text = (ROOT / name).read_text().splitlines()
            for line in missed_lines(file):
                print(f"    {line}: {text[line - 1].strip()}")
    print(f"| {target} | all | {percent(files.values(), 'lines'):.1f} % | {percent(files.values(), 'regions'):.1f} % |")


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("build", type=pathlib.Path)
    parser.add_argument("target", nargs="?", choices=SOURCES)
    parser.add_argument("corpora", nargs="*")
    parser.add_argument("--missed", action="store_true")
    parser.add_argument("--least", type=pathlib.Path, metavar="FOLDER")
    arguments = parser.parse_intermixed_args()
    targets = [arguments.target] if arguments.target else list(SOURCES)
    programs, profiles = [arguments.build / "bin" / f"exmat_fuzz_{target}" for target in targets], []
    print("| target | file | lines | regions |\n| --- | --- | ---: | ---: |")
    with tempfile.TemporaryDirectory() as folder:
        for target, program in zip(targets, programs):
            corpora = arguments.corpora or [ROOT / "tests" / "fuzz" / "corpus" / target]
            if arguments.least:
                copy_least(program, target, corpora, arguments.least)
                corpora = [arguments.least]
            profiles.append(replay(program, corpora, pathlib.Path(folder)))
            print_files(target, files_of([program], profiles[-1:], SOURCES[target]), arguments.missed)
        if not arguments.target:
            distinct = list(dict.fromkeys(program.resolve() for program in programs))
            print_files("mesh readers", files_of(distinct, profiles, SHARED), arguments.missed)


if __name__ == "__main__":
    main()
