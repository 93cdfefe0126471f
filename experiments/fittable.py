"""Tests that can be fitted: prepared once, compared with a model, and told of when the fit ends."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np
from numpy.typing import NDArray

from ..notes import Note
from .base import MakeSolver, Reach, Test
from .exhibit import Exhibit, Output

if TYPE_CHECKING:
    import pandas as pd

    from ..identification.assessment import Certainty
    from ..identification.comparison import Comparison
    from ..materials.law import HypoelasticLaw
    from ..solvers.base import History

Array = NDArray[np.float64]
#: Which of the measured points a fit matches, by name of the comparison.
Masks = Mapping[str, NDArray[np.bool_]]


@dataclass(frozen=True)
class Weighting:
    """How much a test counts.

    relative : the blocks of a test add up to `weight` times its mean relative RMS error, so that a
    test of many blocks does not outvote one of few; otherwise they are as its own objective has
    them.
    """

    relative: bool = False
    weight: float = 1.0


class FittableTest(Test, Protocol):
    """A test whose measurement a fit can match."""

    def prepare(self, law: HypoelasticLaw, make_solver: MakeSolver) -> PreparedTest:
        """Read the data, or compute them with the law where the section has a known solution.

        law : all but the coefficients.

        Raises
        ------
        InputError : in the data. SolverFailure : the known solution cannot be run.
        """


class PreparedTest(Protocol):
    """A test with its data, in memory: what worker processes are given.

    One whose data are measured files also offers them for the record of a run
    (`data_files.OfFiles`), as a test that is predicted does.

    A kind that looks at its data before a fit also has `doubts(expected)`, what makes them doubtful
    (`doubts.Doubt`), and `examine(out)`, what was seen, as an `Exhibit`; the kind itself then lists
    the names of its doubts, `Kind.doubts`.
    """

    @property
    def test(self) -> FittableTest:
        """The test."""

    @property
    def objective_is(self) -> str:
        """What its own objective is, in words."""

    @property
    def known(self) -> HypoelasticLaw | None:
        """The law behind computed data."""

    @property
    def specimens(self) -> Mapping[str, Sequence[int]]:
        """Number of the specimen of each point that can be left out of a fit.

        By name of the comparison; empty where nothing can be left out.
        """

    def reach(self, masks: Masks) -> Reach:
        """What the points matched say of the law; as the test's own where nothing is left out."""

    def comparisons(
        self, make_solver: MakeSolver, weighting: Weighting, masks: Masks | None = None
    ) -> tuple[Comparison, ...]:
        """What a fit compares: models, solvers, objectives, nuisance unknowns.

        Each is named as the test, followed by its part where there are several: "strips: warp".
        """

    def findings(self, fitted: FittedTest) -> Findings:
        """What the best fit means for this test."""

    def show(self, fitted: FittedTest, findings: Findings, out: Output) -> Exhibit:
        """Write the test's own figures, tables and files."""

    def residuals(self, fitted: FittedTest) -> pd.DataFrame:
        """Every matched value: part, where, quantity, measured, modelled, difference, unit."""


@dataclass(frozen=True, eq=False)
class FittedTest:
    """One test in the light of a finished fit.

    comparisons, histories : its own, in its own order, as `Weighting()` gives them. nuisance : by
    plain name, in the unit of each. law : the best; laws : of the best starts, best first.
    reached : (3,) largest strain (eps1, eps2, gamma12) in all tests. valid : (3,) the ends up to
    which the moduli are fitted.
    """

    comparisons: tuple[Comparison, ...]
    histories: tuple[History, ...]
    nuisance: Mapping[str, float]
    law: HypoelasticLaw
    laws: Sequence[HypoelasticLaw]
    reached: Array
    valid: Array
    certainty: Certainty | None


@dataclass(frozen=True, eq=False)
class Findings:
    """What a fit means for one test.

    numbers : for result.json. warnings : what a reader should know. lines : for the terminal.
    quality : in a few words, for the card. summary : a clause for the head of the page.
    """

    numbers: dict[str, Any]
    warnings: tuple[Note, ...] = ()
    lines: tuple[str, ...] = ()
    quality: str = ""
    summary: str = ""
