"""Base class of presenters, which show the results of one kind of test on pages and in notebooks.

Each module of `reports.kinds` registers the presenter of one kind; a plug-in may bring its own.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from types import MappingProxyType
from typing import Any

from ..experiments.base import Findings, FittedTest, PreparedTest, Presenter
from ..experiments.data_files import Output
from ..experiments.forward import Cards, Runs, Simulation
from ..experiments.registry import presenter_of
from ..lazy_modules import pandas as pd
from .charts import Chart, Charts, dots, line
from .content import Exhibit

#: Function of a prepared test and its part of a fit that returns charts of both.
FittedChart = Callable[[Any, FittedTest], Charts]


class PagePresenter:
    """Base class of the presenters of kinds of test.

    A kind whose tests are fitted has to define `findings` and `residuals`, a kind whose tests are
    only predicted `show_outcome`, and every kind that is run with given cards `simulate`; the
    other methods have defaults. The arguments are those of the kind: `prepared` is its prepared
    test, `fitted` the best fit as it concerns this test (`FittedTest`), `out` the place where
    files are written (`Output`).
    """

    #: Functions that draw charts of a fitted test in notebooks, by the charts' name.
    charts: Mapping[str, FittedChart] = MappingProxyType({})

    def findings(self, prepared: Any, fitted: FittedTest) -> Findings:
        """Return what a fit means for a test: numbers, warnings and words."""
        raise NotImplementedError(f"{type(self).__name__} needs findings(prepared, fitted)")

    def residuals(self, prepared: Any, fitted: FittedTest) -> pd.DataFrame:
        """Return a table with a row for each matched value, measured beside modelled."""
        raise NotImplementedError(f"{type(self).__name__} needs residuals(prepared, fitted)")

    def simulate(
        self, test: Any, cards: Cards, runs: Runs, out: Output, within_range: bool = False
    ) -> Simulation:
        """Write files and figures of forward analyses with given cards; return their numbers.

        Parameters
        ----------
        test : test of the kind
            The test that was run.
        cards : mapping of str to MaterialCard
            Cards by name.
        runs : mapping of (str, str) to CardRun
            Results by name of the card and part of the test.
        out : Output
            Place of the files.
        within_range : bool
            Whether curves are shown only up to the end of a card's valid range of strain.
        """
        raise NotImplementedError(f"{type(self).__name__} needs simulate(test, cards, runs, out)")

    def show(self, prepared: Any, fitted: FittedTest, findings: Findings, out: Output) -> Exhibit:
        """Write a test's files of a fit, and return what the page shows of it.

        The default shows the misfit and a chart of every matched value.
        """
        charts = value_charts(prepared, self.residuals(prepared, fitted), out)
        return Exhibit(facts=[("misfit", findings.summary)], parts=[charts])

    def examine(self, prepared: Any, out: Output) -> Exhibit | None:
        """Write files about the data before a fit, and return what the page shows of them.

        None, the default, where nothing is shown.
        """
        return None

    def show_outcome(self, outcome: Any, out: Output) -> Exhibit:
        """Write the files of predicted tests, and return what the page shows of them.

        Parameters
        ----------
        outcome : object
            Results of all predicted tests of the kind.
        out : Output
            Place of the files.
        """
        raise NotImplementedError(f"{type(self).__name__} needs show_outcome(outcome, out)")


class PlugInPresenter(PagePresenter):
    """Presenter of a plug-in whose own presenter does not derive from `PagePresenter`.

    Methods that the plug-in lacks are the defaults of the base class.
    """

    def __init__(self, presenter: Presenter) -> None:
        for member in ("findings", "residuals", "simulate", "show", "examine", "show_outcome"):
            if hasattr(presenter, member):
                setattr(self, member, getattr(presenter, member))
        self.charts = getattr(presenter, "CHARTS", {})


def page_presenter_of(name: str) -> PagePresenter:
    """Return the presenter of a kind of test by the kind's name.

    Raises
    ------
    InputError
        There is no such kind.
    PlugInFailure
        The plug-in that brings the kind cannot be used.
    """
    presenter = presenter_of(name)
    return presenter if isinstance(presenter, PagePresenter) else PlugInPresenter(presenter)


def value_charts(prepared: PreparedTest, residuals: pd.DataFrame, out: Output) -> Charts:
    """Return a chart of measured and modelled values, for kinds without charts of their own.

    Parameters
    ----------
    prepared : PreparedTest
        The test.
    residuals : DataFrame
        Matched values with the columns "quantity", "unit", "measured" and "modelled". A second
        column that stands before "quantity" is the abscissa, else the number of the row is.
    out : Output
        Place of the test's files, whose prefix begins the name of the figure.
    """
    names = list(residuals.columns)
    unit = residuals["unit"].iloc[0]
    label = names[1] if names.index("quantity") > 1 else "number"
    x = residuals[label] if label in names else residuals.index + 1
    curve = line("modelled", x, residuals["modelled"])
    series = [dots("measured", x, residuals["measured"], colour=7), curve]
    chart = Chart(prepared.test.name, label, str(unit), series, "measured and modelled values")
    return Charts(f"{out.prefix}values", [chart], "Every matched value beside the model's")
