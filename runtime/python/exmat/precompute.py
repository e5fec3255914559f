"""The offline stage: runs the program exmat-precompute.

The program is the argument `program`, else the environment's EXMAT_PRECOMPUTE, else the one of the same build, else that
of the PATH. Members of assets, scenes and studies are those of their files. A mesh may be arrays instead of a path:
(vertices, tets) of shapes (n, 3) [m] and (n_t, 4), of a pose the vertices alone where it has the rest example's or the
object's tets. A surface may be (vertices, triangles), or a dict of these and of parts, which name a number for each vertex,
above 0.5 inside; a pose of it the vertices alone. Relative paths in members are relative to the current folder.
"""
import json
import os
import pathlib
import queue
import shutil
import subprocess
import tempfile
import threading
from typing import Any, Callable, Iterator, List, Mapping, NamedTuple, Optional, Sequence, Union

from .errors import BadInput, Cancelled, Failure, InvalidArgument
from .inputs import write_asset, write_members, write_mesh, write_surface
from .surfaces import write_glb

StrPath = Union[str, "os.PathLike[str]"]
Members = Union[StrPath, Mapping[str, Any]]


class Progress(NamedTuple):
    """How far a stage is."""

    stage: str
    done: int
    total: int  #: 0 where it is not known
    elapsed_seconds: float
    finished: bool
    remaining_seconds: Optional[float] = None


Listener = Callable[[Progress], None]


class Record(Mapping[str, Any]):
    """Members of a JSON object, as attributes and by name."""

    def __init__(self, members: Mapping[str, Any]) -> None:
        self._members = {name: _record(value) for name, value in members.items()}

    def __getattr__(self, name: str) -> Any:
        try:
            return self.__dict__["_members"][name]
        except KeyError:
            raise AttributeError(f"there is no {name}; there are {', '.join(self.__dict__.get('_members', {}))}") from None

    def __getitem__(self, name: str) -> Any:
        return self._members[name]

    def __iter__(self) -> Iterator[str]:
        return iter(self._members)

    def __len__(self) -> int:
        return len(self._members)

    def __dir__(self) -> List[str]:
        return [*super().__dir__(), *self._members]

    def __repr__(self) -> str:
        return f"{type(self).__name__}({', '.join(f'{name}={value!r}' for name, value in self._members.items())})"


class BundleReport(Record):
    """How a bundle was made: status, warnings, stages, examples, cubature, fidelity and more, as the schema of reports has it."""


class Example(NamedTuple):
    """How an example was laid upon the object."""

    name: str
    method: str
    doubt: float  #: 0 is certain
    residual: float  #: distance of the surfaces over the body's size
    inverted_fraction: float
    competing_maps: int
    shape_space_error: float  #: share of the pose that the eigenfunctions lose
    verdict: str  #: "good", "doubtful" or "refused"


class CheckReport(NamedTuple):
    """What a check found."""

    examples: List[Example]
    warnings: List[str]


class StudyResult(Record):
    """Points of a study with their errors and times: what results.json of its folder holds, which is `folder`."""

    folder: pathlib.Path


class Job:
    """A run of the program in the background.

    Listeners and results belong to the thread that calls poll(), wait() or result(); the program runs on by itself.
    """

    def __init__(self, arguments: Sequence[str], finish: Callable[["Job"], Any], folder: "tempfile.TemporaryDirectory[str]",
                 progress: Optional[Listener], program: Optional[StrPath], threads: int) -> None:
        self._folder, self._finish, self._listener = folder, finish, progress
        self._events: "queue.Queue[Progress]" = queue.Queue()
        self._cancelled = False
        self.latest: Optional[Progress] = None  #: the last progress that poll() saw
        self.log: List[str] = []  #: lines of the program's log
        self.output = ""  #: what it printed, when it has ended
        self._program = _program(program)
        command = [self._program, "--progress", "json", "--threads", str(threads), *arguments]
        try:
            self._process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, stdin=subprocess.DEVNULL, text=True,
                                             errors="replace")
        except OSError as error:
            folder.cleanup()
            raise Failure(f"{self._program}: {error.strerror}; expected the program exmat-precompute") from None
        except ValueError:
            folder.cleanup()
            raise InvalidArgument("expected paths as text, found a zero byte") from None
        self._readers = [threading.Thread(target=self._read_errors, daemon=True), threading.Thread(target=self._read_output, daemon=True)]
        for reader in self._readers:
            reader.start()

    def poll(self) -> bool:
        """Calls the listener with what is new. Whether the program has ended."""
        ended = self._process.poll() is not None and not any(reader.is_alive() for reader in self._readers)
        while not self._events.empty():
            self._hear(self._events.get())
        return ended

    def wait(self, timeout: Optional[float] = None) -> bool:
        """Waits until the program has ended, at most `timeout` seconds. Where the listener raises, the program is ended first."""
        try:
            waited = 0.0
            while not self.poll():
                if timeout is not None and waited >= timeout:
                    return False
                try:
                    self._hear(self._events.get(timeout=0.05))
                except queue.Empty:
                    waited += 0.05
            return True
        except BaseException:
            self.cancel()
            raise

    def cancel(self) -> None:
        """Ends the program. Its outputs are as they were; result() raises Cancelled."""
        if self._process.poll() is not None:
            return
        self._cancelled = True
        self._process.terminate()
        try:
            self._process.wait(5)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait()

    def result(self) -> Any:
        """Waits, and returns what the run is for. Raises BadInput, Failure or Cancelled, with the program's message."""
        self.wait()
        for stream in (self._process.stdout, self._process.stderr):
            if stream is not None:
                stream.close()
        try:
            if self._cancelled:
                raise Cancelled("cancelled; nothing was written")
            if self._process.returncode != 0:
                raise (BadInput if self._process.returncode == 2 else Failure)(self._message())
            try:
                return self._finish(self)
            except (OSError, ValueError):
                raise Failure(f"{self._program}: it ended without a result; expected the program exmat-precompute") from None
        finally:
            self._folder.cleanup()

    @property
    def warnings(self) -> List[str]:
        """Of the log."""
        return [line.split("[warning] ", 1)[1] for line in self.log if "[warning] " in line]

    def _hear(self, progress: Progress) -> None:
        self.latest = progress
        if self._listener is not None:
            self._listener(progress)

    def _message(self) -> str:
        lines = [line.split("exmat-precompute: ", 1)[1] for line in self.log if line.startswith("exmat-precompute: ")]
        message = lines[-1] if lines else "\n".join(self.log[-5:]) or f"it ended with status {self._process.returncode}"
        return message.replace(self._folder.name + os.sep, "")

    def _read_errors(self) -> None:
        assert self._process.stderr is not None
        for line in self._process.stderr:
            if line.startswith("{"):
                try:
                    self._events.put(Progress(**json.loads(line)))
                    continue
                except (ValueError, TypeError):
                    pass
            self.log.append(line.rstrip("\n"))

    def _read_output(self) -> None:
        assert self._process.stdout is not None
        self.output = self._process.stdout.read()


def start_bundle(asset: Members, out: StrPath, scene: Optional[Members] = None, progress: Optional[Listener] = None, *,
                 cache: Optional[StrPath] = None, if_changed: bool = False, training_budget: Optional[float] = None, threads: int = 0,
                 program: Optional[StrPath] = None) -> Job:
    """As bundle(), in the background: the Job's result() is the BundleReport."""
    folder = tempfile.TemporaryDirectory(prefix="exmat_")
    place = pathlib.Path(folder.name)
    report = place / "report.json"
    arguments = ["bundle", str(write_asset(asset, place)), "-o", os.path.abspath(out), "--report", str(report)]
    if scene is not None:
        members: Any = {"bundle": os.path.abspath(out), **scene} if isinstance(scene, Mapping) else scene
        arguments += ["--scene", str(write_members(members, place / "scene.json"))]
    if cache is not None:
        arguments += ["--cache", os.path.abspath(cache)]
    if if_changed:
        arguments.append("--if-changed")
    if training_budget is not None:
        arguments += ["--training-budget", str(training_budget)]
    return Job(arguments, lambda job: BundleReport(json.loads(report.read_text())), folder, progress, program, threads)


def bundle(asset: Members, out: StrPath, scene: Optional[Members] = None, progress: Optional[Listener] = None, *,
           cache: Optional[StrPath] = None, if_changed: bool = False, training_budget: Optional[float] = None, threads: int = 0,
           program: Optional[StrPath] = None) -> BundleReport:
    """Computes the offline stage and writes the bundle `out`.

    asset            path or members of an asset
    scene            path or members of the scene whose needs the bundle is to meet, and whose loads it learns from
    progress         is called with a Progress where a stage begins and ends, and a few times a second between; what it
                     raises ends the program
    cache            folder of results of stages, so that only what depends on a change is computed again
    if_changed       does nothing where the bundle was made of the same inputs
    training_budget  [s] after which no run of training begins
    threads          0: all cores; the result does not depend on it

    Raises BadInput (the asset or what it names), Failure; `out` is then as it was.
    """
    report: BundleReport = start_bundle(asset, out, scene, progress, cache=cache, if_changed=if_changed, training_budget=training_budget,
                                        threads=threads, program=program).result()
    return report


def check(asset: Members, progress: Optional[Listener] = None, *, alignment_report: Optional[StrPath] = None, threads: int = 0,
          program: Optional[StrPath] = None) -> CheckReport:
    """Reads and checks an asset's inputs and aligns its examples; computes nothing else.

    `alignment_report` is a folder for a page that shows each pose beside its example. Raises BadInput, and Failure where an
    alignment is refused.
    """
    folder = tempfile.TemporaryDirectory(prefix="exmat_")
    arguments = ["check", str(write_asset(asset, pathlib.Path(folder.name)))]
    if alignment_report is not None:
        arguments += ["--alignment-report", os.path.abspath(alignment_report)]

    def finish(job: Job) -> CheckReport:
        if ": sound, " not in job.output:
            raise ValueError
        return CheckReport(_examples(job.output), job.warnings)

    found: CheckReport = Job(arguments, finish, folder, progress, program, threads).result()
    return found


def study(given: Members, folder: StrPath, progress: Optional[Listener] = None, *, budget_us: Optional[float] = None,
          max_error: Optional[float] = None, jobs: int = 1, threads: int = 0, program: Optional[StrPath] = None) -> StudyResult:
    """Measures a scene's error against its run time over sweeps of settings; report.html and the rest go into `folder`.

    given      path or members of a study
    budget_us  recommend the most accurate point of at most so many us a step
    max_error  recommend the fastest point of at most so many percent of error
    jobs       processes that run points; times are measured by one

    Raises BadInput, and Failure where points failed or none is to be recommended.
    """
    place = tempfile.TemporaryDirectory(prefix="exmat_")
    arguments = ["study", str(write_members(given, pathlib.Path(place.name) / "study.json")), "-o", os.path.abspath(folder), "--jobs", str(jobs)]
    if budget_us is not None:
        arguments += ["--budget-us", str(budget_us)]
    if max_error is not None:
        arguments += ["--max-error", str(max_error)]

    def finish(_: Job) -> StudyResult:
        result = StudyResult(json.loads((pathlib.Path(folder) / "results.json").read_text()))
        result.folder = pathlib.Path(folder)
        return result

    measured: StudyResult = Job(arguments, finish, place, progress, program, threads).result()
    return measured


def _program(given: Optional[StrPath]) -> str:
    name = "exmat-precompute"
    if given is not None:
        if not isinstance(given, (str, os.PathLike)) or "\0" in os.fspath(given):
            raise InvalidArgument(f"program = {given!r}: expected the path of the program exmat-precompute")
        return os.fspath(given)
    if "EXMAT_PRECOMPUTE" in os.environ:
        return os.environ["EXMAT_PRECOMPUTE"]
    same_build = pathlib.Path(__file__).resolve().parents[2] / "bin" / name
    found = str(same_build) if same_build.exists() else shutil.which(name)
    if found is None:
        raise Failure(f"there is no {name}; install the package of this name, or set EXMAT_PRECOMPUTE to the program")
    return found


def _examples(output: str) -> List[Example]:
    lines = output.splitlines()
    head = next((place for place, line in enumerate(lines) if line.startswith("example ")), None)
    if head is None:
        return []
    found = []
    for line in lines[head + 1 :]:
        words = line.rsplit(None, 7)
        if len(words) < 8:
            break
        name, method, doubt, residual, inverted, competing, lost, verdict = words
        found.append(Example(name.strip(), method, float(doubt), float(residual) / 100, float(inverted) / 100, int(competing),
                             float(lost) / 100, verdict))
    return found


def _record(value: Any) -> Any:
    if isinstance(value, Mapping):
        return Record(value)
    return [_record(member) for member in value] if isinstance(value, list) else value


__all__ = ["BundleReport", "CheckReport", "Example", "Job", "Progress", "Record", "StudyResult", "bundle", "check", "start_bundle", "study",
           "write_glb", "write_mesh", "write_surface"]
