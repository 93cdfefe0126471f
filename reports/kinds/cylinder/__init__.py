"""Presenter of inflated cylinders whose bending is predicted."""

from collections.abc import Sequence

import numpy as np

from ....experiments.cylinder import CylinderKind
from ....experiments.cylinder.predicted import CylinderOutcome, CylinderPredicted
from ....experiments.cylinder.test import PART, CylinderTest
from ....experiments.data_files import Output
from ....experiments.forward import Cards, Runs, Simulation
from ....experiments.predicted import PredictedRun, record_of
from ....presenting import KINDS
from ....wording import percent
from ...content import Exhibit, Part, Words
from ...presenter import PagePresenter
from .figures import draw_figures, load_charts, tests_of, write_beams
from .tables import error_tables, openings, runs_table, write_tables

#: Largest number of predictions that the summary of the page names one by one.
SUMMED_UP = 4


def how_sure(outcome: CylinderOutcome) -> list[str]:
    """Return sentences on the uncertainty of the predicted loads."""
    lines = []
    shares = [
        np.nanmax(sigma) / np.max(outcome.bent[i].load)
        for i, sigma in outcome.spreads.items()
        if not np.isnan(sigma).all()
    ]
    if shares:
        lines.append(
            f"By what the cards leave open of their laws, loads are off by up to "
            f"{percent(max(shares))} of the largest (one standard deviation)."
        )
    lines += [f"{words[:1].upper()}{words[1:]}." for words in outcome.unsure]
    if len(outcome.band) > 1:
        ends = "; ".join(f"{end.name}: {end.meaning}" for end in outcome.band)
        lines.append(f"The solver's answer lies between walls ({ends}).")
    return lines


def assumptions(tests: Sequence[CylinderTest]) -> list[Part]:
    """Return the list of assumptions, each with the tests that it was made for; nothing if none."""
    lines = []
    for words in dict.fromkeys(words for test in tests for words in test.assumed):
        names = [test.name for test in tests if words in test.assumed]
        of_tests = "" if len(names) == len(tests) else f", for {', '.join(names)}"
        lines.append(f"the usual {words}{of_tests}")
    if not lines:
        return []
    return [Words(["Assumed, as the project does not say:"]), Words(lines, bulleted=True)]


def _in_brackets(text: object) -> str:
    """Return a remark in brackets after a space; "" without one."""
    return f" ({text})" if text else ""


def _sentence(row: Sequence[object]) -> str:
    """Return a row of the first table of the page (`openings`) in words."""
    test, card, stiffness, stiffness_band, *points = row
    words = [f"{test}, {card}: stiffness {stiffness}{_in_brackets(stiffness_band)} N/mm"]
    for name, cells in (("knee", points[:3]), ("limit point", points[3:])):
        load, load_band, deflection = cells
        if deflection:
            words.append(f"{name} at {load}{_in_brackets(load_band)} N and {deflection} mm")
        elif load:
            words.append(f"{name} {load}")
    return ", ".join(words)


class CylinderPresenter(PagePresenter):
    """Presenter of bent cylinders."""

    def show_outcome(self, outcome: CylinderOutcome, out: Output) -> Exhibit:
        """Write figures, tables and beams of all runs; return what the page shows of them."""
        tests = tests_of(outcome)
        figures = draw_figures(outcome, out)
        files = [*write_tables(outcome, tests, out), *write_beams(outcome, out)]
        tables = [runs_table(outcome, tests).without_empty_columns(), *error_tables(outcome)]
        first = openings(outcome)
        parts = [
            first.without_empty_columns(),
            *load_charts(outcome),
            Words(how_sure(outcome)),
            *assumptions(tests),
        ]
        lengths = {
            "length, mm": {t.length for t in tests},
            "span, mm": {t.supports.span for t in tests},
            "element size, mm": {t.size for t in tests},
            "seam width, mm": {t.seam_width for t in tests},
        }
        facts = [(label, float(v.pop())) for label, v in lengths.items() if len(v) == 1]
        sentences = [_sentence(row) for row in first.rows if row[2]]
        has_summary = sentences and len(first.rows) <= SUMMED_UP
        summary = f"{'; '.join(sentences)}." if has_summary else ""
        return Exhibit(facts, figures, tables, files, parts, summary=summary)

    def simulate(
        self, test: CylinderTest, cards: Cards, runs: Runs, out: Output, within_range: bool = False
    ) -> Simulation:
        """Write load_deflection.csv, figures and beams; return the numbers of every card."""
        predicted = []
        for name, card in cards.items():
            run = runs[name, PART]
            record = record_of(CylinderPredicted(), run.model, run.outcome)
            predicted.append(PredictedRun(test, name, card, run.model, record))
        outcome = CylinderOutcome(predicted)
        parts = self.show_outcome(outcome, out).all_parts() if outcome.measures else []
        numbers = {
            name: {
                "ended": outcome.ended(i),
                **(outcome.numbers(i) if i in outcome.measures else {}),
            }
            for i, name in enumerate(cards)
        }
        errors = {name: outcome.error(i) for i, name in enumerate(cards)}
        compared = {name: error for name, error in errors.items() if error is not None}
        return Simulation({"cards": numbers}, outcome.lines(), parts=parts, errors=compared)


KINDS.register(CylinderKind, CylinderPresenter())
