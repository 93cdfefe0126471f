"""Presenters of kinds of test, as runs use them: found by the class of the kind."""

from __future__ import annotations

from typing import Any, Protocol, cast

from ..lazy_modules import pandas as pd
from ..presenting import KINDS
from .fitted import Findings, FittedTest
from .forward import Cards, Runs, Simulation
from .output import Output
from .registry import kind_named


class Presenter(Protocol):
    """Says what results mean for tests of one kind; `reports` shows them with more members."""

    def findings(self, prepared: Any, fitted: FittedTest) -> Findings:
        """Return the meaning of a fit for a test.

        Parameters
        ----------
        prepared : PreparedTest
            The test with its data.
        fitted : FittedTest
            What the fit made of it.
        """

    def residuals(self, prepared: Any, fitted: FittedTest) -> pd.DataFrame:
        """Return a row a matched value.

        Returns
        -------
        DataFrame
            Columns: part, columns that say where the value is, then quantity, measured, modelled,
            difference and unit.
        """

    def simulate(
        self, test: Any, cards: Cards, runs: Runs, out: Output, within_range: bool = False
    ) -> Simulation:
        """Write files and figures of forward analyses and return their numbers.

        Parameters
        ----------
        test : Test
            The test that was run.
        cards : mapping of str to MaterialCard
            By name.
        runs : mapping of (str, str) to CardRun
            By names of card and part of the test.
        out : Output
            Place of the files.
        within_range : bool
            Show curves only up to the end of a card's valid range.
        """


def presenter_of(name: str) -> Presenter:
    """Return the presenter of the kind of this name: its own `report`, else the registered one.

    Raises
    ------
    InputError
        There is no kind of this name.
    PlugInFailure
        The kind is one of a plug-in that does not work.
    """
    kind = kind_named(name)
    return cast(Presenter, KINDS.of(kind) if kind.report is None else kind.report)
