"""The interface of all solvers, the results of an analysis, and helpers that the adapters share."""

from __future__ import annotations

import logging
from collections.abc import Callable, Iterable, Mapping, Sequence
from contextlib import AbstractContextManager
from contextvars import ContextVar
from dataclasses import field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal, Protocol, TypeVar, cast, runtime_checkable

import numpy as np

from ..errors import InputError, SolverFailure, check_one_of
from ..lazy_modules import pandas as pd
from ..light_dataclasses import dataclass
from ..materials.law import HypoelasticLaw
from ..materials.memory import NAMES
from ..materials.wrinkles import relaxed_increments
from ..meshes.mesh import Array, Mesh, X, log_strain_of, meshio_of, surface_strain
from ..notes import Note, NoteKind
from ..processes import temporary_value
from .membrane.kernel import reference_elements

if TYPE_CHECKING:
    import meshio

EARLY = NoteKind("stopped early", mark=4)
SNAP = NoteKind("snap", mark=2)

log = logging.getLogger(__name__)

T = TypeVar("T")
#: Columns of the tables of a frame: places without load and displacements, mm; strain; stress, MPa.
POSITION_COLUMNS = ("x", "y", "z", "dx", "dy", "dz")
STRAIN_COLUMNS = ("eps1", "eps2", "gamma12")
STRESS_COLUMNS = ("sigma1", "sigma2", "tau12")
#: Up to this many loads are named one by one in a warning; of more, only the first and the last.
MAX_LISTED = 3
#: Where strain and stress are evaluated: in the middle of each element, or at its Gauss points.
Places = Literal["elements", "points"]
#: Names of the arrays of strain and stress in files for ParaView.
STRAIN_DATA = "log_strain_1_2_12"
STRESS_DATA = "stress_1_2_12_MPa"


def parameters_of(law: HypoelasticLaw, model: Any = None) -> tuple[str, ...]:
    """Return the names of all parameters by which a solver can differentiate its results.

    They are the entries of the law's beta ("beta_0", ...), "nu12", the parameters of the law's
    memory if it has one, and those that the model lists in its attribute `parameters`.
    """
    of_model = getattr(model, "parameters", ())
    remembered = () if law.memory is None else NAMES
    return (*(f"beta_{i}" for i in range(law.form.size)), "nu12", *remembered, *of_model)


def instability(unstable: Sequence[str] | None) -> str:
    """Return a warning that the equilibria at some loads are unstable; "" without such a load.

    Parameters
    ----------
    unstable : sequence of str or None
        The loads in words ("132 kPa"), or None where stability was not examined.
    """
    if not unstable:
        return ""
    places = ", ".join(unstable)
    if len(unstable) > MAX_LISTED:
        places = f"{len(unstable)} of the reported loads, from {unstable[0]} to {unstable[-1]}"
    return f"unstable equilibrium at {places}"


@dataclass(frozen=True, eq=False)
class History:
    """Results of an analysis, with one frame for each reported load.

    Attributes
    ----------
    load : (frames,) ndarray
        Pressure in MPa; force in N on a whole strip, or of the collar on a whole beam; for a
        biaxial patch the sum of its two loads in N/mm.
    displacement : (frames, nodes, 3) ndarray, mm
    strain_min, strain_max : (3,) ndarray
        Extremes of the log strains eps1, eps2, gamma12 over the analysis; zero is included.
    reactions : mapping of (frames, 3) ndarray, N
        Forces by the name of a node set or a rigid body.
    cavity_pressure, cavity_volume : (frames,) ndarray, or None
        Gauge pressure (MPa) and volume (mm^3) of the enclosed gas.
    iterations : int
        Number of iterations as the solver counts them.
    path, path_slope : ndarray, or None
        Displacements (increments, nodes, 3) in mm at every increment, and their derivatives
        (increments, nodes, 3, parameters): the next run can start from them.
    load_slope : (frames, parameters) ndarray, or None
        Derivatives of the load.
    load_rounding : (frames,) ndarray, or None
        Size of the last digit with which a program wrote each load, where that is known.
    unstable : tuple of str, or None
        Loads, in words ("132 kPa"), at which the equilibrium is unstable; None where the solver
        does not examine stability.
    wrinkled : (frames,) ndarray, or None
        Share of the surface that carries no tension in one direction.
    remarks : tuple of Note
    early : str
        Why the analysis ended before the last frame; "" if it did not. A history with fewer frames
        and no reason is not a valid result.
    seconds : float or None
        Time that the analysis took, where the cache of runs has recorded it.
    from_cache : bool
        Whether the history was read from the cache of runs.
    relaxed : bool
        Whether the wall was a tension field, which wrinkles and does not carry compression.
    model, law
        The model and the law of the analysis; `simulate` adds them.
    """

    load: Array
    displacement: Array
    strain_min: Array
    strain_max: Array
    reactions: Mapping[str, Array] = field(default_factory=dict)
    cavity_pressure: Array | None = None
    cavity_volume: Array | None = None
    iterations: int = 0
    path: Array | None = None
    path_slope: Array | None = None
    load_slope: Array | None = None
    load_rounding: Array | None = None
    unstable: tuple[str, ...] | None = None
    wrinkled: Array | None = None
    remarks: tuple[Note, ...] = ()
    early: str = ""
    seconds: float | None = None
    from_cache: bool = False
    relaxed: bool = False
    model: Any = None
    law: HypoelasticLaw | None = None

    def __repr__(self) -> str:
        if not len(self.load):
            return f"History without a frame: {self.early}"
        strains = [
            f"{name} {100 * low:.3g} to {100 * high:.3g} %"
            for name, low, high in zip(
                STRAIN_COLUMNS, self.strain_min, self.strain_max, strict=True
            )
        ]
        return (
            f"History: {len(self.load)} frames, load {self.load.min():.4g} to "
            f"{self.load.max():.4g}\n  {self.displacement.shape[1]} nodes, largest displacement "
            f"{np.nanmax(np.linalg.norm(self.displacement, axis=-1)):.4g} mm\n"
            f"  log strain {', '.join(strains)}{self.early and f'; {self.early}'}"
        )

    @property
    def stable(self) -> bool | None:
        """Return whether every reported equilibrium is stable; None if that was not examined."""
        return None if self.unstable is None else not self.unstable

    @property
    def mesh(self) -> Mesh:
        """Return the undeformed mesh of the model; InputError where the model is not known."""
        if not hasattr(self.model, "mesh"):
            problem = "is not known here, or has no mesh: simulate(...) and fit.history() tell it"
            raise InputError(None, "model", problem)
        return cast(Mesh, self.model.mesh)

    def strain(self, at: Places = "elements") -> Array:
        """Return the log strain (eps1, eps2, gamma12) from the stress-free state of the sheet.

        Its shape is (frames, elements, 3) for `at="elements"`, in the middle of each element, and
        (frames, elements, 4, 3) for `at="points"`, at the Gauss points.
        """
        return np.array([self._strained(u, at) for u in self.displacement])

    def stress(self, at: Places = "elements") -> Array:
        """Return the Cauchy stress in MPa: warp, fill and shear, in axes that turn with the yarns.

        The law is integrated along the path of increments. The shape is that of `strain`.
        """
        mesh = self.mesh
        law = self.law
        if law is None:
            raise InputError(None, "law", "is not known here: simulate(...) and fit.history() do")
        path, reported = self._steps()
        shape = (len(mesh.quads), 3) if at == "elements" else (len(mesh.quads), 4, 3)
        fabric = stress = np.zeros((int(np.prod(shape[:-1])), 3))
        stresses = []
        for u in path:
            strain = self._strained(u, at).reshape(-1, 3)
            if self.relaxed:
                fabric, stress = relaxed_increments(law.compiled, strain, fabric, stress)
            else:
                stress, _, fabric = law.follow(fabric, strain, stress)
            stresses.append(stress.reshape(shape))
        return np.array(stresses)[reported]

    def to_meshio(self, frame: int = -1) -> meshio.Mesh:
        """Return the deformed mesh of a frame with displacement, strain and stress for meshio.

        Parameters
        ----------
        frame : int
            Index of the frame; negative indices count from the last one.
        """
        cells = {STRAIN_DATA: self.strain()[frame], STRESS_DATA: self.stress()[frame]}
        return meshio_of(self.mesh, self.displacement[frame], {}, cells)

    def frame(self, number: int) -> HistoryFrame:
        """Return one frame; negative numbers count from the last one."""
        return HistoryFrame(self, range(len(self.load))[number])

    def _strained(self, u: Array, at: Places) -> Array:
        """Return the log strain for one displacement field u (nodes, 3) mm; see `strain`."""
        mesh = self.mesh
        stress_free = np.asarray(getattr(self.model, "stress_free", mesh.points), dtype=float)
        warp = getattr(self.model, "warp", mesh.warp)
        stretch = getattr(self.model, "stretch", None)
        if at not in ("elements", "points"):
            raise InputError(None, "at", f"expected 'elements' or 'points', got {at!r}")
        sheet = replace(mesh, points=stress_free)
        displacement = mesh.points + u - stress_free
        if at == "elements":
            middle = None if stretch is None else stretch.mean(axis=1)
            return surface_strain(sheet, displacement, warp, middle)
        return log_strain(sheet, [displacement], X if warp is None else warp, stretch)[0]

    def _steps(self) -> tuple[Array, list[int]]:
        """Return the displacements of all increments, and the index of each frame among them."""
        places: list[int] = []
        for place, u in enumerate(() if self.path is None else self.path):
            if len(places) < len(self.load) and np.array_equal(u, self.displacement[len(places)]):
                places.append(place)
        if self.path is None or len(places) < len(self.load):
            return self.displacement, list(range(len(self.load)))
        return self.path, places


@dataclass(frozen=True, eq=False)
class HistoryFrame:
    """One frame of a history, as tables for drawings.

    Attributes
    ----------
    history : History
    number : int
        Of the frame, from 0.
    """

    history: History
    number: int

    @property
    def load(self) -> float:
        """Return the load of the frame, as `History.load`."""
        return float(self.history.load[self.number])

    def to_dataframe(self, at: Literal["nodes", "elements"] = "nodes") -> pd.DataFrame:
        """Return a table of the frame.

        Parameters
        ----------
        at : {"nodes", "elements"}

        Returns
        -------
        DataFrame
            One row for each node, or for the middle of each element:

            - x, y, z : position without load, mm.
            - dx, dy, dz : displacement, mm.
            - eps1, eps2, gamma12 : log strain; of elements only.
            - sigma1, sigma2, tau12 : Cauchy stress, MPa; of elements only, and if the law is known.
        """
        check_one_of(at, ("nodes", "elements"), "at")
        mesh = self.history.mesh
        columns = np.hstack([mesh.points, self.history.displacement[self.number]])
        if at == "nodes":
            return pd.DataFrame(columns, columns=list(POSITION_COLUMNS))
        table = pd.DataFrame(
            columns[np.asarray(mesh.quads)].mean(axis=1), columns=list(POSITION_COLUMNS)
        )
        table[list(STRAIN_COLUMNS)] = self.history.strain()[self.number]
        if self.history.law is not None:
            table[list(STRESS_COLUMNS)] = self.history.stress()[self.number]
        return table


@dataclass(frozen=True)
class BandEnd:
    """One end of a band: an assumption on the wall that bounds what a solver predicts.

    Attributes
    ----------
    name, meaning : str
        A short name, and the assumption in words.
    options : mapping
        Options with which the solver makes this assumption.
    predicted : bool
        Whether the results of this end are the prediction; the other end is only a bound.
    """

    name: str
    meaning: str
    options: Mapping[str, Any]
    predicted: bool = True


@dataclass(frozen=True)
class SolverCheck:
    """Result of `Solver.check`: whether the solver is installed and can apply the law.

    Attributes
    ----------
    version : str
        "" where it is not known.
    advice : str
        What to do where the solver cannot be used.
    """

    name: str
    available: bool
    version: str
    carries_law: bool
    advice: str = ""


@dataclass(frozen=True, kw_only=True)
class Diagnosis:
    """One installation of a solver on this machine, and how it computes the bars of `bars.BARS`.

    Attributes
    ----------
    name, version : str
    path : Path or None
        The program; None for the embedded solver, or if none was found.
    origin : str
        How the program was found: named by the user, by an environment variable, on the PATH, ...
    expected : bool
        Whether the user chose this installation, so that a failure has to be reported.
    external_materials : bool or None
        Whether the program loads material libraries; None if that is unknown.
    usable : bool
        Whether bubblefit can run analyses with it.
    stresses : tuple of float, or None
        Stresses (MPa) at the ends of the bars; None where they were not run.
    difference : float or None
        Largest relative difference of the stresses from the published ones.
    advice : str
        What the user can do about a failure, or what was not tried.
    remark : str
        Anything else to be reported.
    """

    name: str
    version: str = ""
    path: Path | None = None
    origin: str
    expected: bool
    external_materials: bool | None = None
    usable: bool = False
    stresses: tuple[float, ...] | None = None
    difference: float | None = None
    advice: str = ""
    remark: str = ""


class Progress(Protocol):
    """Progress of a running analysis, as a solver passes it to its callback `progress`."""

    @property
    def time(self) -> float:
        """Return the number of increments that are done; it may have a fractional part."""


@runtime_checkable
class Solver(Protocol):
    """A solver: it runs an analysis of a model with a law and returns its history.

    Attributes
    ----------
    name : str
        Name by which `registry` and a project select it.
    external : bool
        Whether it runs a program in a process of its own; such a solver is checked before use.
    progress : callable or None
        Called with the `Progress` after every increment.
    """

    name: str
    external: bool
    progress: Callable[[Any], None] | None

    @property
    def identity(self) -> str:
        """Return a text that identifies all that results depend on besides model and law.

        It holds the version and settings, and digests of files: of their content, not their names.
        """
        ...

    def run(
        self,
        model: Any,
        law: HypoelasticLaw,
        scratch: Path | None = None,
        timeout: float | None = None,
    ) -> History:
        """Run an analysis and return its history.

        Parameters
        ----------
        model : object
            A model of `meshes`, of a class that the solver can analyse.
        law : HypoelasticLaw
        scratch : Path, optional
            Folder in which an external program's working folder is made.
        timeout : float, optional
            Time in s after which an external program is ended.

        Raises
        ------
        SolverFailure
            If the analysis fails.
        """
        ...

    def check(self) -> SolverCheck:
        """Check the installation: its version, and whether it can apply the law."""
        ...


@runtime_checkable
class ProgramSolver(Solver, Protocol):
    """A solver that names its program files, so that cached runs of other programs do not count."""

    @property
    def programs(self) -> Sequence[Path]:
        """Return the files of programs and libraries; their content identifies a run.

        SolverFailure if one of them does not exist.
        """
        ...


@runtime_checkable
class BandedSolver(Solver, Protocol):
    """A solver that predicts a band instead of one value for some models; see `BandEnd`."""

    def band(self, model: Any) -> Sequence[BandEnd]:
        """Return the ends of the band, the prediction first; none for a model without a band."""
        ...


@runtime_checkable
class DifferentiatingSolver(Solver, Protocol):
    """A solver that also computes derivatives of displacements, and can start from a guess."""

    def run(
        self,
        model: Any,
        law: HypoelasticLaw,
        scratch: Path | None = None,
        timeout: float | None = None,
        guess: Array | None = None,
    ) -> History:
        """Run an analysis as `Solver.run` does.

        Parameters
        ----------
        guess : (increments, nodes, 3) array or None, mm
            Displacements from which the increments start.
        """
        ...

    def run_with_sensitivity(
        self,
        model: Any,
        law: HypoelasticLaw,
        parameters: Sequence[str] | None = None,
        guess: Array | None = None,
    ) -> tuple[History, Array]:
        """Run an analysis; return its history and the derivatives of its displacements.

        Parameters
        ----------
        parameters : sequence of str or None
            Names out of `parameters_of`; the solver has a default.
        guess : (increments, nodes, 3) array or None, mm
            Displacements from which the increments start.

        Returns
        -------
        History
        (frames, nodes, 3, parameters) array
            Derivatives of the displacements, mm per unit of the parameter.
        """
        ...


def carries_load_ratios(solver: Solver) -> bool:
    """Return whether a solver takes laws whose moduli depend on the ratio of the loads.

    A solver says so by its attribute `load_ratios`.
    """
    return bool(getattr(solver, "load_ratios", False))


def check_carries(solver: Solver, law: HypoelasticLaw) -> None:
    """Raise InputError for a law that the solver cannot apply.

    Only some solvers apply a law whose moduli depend on the ratio of the loads (attribute
    `load_ratios`), and only some one with a memory (attribute `remembers`).
    """
    if law.of_load_ratio and not carries_load_ratios(solver):
        problem = (
            f"a {law.form.name} law is for the solvers membrane and calculix: its stiffness "
            f"depends on the ratio of the loads, and {solver.name} takes moduli of strain"
        )
        raise InputError(None, "form", problem)
    if law.memory is not None and not getattr(solver, "remembers", False):
        losses = f"with {solver.name} unloading, permanent set and hysteresis are lost"
        problem = (
            f"a law with a memory is for the solver membrane; {losses}: use the card without it"
        )
        raise InputError(None, "memory", problem)


def analysis_of(analyses: Mapping[type, T], model: object, solver: str) -> T:
    """Return the analysis for a model's class or its nearest base class.

    Parameters
    ----------
    analyses : mapping of type to object
        Entries by the class of a model.
    model : object
    solver : str
        Name of the solver, for the message.

    Raises
    ------
    SolverFailure
        No entry fits.
    """
    for kind in type(model).__mro__:
        if kind in analyses:
            return analyses[kind]
    model_names = ", ".join(kind.__name__ for kind in analyses)
    raise SolverFailure(f"cannot run a {type(model).__name__}, only: {model_names}", solver)


# Announcements, from here to `pass_on`, are messages to the user during a run. By default they are
# logged as warnings; a worker process has a listener that sends them to the process that started it
# (see runs/), and the command line has one that prints them.


@dataclass(frozen=True)
class Announcement:
    """A message to the user during a run: a single event, or the beginning or end of a state.

    Attributes
    ----------
    words : str
        The message in one line; "" announces that the state `of` has ended.
    of : str
        Key of a state that lasts, such as waiting for a licence; "" for a single event. It lasts
        until an announcement with the same key and no words.
    """

    words: str
    of: str = ""


Listener = Callable[[Announcement], None]


def _log(announcement: Announcement) -> None:
    if announcement.words:
        log.warning("%s", announcement.words)


_listener: ContextVar[Listener] = ContextVar("listener", default=_log)


def hearing(listener: Listener) -> AbstractContextManager[None]:
    """Pass all announcements that are made within a `with` block to `listener`."""
    return temporary_value(_listener, listener)


def announce(words: str, of: str = "") -> None:
    """Announce a message to the current listener; see `Announcement` for the arguments."""
    pass_on(Announcement(words, of))


def pass_on(announcement: Announcement) -> None:
    """Send an existing announcement, for instance of another process, to the current listener."""
    _listener.get()(announcement)


def log_strain(
    mesh: Mesh,
    displacements: Iterable[Array],
    warp: Array | None = None,
    stretch: Array | None = None,
) -> Array:
    """Return the log strain (eps1, eps2, gamma12) at the Gauss points, (frames, quads, 4, 3).

    Parameters
    ----------
    mesh : Mesh
        The stress-free surface.
    displacements : iterable of (nodes, 3) array, mm
        One for each frame.
    warp : (3,) or (quads, 3) array, optional
        Direction of the warp; that of the mesh unless given.
    stretch : (quads, 4, 2, 2) array, optional
        See `reference_elements`.
    """
    points = np.asarray(mesh.points, float)
    quads = np.asarray(mesh.quads)
    warp = mesh.warp if warp is None else warp
    yarn = None if warp is None else np.broadcast_to(warp, (len(quads), 3))
    slopes = reference_elements(points, quads, yarn, stretch).slopes
    frames = []
    for displacement in displacements:
        gradient = np.einsum("mpin,mnk->mpki", slopes, (points + displacement)[quads])
        frames.append(log_strain_of(gradient))
    return np.array(frames)


def extremes(strain: Array) -> tuple[Array, Array]:
    """Return the minimum and maximum (k,) of each component of `strain` (..., k).

    The strain at the start, zero, is included.
    """
    flat = strain.reshape(-1, strain.shape[-1])
    return np.minimum(flat.min(axis=0), 0.0), np.maximum(flat.max(axis=0), 0.0)
