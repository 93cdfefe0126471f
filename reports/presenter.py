"""Presenters of kinds of test with all that pages and notebooks show of them."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

from ..experiments.base import PreparedTest
from ..experiments.fitted import Findings, FittedTest
from ..experiments.forward import Cards, Runs, Simulation
from ..experiments.output import Output
from ..experiments.presenter import Presenter, presenter_of
from ..lazy_modules import pandas as pd
from .charts import Chart, Charts, dots, line
from .content import Exhibit

#: Returns charts of a prepared and fitted test.
FittedChart = Callable[[Any, FittedTest], Charts]


class PagePresenter:
    """Base class of the presenters of kinds of test.

    A kind that is fitted has `findings` and `residuals`, one that cards predict `show_outcome`,
    each of them `simulate`; all else has a default.
    """

    @property
    def charts(self) -> Mapping[str, FittedChart]:
        """Return charts of a fitted test by name, for notebooks."""
        return {}

    def findings(self, prepared: Any, fitted: FittedTest) -> Findings:
        """Return the meaning of a fit for a test: numbers, warnings and words."""
        raise NotImplementedError(f"{type(self).__name__} needs findings(prepared, fitted)")

    def residuals(self, prepared: Any, fitted: FittedTest) -> pd.DataFrame:
        """Return a row a matched value."""
        raise NotImplementedError(f"{type(self).__name__} needs residuals(prepared, fitted)")

    def simulate(
        self, test: Any, cards: Cards, runs: Runs, out: Output, within_range: bool = False
    ) -> Simulation:
        """Write files and figures of forward analyses and return their numbers."""
        raise NotImplementedError(f"{type(self).__name__} needs simulate(test, cards, runs, out)")

    def show(self, prepared: Any, fitted: FittedTest, findings: Findings, out: Output) -> Exhibit:
        """Write the files of a fit and return what the page shows.

        A kind that shows nothing of its own has the misfit and a chart of every matched value.
        """
        charts = value_charts(prepared, self.residuals(prepared, fitted), out)
        return Exhibit(facts=[("misfit", findings.summary)], parts=[charts])

    def examine(self, prepared: Any, out: Output) -> Exhibit | None:
        """Write the files of the data before a fit; None where nothing is shown of them."""
        return None

    def show_outcome(self, outcome: Any, out: Output) -> Exhibit:
        """Write the files of the runs of tests that are predicted and return the page's content."""
        raise NotImplementedError(f"{type(self).__name__} needs show_outcome(outcome, out)")


class PlugInPresenter(PagePresenter):
    """The presenter of a plug-in that derives from nothing; what it lacks is the default."""

    def __init__(self, presenter: Presenter) -> None:
        for member in ("findings", "residuals", "simulate", "show", "examine", "show_outcome"):
            if hasattr(presenter, member):
                setattr(self, member, getattr(presenter, member))
        self._charts: Mapping[str, FittedChart] = getattr(presenter, "CHARTS", {})

    @property
    def charts(self) -> Mapping[str, FittedChart]:
        return self._charts


def page_presenter_of(name: str) -> PagePresenter:
    """Return the presenter of the kind of this name; InputError, PlugInFailure."""
    presenter = presenter_of(name)
    return presenter if isinstance(presenter, PagePresenter) else PlugInPresenter(presenter)


def value_charts(prepared: PreparedTest, residuals: pd.DataFrame, out: Output) -> Charts:
    """Return the chart of every matched value over its place, measured and modelled."""
    names = list(residuals.columns)
    unit = residuals["unit"].iloc[0]
    label = names[1] if names.index("quantity") > 1 else "number"
    x = residuals[label] if label in names else residuals.index + 1
    curve = line("modelled", x, residuals["modelled"])
    series = [dots("measured", x, residuals["measured"], colour=7), curve]
    chart = Chart(prepared.test.name, label, str(unit), series, "measured and modelled values")
    return Charts(f"{out.prefix}values", [chart], "Every matched value beside the model's")
