"""The protocol of presenters, which turn results into words, tables and figures for one kind.

A presenter belongs to a kind of test and is looked up by the class of the kind.
"""

from __future__ import annotations

from typing import Any, Protocol, cast

from ..lazy_modules import pandas as pd
from ..presenting import KINDS
from .data_files import Output
from .fitted import Findings, FittedTest
from .forward import Cards, Runs, Simulation
from .registry import kind_named


class Presenter(Protocol):
    """Describe what runs need of a kind's presenter; `reports` needs further members."""

    def findings(self, prepared: Any, fitted: FittedTest) -> Findings:
        """Return what a finished fit means for a test: numbers, warnings and words.

        Parameters
        ----------
        prepared : PreparedTest
            The test with its data.
        fitted : FittedTest
            What the fit made of it.
        """

    def residuals(self, prepared: Any, fitted: FittedTest) -> pd.DataFrame:
        """Return the table of residuals, with a row for each matched value.

        Returns
        -------
        DataFrame
            Columns: part, columns that say where the value is, then quantity, measured, modelled,
            difference and unit.
        """

    def simulate(
        self,
        test: Any,
        cards: Cards,
        runs: Runs,
        out: Output,
        within_range: bool = False,
    ) -> Simulation:
        """Write files and figures of a test's forward analyses, and return their results.

        Parameters
        ----------
        test : Test
            The test that was run.
        cards : mapping of str to MaterialCard
            The cards by name.
        runs : mapping of (str, str) to CardRun
            The analyses by (name of the card, name of the part of the test).
        out : Output
            Where files are written.
        within_range : bool
            Whether curves are shown only up to the end of a card's valid range of strain.
        """


def presenter_of(name: str) -> Presenter:
    """Return the presenter of a kind of test: its own `report`, else the one of its class.

    Raises
    ------
    InputError
        There is no kind of this name.
    PlugInFailure
        The kind is one of a plug-in that does not work.
    """
    kind = kind_named(name)
    return cast(Presenter, KINDS.of(kind) if kind.report is None else kind.report)
