"""What every solver takes and gives."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Protocol, runtime_checkable

import numpy as np
from numpy.typing import NDArray

from ..errors import InputError
from ..materials.law import HypoelasticLaw
from ..notes import Note

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
