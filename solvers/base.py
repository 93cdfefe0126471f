"""The solver protocol, the results of an analysis, and what every adapter needs to produce them."""

from __future__ import annotations

import logging
from collections.abc import Callable, Iterable, Mapping, Sequence
from contextlib import AbstractContextManager
from contextvars import ContextVar
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal, Protocol, TypeVar, cast, runtime_checkable

import numpy as np

from ..errors import InputError, SolverFailure
from ..materials.law import HypoelasticLaw
from ..materials.memory import NAMES
from ..materials.wrinkles import relaxed_increments
from ..meshes.mesh import Array, Mesh, meshio_of
from ..meshes.strain import X, log_strain_of, surface_strain
from ..notes import Note, NoteKind
from ..processes import temporary_value
from .membrane.kernel import reference_elements

if TYPE_CHECKING:
    import meshio

EARLY = NoteKind("stopped early", mark=4)
SNAP = NoteKind("snap", mark=2)

log = logging.getLogger(__name__)

T = TypeVar("T")
#: Loads that are named one by one; of more, the first and the last.
MAX_LISTED = 3
#: Places of strain and stress: the middle of each element, or its Gauss points.
Places = Literal["elements", "points"]
#: Names of strain and stress in files for ParaView.
STRAIN_DATA = "log_strain_1_2_12"
STRESS_DATA = "stress_1_2_12_MPa"


def parameters_of(law: HypoelasticLaw, model: Any = None) -> tuple[str, ...]:
    """Return the parameters of derivatives: entries of beta, nu12, and the model's `parameters`."""
    of_model = getattr(model, "parameters", ())
    remembered = () if law.memory is None else NAMES
    return (*(f"beta_{i}" for i in range(law.form.size)), "nu12", *remembered, *of_model)


def instability(unstable: Sequence[str] | None) -> str:
    """Return a warning that equilibria at these loads (in words) are unstable, "" without any."""
    if not unstable:
        return ""
    places = ", ".join(unstable)
    if len(unstable) > MAX_LISTED:
        places = f"{len(unstable)} of the reported loads, from {unstable[0]} to {unstable[-1]}"
    return f"unstable equilibrium at {places}"


@dataclass(frozen=True, eq=False)
class History:
    """Results of an analysis that ended well, frame by frame.

    load (frames,) pressure in MPa, or force on a whole strip in N; load_slope (frames, parameters)
    its derivatives; displacement (frames, nodes, 3) mm; reactions by named set (frames, 3) N;
    strain_min, strain_max (3,) of (eps1, eps2, gamma12); cavity pressure (MPa) and volume (mm^3),
    (frames,); path: displacement at every increment and its derivatives path_slope (...,
    parameters), a start for the next run; unstable: loads with an unstable equilibrium, in words
    ("132 kPa"), None where nobody looked; wrinkled: share of the surface without stress in one
    direction (frames,), or None; iterations: the solver's count; early: the reason for an end
    before the last frame: fewer frames without it are no result; seconds, from_cache: of a cache;
    relaxed: wrinkled as a tension field; model, law: what was run, as `simulate` adds.
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
    unstable: tuple[str, ...] | None = None
    wrinkled: Array | None = None
    remarks: tuple[Note, ...] = ()
    early: str = ""
    seconds: float | None = None
    from_cache: bool = False
    relaxed: bool = False
    model: Any = None
    law: HypoelasticLaw | None = None

    @property
    def stable(self) -> bool | None:
        """Return whether every reported equilibrium is stable; None where nobody looked."""
        return None if self.unstable is None else not self.unstable

    @property
    def mesh(self) -> Mesh:
        """Return the mesh of the model, at rest; InputError where the model is not known."""
        if not hasattr(self.model, "mesh"):
            problem = "is not known here, or has no mesh: simulate(...) and fit.history() tell it"
            raise InputError(None, "model", problem)
        return cast(Mesh, self.model.mesh)

    def strain(self, at: Places = "elements") -> Array:
        """Return log strain (eps1, eps2, gamma12) since the sheet was without stress.

        (frames, elements, 3) in the middles, or (frames, elements, 4, 3) at the Gauss points.
        """
        return np.array([self._strained(u, at) for u in self.displacement])

    def stress(self, at: Places = "elements") -> Array:
        """Return Cauchy stress (MPa) along turned warp and fill, and shear, shaped as `strain`."""
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
        """Return the deformed mesh of a frame, with displacement, strain and stress as its data."""
        cells = {STRAIN_DATA: self.strain()[frame], STRESS_DATA: self.stress()[frame]}
        return meshio_of(self.mesh, self.displacement[frame], {}, cells)

    def _strained(self, u: Array, at: Places) -> Array:
        """Return the strain of one displacement (nodes, 3)."""
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
        """Return displacements from increment to increment, and the place of each frame there."""
        places: list[int] = []
        for place, u in enumerate(() if self.path is None else self.path):
            if len(places) < len(self.load) and np.array_equal(u, self.displacement[len(places)]):
                places.append(place)
        if self.path is None or len(places) < len(self.load):
            return self.displacement, list(range(len(self.load)))
        return self.path, places


@dataclass(frozen=True)
class BandEnd:
    """A wall of the band of answers: its name, what it does, the options that take it."""

    name: str
    meaning: str
    options: Mapping[str, Any]
    predicted: bool = True


@dataclass(frozen=True)
class SolverCheck:
    """Result of `Solver.check`: whether it is installed and carries the law."""

    name: str
    available: bool
    version: str
    carries_law: bool
    advice: str = ""


@dataclass(frozen=True)
class Diagnosis:
    """One solver on this machine, with the result of the published bars.

    external_materials: whether it loads material libraries (None: unknown). stresses, difference:
    of `bars.BARS` (MPa), and the largest relative one from Marc's; None where they did not run.
    expected: somebody chose it. advice: what to do, or what was not tried.
    """

    name: str
    version: str
    path: Path | None
    origin: str
    expected: bool
    external_materials: bool | None
    usable: bool
    stresses: tuple[float, ...] | None = None
    difference: float | None = None
    advice: str = ""
    remark: str = ""


class Progress(Protocol):
    """Progress of a run."""

    @property
    def time(self) -> float:
        """Return how many increments of the model are done, parts of one included."""


@runtime_checkable
class Solver(Protocol):
    """A way to run a model, `name` in `registry`; progress : called with every increment done.

    external : runs in a process of its own, and is checked before anything is run with it.
    """

    name: str
    external: bool
    progress: Callable[[Any], None] | None

    @property
    def identity(self) -> str:
        """Return what results depend on beside model and law; files count by content."""
        ...

    def run(
        self,
        model: Any,
        law: HypoelasticLaw,
        scratch: Path | None = None,
        timeout: float | None = None,
    ) -> History:
        """Run the model; SolverFailure when it does not end well."""
        ...

    def check(self) -> SolverCheck:
        """Check the installation: version, and whether it carries the law."""
        ...


@runtime_checkable
class ProgramSolver(Solver, Protocol):
    """A solver that names the files which run: a run of another program is another run."""

    @property
    def programs(self) -> Sequence[Path]:
        """Return programs and libraries, which count by content; SolverFailure if one is absent."""
        ...


@runtime_checkable
class BandedSolver(Solver, Protocol):
    """A solver that answers some models by a band."""

    def band(self, model: Any) -> Sequence[BandEnd]:
        """Return the ends, the prediction first; none where the model has one answer."""
        ...


@runtime_checkable
class DifferentiatingSolver(Solver, Protocol):
    """A solver that also differentiates its displacements, and takes a start for its path."""

    def run(
        self,
        model: Any,
        law: HypoelasticLaw,
        scratch: Path | None = None,
        timeout: float | None = None,
        guess: Array | None = None,
    ) -> History:
        """Run from `guess` where given."""
        ...

    def run_with_sensitivity(
        self,
        model: Any,
        law: HypoelasticLaw,
        parameters: Sequence[str] | None = None,
        guess: Array | None = None,
    ) -> tuple[History, Array]:
        """Run; return d displacement / d parameters too, (frames, nodes, 3, parameters)."""
        ...


def carries_load_ratios(solver: Solver) -> bool:
    """Return whether a solver takes laws of the load ratio: its attribute `load_ratios`."""
    return bool(getattr(solver, "load_ratios", False))


def check_carries(solver: Solver, law: HypoelasticLaw) -> None:
    """Raise InputError for a law of the load ratio where the solver takes moduli of strain."""
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
    """Return the entry for a model's class or its nearest base; SolverFailure without one."""
    for kind in type(model).__mro__:
        if kind in analyses:
            return analyses[kind]
    model_names = ", ".join(kind.__name__ for kind in analyses)
    raise SolverFailure(f"cannot run a {type(model).__name__}, only: {model_names}", solver)


# Announcements: messages while something runs. Without a listener they are logged as warnings; a
# process that works for another has a listener that passes them on.


@dataclass(frozen=True)
class Announcement:
    """One line, or a state `of` something that lasts until an announcement of it without words."""

    words: str
    of: str = ""


Listener = Callable[[Announcement], None]


def _log(announcement: Announcement) -> None:
    if announcement.words:
        log.warning("%s", announcement.words)


_listener: ContextVar[Listener] = ContextVar("listener", default=_log)


def hearing(listener: Listener) -> AbstractContextManager[None]:
    """Pass everything that is announced within the block to `listener`."""
    return temporary_value(_listener, listener)


def announce(words: str, of: str = "") -> None:
    """Send an announcement to the listener."""
    pass_on(Announcement(words, of))


def pass_on(announcement: Announcement) -> None:
    """Send the announcement of another process to the listener."""
    _listener.get()(announcement)


def log_strain(
    mesh: Mesh,
    displacements: Iterable[Array],
    warp: Array | None = None,
    stretch: Array | None = None,
) -> Array:
    """Return (frames, quads, 4, 3) log strain at Gauss points; warp : (3,), else the mesh's;
    stretch : as of `reference_elements`."""
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
    """Return minimum and maximum of each of the last axis' components, the start included."""
    flat = strain.reshape(-1, strain.shape[-1])
    return np.minimum(flat.min(axis=0), 0.0), np.maximum(flat.max(axis=0), 0.0)
