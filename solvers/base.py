"""What every solver takes and gives."""

from __future__ import annotations

import logging
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Protocol, TypeVar, runtime_checkable

import numpy as np
from numpy.typing import NDArray

from ..errors import InputError, SolverFailure
from ..materials.law import HypoelasticLaw
from ..meshes.mesh import Mesh, log_strain_of
from ..notes import Note
from .membrane.kernel import reference_elements

Array = NDArray[np.float64]

#: Loads that are named one by one; of more, the first and the last.
FEW = 3


def parameters_of(law: HypoelasticLaw, model: Any = None) -> tuple[str, ...]:
    """What a differentiating solver may be asked for: entries of beta, nu12, and the model's own.

    A model's own are its `parameters`, which its `with_parameters` changes; not every model has
    any.
    """
    own = getattr(model, "parameters", ())
    return (*(f"beta_{i}" for i in range(law.form.size)), "nu12", *own)


def instability(unstable: Sequence[str] | None) -> str:
    """That equilibria at these loads (in words) are unstable; "" where there are none."""
    if not unstable:
        return ""
    places = ", ".join(unstable)
    if len(unstable) > FEW:
        places = f"{len(unstable)} of the reported loads, from {unstable[0]} to {unstable[-1]}"
    return f"unstable equilibrium at {places}"


@dataclass(frozen=True, eq=False)
class History:
    """What an analysis that ended well reports, frame by frame.

    load (frames,) pressure in MPa, or the force on a whole strip in N, and load_slope (frames,
    parameters) its derivatives where the solver has them; displacement (frames, nodes, 3) mm;
    reactions by named set (frames, 3) N; strain_min, strain_max (3,) extremes of (eps1, eps2,
    gamma12) log strain; cavity pressure (MPa) and volume (mm^3), (frames,), where there is a
    cavity; path: displacement at every increment (increments, nodes, 3) and its derivatives
    path_slope (..., parameters), where the solver keeps them (a start for the next run); unstable:
    at which of the reported loads the equilibrium is, in words ("132 kPa"), empty where all are
    stable, None where the solver did not look; wrinkled: share of the reference surface that
    carries no stress in one direction (frames,), None likewise; iterations: what the solver
    counts as its work; remarks: what a reader of the result should know (plain words are notes of
    the kind "of the solver"); early: the solver's own word for an end before the model's last
    frame (it found no equilibrium further on), "" where there is none: fewer frames without it
    are no result; seconds that the run itself took, where a cache keeps it, None where nobody does;
    from_cache: whether it was made earlier and nothing ran now.
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

    @property
    def stable(self) -> bool | None:
        """Whether every equilibrium that is reported is; None where the solver did not look."""
        return None if self.unstable is None else not self.unstable


@dataclass(frozen=True)
class BandEnd:
    """One of the walls between which a solver's answer to a model lies.

    name : in tables and figures. meaning : what the wall does, for who reads them. options : what
    the solver is made with to take this wall, beside its own. predicted : whether it is what the
    solver predicts, or only the other end of the band.
    """

    name: str
    meaning: str
    options: Mapping[str, Any]
    predicted: bool = True


@dataclass(frozen=True)
class SolverCheck:
    """Whether a solver is there and carries the law: what `check` found."""

    name: str
    available: bool
    version: str
    carries_law: bool
    advice: str = ""


@dataclass(frozen=True)
class Diagnosis:
    """One solver on this machine: what it is, where, and what published bars showed.

    external_materials: whether it can load material libraries (None: embedded, a plug-in, or not
    to be seen). stresses: end stresses of the bars (MPa) in the order of `bars.BARS`, difference:
    the largest relative one from Marc's; None where the bars did not run. expected: somebody chose
    this solver, so that it has to work. advice: one line, what to do or what was not tried.
    remark: what else it says of itself, in a few words.
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
    """How far a run is."""

    @property
    def time(self) -> float:
        """Increments of the model that are done, parts of one included."""


@runtime_checkable
class Solver(Protocol):
    """A way to run a model; picked by name in `registry`.

    name : what a project file or --solver calls it. external : whether it runs in a process of its
    own; then it is checked before anything is run with it.
    """

    name: str
    external: bool
    #: Called with every increment that is done while a run is under way, where it is set.
    progress: Callable[[Any], None] | None

    @property
    def identity(self) -> str:
        """What a result depends on beside model and law: name, version, settings that matter.

        Files (templates, blocks of a site) count by what is in them, not by where they lie. A
        result is taken up again only where this is the same.
        """
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
        """Is it installed, which version, does it carry the law?"""
        ...


@runtime_checkable
class ProgramSolver(Solver, Protocol):
    """A solver that says which files run, so that a run of another program is another run."""

    @property
    def programs(self) -> Sequence[Path]:
        """Programs and libraries; they count by content. SolverFailure where one is not there."""
        ...


@runtime_checkable
class BandedSolver(Solver, Protocol):
    """A solver whose answer to some models is a band."""

    def band(self, model: Any) -> Sequence[BandEnd]:
        """Its ends, first what is predicted; none where the model has one answer."""
        ...


def carries_load_ratios(solver: Solver) -> bool:
    """Whether a solver takes laws whose moduli depend on the ratio of the loads.

    It says so by an attribute `load_ratios` that is true.
    """
    return bool(getattr(solver, "load_ratios", False))


def check_carries(solver: Solver, law: HypoelasticLaw) -> None:
    """Refuse a law whose moduli depend on the load ratio where the solver knows strain alone.

    Raises
    ------
    InputError : it does.
    """
    if law.of_load_ratio and not carries_load_ratios(solver):
        problem = (
            f"a {law.form.name} law is for the solver membrane: its moduli depend on the ratio of "
            f"the loads, and {solver.name} takes moduli of strain"
        )
        raise InputError(None, "form", problem)


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
        """History and d displacement / d parameters, (frames, nodes, 3, len(parameters)).

        The parameters are every entry of the law's beta unless given; those of `parameters_of`.
        """
        ...


T = TypeVar("T")


def analysis_of(analyses: Mapping[type, T], model: object, solver: str) -> T:
    """The entry for a model's class, or for the nearest class that it is made from.

    Raises
    ------
    SolverFailure : there is none; says what the solver runs.
    """
    for kind in type(model).__mro__:
        if kind in analyses:
            return analyses[kind]
    known = ", ".join(kind.__name__ for kind in analyses)
    raise SolverFailure(f"cannot run a {type(model).__name__}, only: {known}", solver)


# What is said while something runs, to whoever hears it: that a run waits, that a worker is gone.
#
# Where nobody listens it goes to the log, as a warning. A process that works for another has a
# listener that passes it on.

log = logging.getLogger(__name__)


@dataclass(frozen=True)
class Announcement:
    """One line, or a state that begins or is over.

    words : the line. of : who is in this state, until one comes with no words; "" : it is said
    once, and is no state.
    """

    words: str
    of: str = ""


Listener = Callable[[Announcement], None]


def _log(said: Announcement) -> None:
    if said.words:
        log.warning("%s", said.words)


_listener: ContextVar[Listener] = ContextVar("listener", default=_log)


@contextmanager
def hearing(listener: Listener) -> Iterator[None]:
    """Whatever is announced within goes to `listener`."""
    before = _listener.set(listener)
    try:
        yield
    finally:
        _listener.reset(before)


def announce(words: str, of: str = "") -> None:
    """Say it to whoever listens."""
    _listener.get()(Announcement(words, of))


def pass_on(said: Announcement) -> None:
    """Say what another process has announced."""
    _listener.get()(said)


def cell_blocks(
    path: Path,
    numbers: NDArray[np.int64],
    elements: Iterable[tuple[int, NDArray[np.int64]]],
    names: Mapping[int, tuple[str, tuple[int, ...] | None]],
) -> list[tuple[str, NDArray[Any]]]:
    """Runs of elements of one type, their nodes counted from 0.

    Parameters
    ----------
    numbers : (n,) of the nodes in the file, increasing.
    names : by the file's type: meshio's name, and its order of the nodes where it differs.

    Raises
    ------
    InputError : a type that `names` does not have, a node that is not there.
    """
    cells: list[tuple[str, list[Any]]] = []
    for kind, nodes in elements:
        if kind not in names:
            raise InputError(path, "elements", f"of type {kind} are not known here")
        name, order = names[kind]
        place = np.searchsorted(numbers, nodes)
        place = np.minimum(place, len(numbers) - 1)
        if (numbers[place] != nodes).any():
            raise InputError(path, "elements", "refer to a node that is not there")
        if not cells or cells[-1][0] != name:
            cells.append((name, []))
        cells[-1][1].append(place if order is None else place[list(order)])
    return [(name, np.array(rows)) for name, rows in cells]


def log_strain(mesh: Mesh, displacements: Array, warp: Array | None = None) -> Array:
    """(frames, quads, 4, 3) log strain (eps1, eps2, gamma12) at the quads' Gauss points.

    displacements : (frames, nodes, 3) mm. warp : (3,) direction of the warp; x unless given.
    """
    points, quads = np.asarray(mesh.points, float), np.asarray(mesh.quads)
    yarn = None if warp is None else np.broadcast_to(warp, (len(quads), 3))
    slopes = reference_elements(points, quads, yarn).slopes
    frames = []
    for displacement in displacements:
        gradient = np.einsum("mpin,mnk->mpki", slopes, (points + displacement)[quads])
        frames.append(log_strain_of(gradient))
    return np.array(frames)


def extremes(strain: Array) -> tuple[Array, Array]:
    """Least and largest of each of the last axis' components, the unstrained start included."""
    flat = strain.reshape(-1, strain.shape[-1])
    return np.minimum(flat.min(axis=0), 0.0), np.maximum(flat.max(axis=0), 0.0)
