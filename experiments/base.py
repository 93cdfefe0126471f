"""What a kind of test is to the rest of the house.

A project names tests; each is of a kind. A kind reads its section of the project into a `Test`,
which makes models. Tests of a kind that can be fitted are prepared once (data read, or computed)
and then give comparisons to a fit, in every process that runs starts; what a fit means for a test
is told by the test itself. Nothing outside a folder of this package asks which kind a test is.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal, Protocol

import numpy as np
from numpy.typing import NDArray

from ..errors import InputError, SolverFailure
from ..sections import ModulusUnit
from .exhibit import Output, Shown

if TYPE_CHECKING:  # a module of types: whoever reads a project need not wait for figures
    from pydantic import BaseModel

    from ..materials.card import MaterialCard
    from ..materials.law import ThicknessChange
    from ..solvers.base import History, Solver
    from .predicted import Predicted

Array = NDArray[np.float64]
#: Makes a solver of its own for a model, so that what it prepares for the model is not shared:
#: the project's, or another by its name, with the settings that the project has for it.
MakeSolver = Callable[..., "Solver"]
Refined = Literal["elements", "increments"]


@dataclass(frozen=True)
class Fabric:
    """The one fabric that all tests of a project are of; thickness in mm before the test."""

    name: str
    thickness: float
    thickness_change: ThicknessChange = "constant"


@dataclass(frozen=True)
class Scales:
    """Units of a project file by name, and what they are: MPa, MPa and mm per unit."""

    modulus: float = 1000.0
    pressure: float = 1e-3
    length: float = 1.0
    modulus_unit: ModulusUnit = "GPa"
    pressure_unit: str = "kPa"
    length_unit: str = "mm"


@dataclass(frozen=True)
class Place:
    """Where a test stands: in which file, under which key, in which units, beside which data.

    at : dotted key of its section, "bubble[0]". data_folder : instead of the folder that the
    section names. need_data : whether measured files must be there (a forward analysis does
    without).
    """

    path: Path
    at: str
    fabric: Fabric
    scales: Scales = Scales()
    data_folder: Path | None = None
    need_data: bool = True

    def error(self, field: str, problem: str) -> InputError:
        """An error in the section; `field` is the dotted key below it, "" for itself."""
        return InputError(self.path, f"{self.at}.{field}" if field else self.at, problem)


@dataclass(frozen=True)
class Reach:
    """What the data of a test say of the law, before any fit.

    strain : ends (eps1, eps2, gamma12) of the logarithmic strain that the test can reach, None
    where it does not tell. break_shares : for each of them two shares of its end where the measured
    stiffness changes most, for laws with regions; None where it does not tell.
    """

    strain: tuple[float | None, float | None, float | None] = (None, None, None)
    break_shares: tuple[tuple[float, float] | None, ...] = (None, None, None)


class Test(Protocol):
    """One test as its section says: lengths mm, loads N, pressures and moduli MPa."""

    @property
    def kind(self) -> str:
        """Name of its kind."""

    @property
    def name(self) -> str:
        """Its own name in the project."""

    @property
    def weight(self) -> float:
        """How much it counts among several tests in one fit."""

    @property
    def reach(self) -> Reach:
        """What its data say of the law."""

    @property
    def reads_files(self) -> bool:
        """Whether its data are measured files, which a folder can be named for."""

    def models(
        self, thickness: float | None = None, what: Refined = "elements", factor: float = 1.0
    ) -> Mapping[str, Any]:
        """Models by the name of their part.

        thickness : mm, the fabric's unless given. what, factor : edges of elements, or increments,
        divided by a factor.

        Raises
        ------
        InputError : a mesh or increments that cannot be had.
        """

    def settings(self) -> Mapping[str, object]:
        """What a result depends on beside data, law and solver: for fingerprints; without paths."""


@dataclass(frozen=True, eq=False)
class Studied:
    """How a kind of test is studied with a card: what refinement, or nu12, changes.

    steps : load levels of a model. quantities : of interest in a study of the mesh; responses : of
    a study of nu12, in words `response`. curve : (x, y) along which levels are compared, None where
    there is none.
    """

    steps: Callable[[Any], Sequence[float]]
    quantities: Callable[[Any, History], Mapping[str, float]]
    responses: Callable[[Any, History], Mapping[str, float]]
    response: str
    curve: Callable[[Any, History], tuple[Array, Array]] | None = None


@dataclass(frozen=True, eq=False)
class CardRun:
    """One card on one part of a test: the model that was run, and how it ended."""

    model: Any
    outcome: History | SolverFailure


@dataclass(frozen=True, eq=False)
class Simulation:
    """What forward analyses gave: numbers for result.json, lines for the terminal, figures."""

    numbers: dict[str, Any]
    lines: Sequence[str] = ()
    figures: Sequence[Shown] = ()


class Kind(Protocol):
    """A kind of test, as the registry holds it.

    name : of its tables in a project, [[name]]. title : in a few words, for help and documents.
    section : what such a table may say; `name` is among it, and `weight` where it is fitted.
    fitted : whether its tests are `FittableTest`s. predicted : what tests offer that cards predict,
    None for others. studied : None where no study runs it. A kind that knows tests worth making
    next offers them (`candidates.Plannable`). A kind whose section names the folder of
    measured files has `folder_key`, the dotted key of it, by which a project can be written down
    with the folder that it was run with.
    """

    name: str
    title: str
    section: type[BaseModel]
    fitted: bool
    predicted: Predicted | None
    studied: Studied | None

    def read(self, section: Any, place: Place, name: str) -> Test:
        """The test of a section, in mm, N, MPa.

        Raises
        ------
        InputError : naming the file and the dotted key, or a data file.
        """

    def simulate(
        self,
        test: Any,
        cards: Mapping[str, MaterialCard],
        runs: Mapping[tuple[str, str], CardRun],
        out: Output,
        within_range: bool = False,
    ) -> Simulation:
        """Write and tell what cards do in a test: `runs` by (card, part); files go to `out`."""
