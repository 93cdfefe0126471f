"""Presenter of decks of the user's own: what is compared, measured beside modelled."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from ...experiments.base import Findings, FittedTest
from ...experiments.data_files import Output
from ...experiments.deck import Compared, DeckKind, DeckTest
from ...experiments.deck.prepared import DeckObjective, PreparedDeck
from ...experiments.forward import Cards, Runs, Simulation
from ...experiments.measured import compared, errors_of_cards
from ...lazy_modules import pandas as pd
from ...presenting import KINDS
from ...solvers.base import Array, History
from ...storage.writing import write_text
from ..charts import Chart, Charts, dots
from ..content import Exhibit
from ..presenter import PagePresenter

#: Table of a forward analysis.
COMPARED = "compared.csv"
CAPTION = "What is compared of the deck, measured and modelled"


class DeckPresenter(PagePresenter):
    """Presenter of decks: RMS errors, charts, residuals, and the filled deck as a file."""

    def findings(self, prepared: PreparedDeck, fitted: FittedTest) -> Findings:
        """Return the RMS error of every quantity, in its unit and over its largest value."""
        parts = prepared.fitted_parts(fitted)
        numbers = {part.data.name: _error(part.objective, part.history) for part in parts}
        words = _words(numbers)
        return Findings({"compared": numbers}, (), (words,), words, words)

    def residuals(self, prepared: PreparedDeck, fitted: FittedTest) -> pd.DataFrame:
        """Return a table with a row for each measured value and the modelled one beside it."""
        parts = prepared.fitted_parts(fitted)
        tables = [_table(part.data, part.objective.modelled(part.history)) for part in parts]
        return pd.concat(tables, ignore_index=True)

    def show(
        self, prepared: PreparedDeck, fitted: FittedTest, findings: Findings, out: Output
    ) -> Exhibit:
        """Write the filled deck, and return charts for the page."""
        model = prepared.test.model
        values = fitted.reported_nuisance
        changes = {name: values[name] - value for name, value in model.values.items()}
        deck = model.with_parameters(changes).deck(fitted.law)
        write_text(out.path(model.deck_name), str(deck.files[model.deck_name]))
        charts = _charts(prepared.test.name, {"modelled": self.residuals(prepared, fitted)})
        files = [(out.name(model.deck_name), "the deck, filled with the best values")]
        parts = [charts]
        return Exhibit(facts=[("misfit", findings.summary)], parts=parts, files=files)

    def simulate(
        self, test: DeckTest, cards: Cards, runs: Runs, out: Output, within_range: bool = False
    ) -> Simulation:
        """Write what is measured beside the results with each card; return the RMS errors."""
        pairs = zip(test.matched.items(), test.model.reader.rows, strict=True)
        objectives = {name: DeckObjective(data, rows, 1.0) for (name, data), rows in pairs}

        def errors(history: History) -> dict[str, Any]:
            return {name: _error(objective, history) for name, objective in objectives.items()}

        numbers, lines, histories = errors_of_cards(runs, errors, _words)
        tables = {}
        for card, history in histories.items():
            modelled = [objective.modelled(history) for objective in objectives.values()]
            parts = map(_table, test.matched.values(), modelled)
            tables[card] = pd.concat(parts, ignore_index=True)
        if tables:
            out.write(COMPARED, pd.concat(tables, names=["card"]).reset_index(level="card"))
        for (card, _), run in runs.items():
            numbers[card]["parameters"] = dict(run.model.values)
            lines += _parameter_lines(card, run.model.values)
        largest = {
            card: max(numbers[card][name]["relative"] for name in objectives) for card in tables
        }
        charts = [_charts(test.name, tables)] if tables else []
        return Simulation({"cards": numbers}, lines, charts, largest)


def _parameter_lines(card: str, values: Mapping[str, float]) -> list[str]:
    """Return the line with the values of a deck's parameters; none of a deck without any."""
    words = ", ".join(f"{name} {value:.4g}" for name, value in values.items())
    return [f"{card}: {words}"] if words else []


def _table(data: Compared, modelled: Array) -> pd.DataFrame:
    """Return measured and modelled values (n,) of a comparison side by side."""
    where = {"part": data.name, **data.reading.columns}
    return compared(data.name, data.load, modelled, data.unit, **where)


def _charts(title: str, tables: Mapping[str, pd.DataFrame]) -> Charts:
    """Return a chart of each quantity: measured, and modelled by the label of each table."""
    charts = []
    first = next(iter(tables.values()))
    for (name, unit), rows in first.groupby(["quantity", "unit"], sort=False):
        abscissa = "measured" if "time" in rows.dropna(axis=1) else "x"
        series = [dots("measured", rows[abscissa], rows["measured"], colour=7)]
        for rank, (label, table) in enumerate(tables.items()):
            values = table.loc[rows.index, "modelled"]
            series.append(dots(label, rows[abscissa], values, colour=rank % 7))
        charts.append(Chart(str(name), abscissa, f"{name}, {unit}", series, CAPTION))
    return Charts(f"{title} deck", charts, CAPTION)


def _error(objective: DeckObjective, history: History) -> dict[str, float]:
    """Return the RMS error in the unit of the values, and over the largest."""
    rms = objective.rms(history)
    return {"rms": rms, "relative": rms / abs(objective.measured).max()}


def _words(numbers: dict[str, Any]) -> str:
    """Return the RMS errors of all comparisons of a deck in words."""
    errors = [
        f"{name} {error['rms']:.3g} ({100 * error['relative']:.2g} % of the largest)"
        for name, error in numbers.items()
    ]
    return f"RMS error of {', '.join(errors)}"


KINDS.register(DeckKind, DeckPresenter())
