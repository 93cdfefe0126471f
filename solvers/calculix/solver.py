"""CalculiX behind the solver protocol: a deck, a subprocess, its results."""

from __future__ import annotations

import logging
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any, TypeVar

from ...errors import BubblefitError, InputError, SolverFailure
from ...materials.law import HypoelasticLaw
from ...meshes.bubble_model import BubbleModel
from ...meshes.cylinder_model import CylinderModel
from ...meshes.mesh import Mesh
from ...meshes.strip_models import PatchModel, UniaxialModel
from ..base import History, Progress, SolverCheck, analysis_of
from ..decks import in_words, templates_mark
from ..process import Watch, run_process
from ..scratch import run_folder
from . import cylinder, sheets
from .deck import ELEMENTS, Reader, Rescue, Run, Setup, ShellMesh, shell_mesh
from .executable import ADVICE, Executable, collapsed, find_ccx, increments, reason
from .library import law_files, material_library

log = logging.getLogger(__name__)

JOB = "job"
TIMEOUT_S = 3600.0
T = TypeVar("T")
#: What is done with each model.
ANALYSES: dict[type, Callable[[Any, HypoelasticLaw, Setup, Run], History]] = {
    BubbleModel: sheets.analyse_bubble,
    UniaxialModel: sheets.analyse_strip,
    CylinderModel: cylinder.analyse,
    PatchModel: sheets.analyse_patch,
}


class CalculixSolver:
    """CalculiX as a subprocess.

    Parameters
    ----------
    ccx : the program; found by `find_ccx` unless given.
    templates : the user's own folder of templates, see docs/how-to/calculix.md.
    element : "S8R" or "S4".
    timeout : s, of one run, unless `run` is given another.
    scratch : folder for scratch folders; memory, else the temporary folder, unless given.
    keep : keep scratch folders of runs that end well, too.
    threads : of one run; starts run side by side already.
    progress : called with every increment that converged while a run is under way.

    Raises
    ------
    InputError : an element there is not, a template folder that is not there.
    """

    name = "calculix"
    external = True

    def __init__(
        self,
        ccx: Path | str | None = None,
        templates: Path | None = None,
        element: str = "S8R",
        timeout: float = TIMEOUT_S,
        scratch: Path | None = None,
        keep: bool = False,
        threads: int = 1,
        progress: Callable[[Progress], None] | None = None,
    ) -> None:
        if element not in ELEMENTS:
            problem = f"expected one of {', '.join(ELEMENTS)}, got {element!r}"
            raise InputError(None, "solver.calculix.element", problem)
        if templates is not None and not templates.is_dir():
            raise InputError(templates, "templates", "there is no such folder")
        self.ccx, self.templates, self.element = ccx, templates, element
        self.timeout, self.scratch, self.keep = timeout, scratch, keep
        self.threads, self.progress = threads, progress
        self._found: Executable | None = None
        self._shells: tuple[Mesh, ShellMesh] | None = None

    @property
    def identity(self) -> str:
        """Return the version of ccx, the element, and the user's templates by what is in them."""
        try:
            version = self.executable().version
        except BubblefitError:
            version = ""  # whoever runs it is told
        marks = {"element": self.element, "templates": templates_mark(self.templates)}
        return in_words(self.name, version, **marks)

    @property
    def programs(self) -> tuple[Path, ...]:
        """Return the ccx that runs, and the library that carries the law."""
        return self.executable().path, material_library()

    def check(self) -> SolverCheck:
        """Return whether there is a ccx that can load the law; its version."""
        try:
            found = self.executable()
        except SolverFailure as failure:
            return SolverCheck(self.name, False, "", False, failure.reason)
        carries = found.external is not False
        return SolverCheck(self.name, True, found.version, carries, "" if carries else ADVICE)

    def executable(self) -> Executable:
        """Return the ccx that runs, looked for once."""
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
        """Inflate, pull or bend the model, `timeout` s for a run, in a folder below `scratch`.

        SolverFailure: it did not end well; the scratch folder is kept and named. InputError: a
        template that cannot be used, a ccx that cannot be started.
        """

        place, seconds = scratch or self.scratch, timeout or self.timeout

        def run(files: Mapping[str, str], read: Reader[T], rescue: Rescue[T] | None = None) -> T:
            return self._once({**files, **law_files(law)}, read, place, seconds, rescue)

        analyse = analysis_of(ANALYSES, model, self.name)
        return analyse(model, law, Setup(self.element, self.templates, self._shell_mesh), run)

    def _once(
        self,
        files: Mapping[str, str],
        read: Reader[T],
        parent: Path | None,
        timeout: float,
        rescue: Rescue[T] | None = None,
    ) -> T:
        """Run in a fresh scratch folder; return what `read`, or `rescue` of a bad end, makes."""
        program, library = self.executable().path, material_library()
        with run_folder("ccx", parent, self.keep, self.name, f"{JOB}.log") as folder:
            try:
                for name, text in files.items():
                    (folder / name).write_text(text, encoding="ascii", errors="replace")
            except OSError as error:
                raise SolverFailure(f"the deck cannot be written: {error.strerror}") from None
            log_file, sta, frd = (folder / f"{JOB}.{end}" for end in ("log", "sta", "frd"))
            counts = ("OMP_NUM_THREADS", "CCX_NPROC_STIFFNESS", "CCX_NPROC_EQUATION_SOLVER")
            environment = dict.fromkeys(counts, str(self.threads))
            environment["LD_LIBRARY_PATH"] = str(library.parent)
            watch = None if self.progress is None else Watch(lambda: increments(sta), self.progress)
            command: list[str | Path] = [program, "-i", JOB]
            outcome = run_process(command, folder, log_file, timeout, environment, watch)
            problem, done = reason(folder, JOB, outcome, timeout), increments(sta)
            iterations = sum(i.iterations for i in done)
            if problem is None:
                return read(frd, iterations)
            log.info("stopped early: %s", problem)
            failure = SolverFailure(problem, self.name, outcome.exit_code)
            if rescue is None or not collapsed(folder, JOB, outcome):
                raise failure
            try:
                return rescue(frd, iterations, {(i.step, i.increment) for i in done}, problem)
            except SolverFailure:
                # Why it stopped says more than what its results then lack.
                raise failure from None

    def _shell_mesh(self, mesh: Mesh) -> ShellMesh:
        if self._shells is None or self._shells[0] is not mesh:
            self._shells = (mesh, shell_mesh(mesh, self.element))
        return self._shells[1]
