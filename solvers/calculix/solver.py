"""The solver CalculiX: it writes input decks, runs ccx as a subprocess, and reads its results."""

import logging
import os
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TypeVar

from ...errors import BubblefitError, InputError, SolverFailure
from ...materials.law import HypoelasticLaw
from ...meshes.bubble_model import BubbleModel
from ...meshes.cylinder_model import CylinderModel
from ...meshes.mesh import Mesh
from ...meshes.strip_models import PatchModel, UniaxialModel
from ..bars import checked_stresses, difference, strip_stresses
from ..base import Diagnosis, History, Progress, SolverCheck, analysis_of
from ..decks import JOB, UserDeck, in_words, templates_mark
from ..process import Watch, run_process
from ..scratch import run_folder, write_deck
from . import cylinder, sheets
from .deck import ELEMENTS, CalculixRun, Reader, Rescue, Setup, ShellMesh, shell_mesh
from .executable import (
    ADVICE,
    NAMED,
    ON_PATH,
    Executable,
    collapsed,
    every_ccx,
    find_ccx,
    increments,
    reason,
)
from .library import law_files, material_library

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


SECONDS = 120.0


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
            bar_stresses = strip_stresses(CalculixSolver(ccx.path, timeout=SECONDS))
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
