"""The solver CalculiX: it finds ccx, writes input decks, runs ccx and reads its results.

Only a ccx that can load material libraries carries the law; how a run ended is told by its log.
"""

import logging
import os
import re
import shutil
import subprocess
from collections.abc import Callable, Iterator, Mapping
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, Literal, TypeVar

from pydantic import Field

from ...errors import BubblefitError, InputError, SolverFailure
from ...materials.law import HypoelasticLaw
from ...meshes.bubble_model import BubbleModel
from ...meshes.cylinder_model import CylinderModel
from ...meshes.mesh import Mesh
from ...meshes.strip_models import PatchModel, UniaxialModel
from ...readers.sections import Positive
from ...storage.writing import cache_folder
from ..bars import checked_stresses, difference, strip_stresses
from ..base import Diagnosis, History, Progress, SolverCheck, analysis_of
from ..decks import JOB, UserDeck, in_words, templates_mark
from ..process import (
    Increment,
    Outcome,
    Watch,
    disk_full,
    log_tail,
    number_rows,
    program_at,
    run_process,
)
from ..scratch import run_folder, write_deck
from ..settings import ExternalSettings, Override
from . import cylinder, sheets
from .deck import ELEMENTS, CalculixRun, Reader, Rescue, Setup, ShellMesh, shell_mesh
from .library import law_files, material_library

VARIABLE = "BUBBLEFIT_CCX"
#: Origins of a ccx that somebody chose: there has to be nothing wrong with these.
NAMED = "named"
ENVIRONMENT = VARIABLE
BUILT = "make calculix"
ON_PATH = "PATH"
ADVICE = (
    "in bubblefit's repository, `make calculix` builds one; or name one by --ccx or BUBBLEFIT_CCX"
)
#: Words that only a ccx built with CALCULIX_EXTERNAL_BEHAVIOURS_SUPPORT has in it.
TRACE = b"empty library name"


@dataclass(frozen=True)
class Executable:
    """A ccx; version "?": does not tell; external: loads libraries, None: not to be seen."""

    path: Path
    version: str
    external: bool | None
    origin: str


def find_ccx(named: Path | str | None = None) -> Executable:
    """Return `named`, else BUBBLEFIT_CCX, else the one `make calculix` built, else one on the PATH.

    What somebody named is taken or refused. InputError: it is no program. SolverFailure: there is
    none, or none that can load material libraries.
    """
    without = None
    for candidate in every_ccx(named):
        if candidate.external is not False:
            return candidate
        if candidate.origin in (NAMED, ENVIRONMENT):
            raise SolverFailure(
                f"{candidate.path} cannot load material libraries; {ADVICE}", "calculix"
            )
        without = without or candidate
    if without is not None:
        problem = f"no ccx that can load material libraries ({without.path} cannot); {ADVICE}"
        raise SolverFailure(problem, "calculix")
    raise SolverFailure(f"there is no ccx; {ADVICE}", "calculix")


def every_ccx(named: Path | str | None = None) -> list[Executable]:
    """Return all there are, each once, in the order in which `find_ccx` prefers them."""
    resolved_paths: set[Path] = set()
    executables = []
    for path, origin in _places(named):
        real = path.resolve()
        if real in resolved_paths:
            continue
        resolved_paths.add(real)
        executables.append(Executable(path, version_of(path), carries_external(path), origin))
    return executables


def carries_external(path: Path) -> bool | None:
    """Return whether a ccx can load material libraries; None when it is no binary to look into."""
    try:
        content = path.read_bytes()
    except OSError:
        return None
    if not content.startswith(b"\x7fELF"):
        return None
    return TRACE in content


def version_of(path: Path) -> str:
    """Return what `ccx -v` says, "?" when it says nothing of the kind."""
    with suppress(OSError, subprocess.SubprocessError):
        process = subprocess.run(
            [path, "-v"], capture_output=True, timeout=30.0, stdin=subprocess.DEVNULL
        )
        version = re.search(rb"Version\s+(\S+)", process.stdout)
        if version:
            return version[1].decode(errors="replace")
    return "?"


def _places(named: Path | str | None) -> Iterator[tuple[Path, str]]:
    """Yield the programs that may be meant, and where they are from, the preferred first.

    They are named, then of the environment, then built by bubblefit, then on the PATH.
    """
    if named is not None:
        yield _program(named, "ccx"), NAMED
    chosen = os.environ.get(VARIABLE)
    if chosen:
        yield _program(chosen, VARIABLE), ENVIRONMENT
    built = (cache_folder() / "calculix").glob("ccx-*-external/ccx")
    # The newest first: a distribution that moves on leaves the older one behind.
    for path in sorted(built, key=lambda p: p.stat().st_mtime_ns, reverse=True):
        if _runs(path):
            yield path, BUILT
    for folder in os.environ.get("PATH", "").split(os.pathsep):
        if not folder:
            continue
        with suppress(OSError):
            for path in sorted(Path(folder).glob("ccx*")):
                if re.fullmatch(r"ccx(_[0-9][0-9.]*\w*)?", path.name) and _runs(path):
                    yield path, ON_PATH


def _program(path: Path | str, field: str) -> Path:
    """Return the path of a program that somebody named; a bare name is looked up on the PATH."""
    program = Path(os.path.expanduser(path))
    if os.sep not in str(path) and (on_path := shutil.which(program)):
        return Path(on_path)
    return program_at(program, field, "ccx")


def _runs(path: Path) -> bool:
    return path.is_file() and os.access(path, os.X_OK)


FINISHED = "Job finished"
_ERROR = re.compile(r"^\s*\*ERROR\b:?\s*(.*(?:\n {6,}\S.*)*)", re.MULTILINE)
_JACOBIAN = re.compile(r"nonpositive jacobian.*?element\s*(\d*)", re.IGNORECASE | re.DOTALL)
#: CalculiX' own word for an increment that it cannot make any smaller.
_GAVE_UP = re.compile(
    r"increment size smaller than minimum|too many cutbacks|best solution and residuals",
    re.IGNORECASE,
)
_TOO_SMALL = re.compile(rf"{_GAVE_UP.pattern}|max\. # of increments", re.IGNORECASE)


def increments(sta: Path) -> list[Increment]:
    """Read the increments of a .sta file so far, without attempts given up or half a line."""
    rows = [row for row in number_rows(sta) if len(row) >= 5]
    return [Increment(int(a), int(b), int(d), time) for a, b, _, d, time, *_ in rows]


def reason(
    folder: Path,
    job: str,
    outcome: Outcome,
    timeout: float | None,
) -> str | None:
    """Return one line on why a run did not end well; None when it says that it did."""
    log = folder / f"{job}.log"
    text = log_tail(log, 400)
    finished = increments(folder / f"{job}.sta")
    reached = (
        f"after step {finished[-1].step}, increment {finished[-1].increment}"
        if finished
        else "at once"
    )
    if outcome.timed_out:
        return f"did not end within {timeout:g} s: killed {reached}"
    full = disk_full(folder, text.splitlines(), outcome)
    if full:
        return f"disk full {reached}: {full}"
    if outcome.signal_name:
        return f"killed by {outcome.signal_name} {reached}"
    jacobian = _JACOBIAN.search(text)
    if jacobian:
        where = f" in element {jacobian[1]}" if jacobian[1] else ""
        return f"negative Jacobian{where} {reached}"
    if _TOO_SMALL.search(text):
        at = (
            f"step {finished[-1].step}, increment {finished[-1].increment + 1}"
            if finished
            else "increment 1"
        )
        return f"did not converge at {at}: the increments became too small or too many"
    error = _ERROR.search(text)
    if error:
        return f"{' '.join(error[1].split())} ({reached})"
    if outcome.exit_code != 0:
        return f"ended badly {reached}"
    if FINISHED not in text:
        return f"ended without '{FINISHED}' {reached}: is this CalculiX?"
    return None


def collapsed(folder: Path, job: str, outcome: Outcome) -> bool:
    """Return whether CalculiX gave up: what converged is a result, unlike at other bad ends."""
    text = log_tail(folder / f"{job}.log", 400)
    if outcome.timed_out or outcome.signal_name or disk_full(folder, text.splitlines(), outcome):
        return False
    return _GAVE_UP.search(text) is not None and _JACOBIAN.search(text) is None


class CalculixSettings(ExternalSettings):
    """The settings of CalculiX; `CalculixSolver` says what each key means."""

    paths = ("templates", "scratch", "licence_folder")
    programs = started = ("ccx",)
    overrides = (
        Override(
            "ccx",
            "The CalculiX to run.",
            metavar="PATH",
            look="A CalculiX to look at beside the ones found.",
        ),
        Override("templates", "Folder of your own input decks.", metavar="PATH", path=True),
        Override("element", "Shell element", "S8R or S4"),
    )

    ccx: str | None = None
    templates: str | None = None
    element: Literal["S8R", "S4"] = "S8R"
    timeout: Positive = 3600.0
    scratch: str | None = None
    keep: bool = False
    threads: Annotated[int, Field(ge=1)] = 1


log = logging.getLogger(__name__)

TIMEOUT_S = 3600.0
T = TypeVar("T")


def analyse_user_deck(
    model: UserDeck,
    law: HypoelasticLaw,
    setup: Setup,
    run: CalculixRun,
) -> History:
    """Run a deck of the user's; SolverFailure if the run fails or its results lack a value."""
    return run(model.files, lambda frd, iterations: model.reader.read(frd.parent))


#: Analyses by the class of the model.
ANALYSES: dict[type, Callable[[Any, HypoelasticLaw, Setup, CalculixRun], History]] = {
    BubbleModel: sheets.analyse_bubble,
    UniaxialModel: sheets.analyse_strip,
    CylinderModel: cylinder.analyse,
    PatchModel: sheets.analyse_patch,
    UserDeck: analyse_user_deck,
}


@dataclass(eq=False)
class CalculixSolver:
    """Solver that runs CalculiX as a subprocess.

    Parameters
    ----------
    ccx : Path or str, optional
        The program; found by `find_ccx` unless given.
    templates : Path, optional
        Folder of the user's templates of decks.
    element : "S8R" or "S4"
        Shell element.
    timeout : float, s
        Time after which a run is ended.
    scratch : Path, optional
        Folder in which runs get their scratch folders; in memory, else the temporary folder, unless
        given.
    keep : bool
        Whether the scratch folders of successful runs are kept, too.
    threads : int
        Number of threads of a run.
    progress : callable, optional
        Called after every increment.

    Raises
    ------
    InputError
        For another element, or a folder of templates that does not exist.
    """

    ccx: Path | str | None = None
    templates: Path | None = None
    element: str = "S8R"
    timeout: float = TIMEOUT_S
    scratch: Path | None = None
    keep: bool = False
    threads: int = 1
    progress: Callable[[Progress], None] | None = None

    name = "calculix"
    external = load_ratios = True

    def __post_init__(self) -> None:
        if self.element not in ELEMENTS:
            problem = f"expected one of {', '.join(ELEMENTS)}, got {self.element!r}"
            raise InputError(None, "solver.calculix.element", problem)
        if self.templates is not None and not self.templates.is_dir():
            raise InputError(self.templates, "templates", "there is no such folder")
        self._found: Executable | None = None
        self._shells: tuple[Mesh, ShellMesh] | None = None

    @property
    def identity(self) -> str:
        """Return the version of ccx, the element, and a digest of the user's templates."""
        try:
            version = self.executable().version
        except BubblefitError:
            version = ""  # whoever runs it is told
        marks = {"element": self.element, "templates": templates_mark(self.templates)}
        return in_words(self.name, version, **marks)

    @property
    def programs(self) -> tuple[Path, ...]:
        """Return the paths of ccx and of the material library."""
        return self.executable().path, material_library()

    def check(self) -> SolverCheck:
        """Check whether there is a ccx, and whether it can load the material library."""
        try:
            executable = self.executable()
        except SolverFailure as failure:
            return SolverCheck(self.name, False, "", False, failure.reason)
        carries = executable.external is not False
        return SolverCheck(self.name, True, executable.version, carries, "" if carries else ADVICE)

    def executable(self) -> Executable:
        """Return the ccx to run; it is searched only once."""
        if self._found is None:
            self._found = find_ccx(self.ccx)
        return self._found

    def run(
        self,
        model: Any,
        law: HypoelasticLaw,
        scratch: Path | None = None,
        timeout: float | None = None,
    ) -> History:
        """Run the analysis of a model and return its history; see `Solver.run`.

        SolverFailure of a failed run names its scratch folder. InputError for a model or a template
        that cannot be used.
        """

        place = scratch or self.scratch
        deck_timeout = model.timeout if isinstance(model, UserDeck) else None
        seconds = timeout or deck_timeout or self.timeout

        def run(
            files: Mapping[str, str | bytes], read: Reader[T], rescue: Rescue[T] | None = None
        ) -> T:
            return self._once({**files, **law_files(law)}, read, place, seconds, rescue)

        analyse = analysis_of(ANALYSES, model, self.name)
        return analyse(model, law, Setup(self.element, self.templates, self._shell_mesh), run)

    def _once(
        self,
        files: Mapping[str, str | bytes],
        read: Reader[T],
        parent: Path | None,
        timeout: float,
        rescue: Rescue[T] | None = None,
    ) -> T:
        """Run CalculiX once in a new scratch folder; see `CalculixRun` for `read` and `rescue`."""
        program = self.executable().path
        library = material_library()
        with run_folder("ccx", parent, self.keep, self.name, f"{JOB}.log") as folder:
            write_deck(folder, files)
            log_file, sta, frd = (folder / f"{JOB}.{end}" for end in ("log", "sta", "frd"))
            counts = ("OMP_NUM_THREADS", "CCX_NPROC_STIFFNESS", "CCX_NPROC_EQUATION_SOLVER")
            environment = dict.fromkeys(counts, str(self.threads))
            search = (str(library.parent), os.environ.get("LD_LIBRARY_PATH"))
            environment["LD_LIBRARY_PATH"] = os.pathsep.join(filter(None, search))
            watch = None if self.progress is None else Watch(lambda: increments(sta), self.progress)
            command: list[str | Path] = [program, "-i", JOB]
            outcome = run_process(
                command,
                folder,
                log_file,
                timeout,
                environment,
                watch,
            )
            problem = reason(folder, JOB, outcome, timeout)
            finished = increments(sta)
            iterations = sum(i.iterations for i in finished)
            if problem is None:
                return read(frd, iterations)
            log.info("stopped early: %s", problem)
            failure = SolverFailure(problem, self.name, outcome.exit_code)
            if rescue is None or not collapsed(folder, JOB, outcome):
                raise failure
            try:
                return rescue(frd, iterations, {(i.step, i.increment) for i in finished}, problem)
            except SolverFailure:
                # Why it stopped says more than what its results then lack.
                raise failure from None

    def _shell_mesh(self, mesh: Mesh) -> ShellMesh:
        if self._shells is None or self._shells[0] is not mesh:
            self._shells = (mesh, shell_mesh(mesh, self.element))
        return self._shells[1]


def diagnose(named: Path | str | None = None) -> list[Diagnosis]:
    """Return the diagnoses of all CalculiX programs on this machine.

    Parameters
    ----------
    named
        A further program to be tried. Without any, the one diagnosis has no path.
    """
    try:
        candidates = every_ccx(named)
    except BubblefitError as error:
        return [_absent(str(error), NAMED, True)]
    if not candidates:
        return [_absent(f"there is no ccx; {ADVICE}", "not found", False)]
    return [_tried(candidate) for candidate in candidates]


def _absent(advice: str, origin: str, expected: bool) -> Diagnosis:
    """Return the diagnosis of a program that is not there."""
    return Diagnosis(name="calculix", origin=origin, expected=expected, advice=advice)


def _tried(ccx: Executable) -> Diagnosis:
    """Return the diagnosis of a program after it ran the strip by which programs are checked."""
    stresses = None
    off = None
    advice = ""
    if ccx.external is False:
        advice = f"cannot load material libraries; {ADVICE}"
    else:
        try:
            bar_stresses = strip_stresses(CalculixSolver(ccx.path, timeout=120.0))
            stresses = checked_stresses(bar_stresses, str(ccx.path), "calculix")
            off = difference(stresses)
        except BubblefitError as error:
            advice = str(error).splitlines()[0]
    carries = {True: "yes", False: "no", None: "cannot be seen"}[ccx.external]
    return Diagnosis(
        name="calculix",
        version=ccx.version,
        path=ccx.path,
        origin=ccx.origin,
        expected=ccx.origin != ON_PATH,
        external_materials=ccx.external,
        usable=stresses is not None,
        stresses=stresses,
        difference=off,
        advice=advice,
        remark=f"external materials: {carries}",
    )
