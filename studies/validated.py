"""Laws at tests that they were not fitted to: tables, words, files."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from .. import __version__
from ..fits.store import Store
from ..notes import Note, rows, write_notes
from ..writing import replacing
from .held_out import HeldOut

if TYPE_CHECKING:
    import pandas as pd

TABLE = "validation.csv"


@dataclass(frozen=True, eq=False)
class Judged:
    """One law at one test.

    law : the form that was fitted, or the card. foretold : by the fit to the rest of the data, or
    by the card. fitted : by the fit to all of them, None for a card.
    """

    law: str
    foretold: HeldOut
    fitted: HeldOut | None = None


@dataclass(frozen=True, eq=False)
class Validation:
    """Laws at what they were not fitted to: whole tests, or parts (frames, ...) as `leave` says."""

    title: str
    judged: tuple[Judged, ...]
    leave: str = "tests"

    @property
    def means(self) -> dict[str, float]:
        """By law: mean of the errors foretold; NaN where one is not known."""
        laws = dict.fromkeys(one.law for one in self.judged)
        return {law: float(np.mean([*self._of(law)])) for law in laws}

    def _of(self, law: str) -> Iterable[float]:
        return (_relative(one.foretold) for one in self.judged if one.law == law)

    @property
    def notes(self) -> list[Note]:
        """Of every law, at every test."""
        return [note.about(one.law) for one in self.judged for note in one.foretold.notes]

    def table(self) -> pd.DataFrame:
        """A row a law and comparison: law, test, compared, unit, errors."""
        import pandas as pd

        return pd.DataFrame(
            [
                {
                    "law": one.law,
                    "test": one.foretold.test,
                    "compared": name,
                    "unit": unit,
                    "foretold_rms": _rms(one.foretold, name),
                    "fitted_rms": _rms(one.fitted, name),
                    "foretold_relative": _relative(one.foretold),
                    "fitted_relative": _relative(one.fitted),
                    "foretold_words": one.foretold.words,
                }
                for one in self.judged
                for name, unit in one.foretold.units.items()
            ]
        )

    @property
    def result(self) -> dict[str, Any]:
        """What result.json says."""
        table = self.table()
        means = {law: None if np.isnan(mean) else mean for law, mean in self.means.items()}
        return {
            "command": "validate",
            "title": self.title,
            "version": __version__,
            "left_out": self.leave,
            "error": "mean relative RMS error of a test, or of its part",
            "mean_foretold": means,
            "rows": [
                {k: None if isinstance(v, float) and np.isnan(v) else v for k, v in row.items()}
                for row in table.to_dict("records")
            ],
            "notes": rows(self.notes),
        }

    def lines(self) -> list[str]:
        """The table for a terminal, and what it comes to."""
        table = self.table()
        wide = max([20, *(2 + len(name) for name in table["test"])])
        head = "left out" if self.leave != "tests" else "test left out"
        said = [f"{'law':14}{head:{wide}}{'compared':24}{'foretold':>12}{'fitted':>10}  unit"]
        for row in table.itertuples():
            said.append(
                f"{row.law:14}{row.test:{wide}}{row.compared:24}{row.foretold_rms:12.4g}"
                f"{row.fitted_rms:10.4g}  {row.unit}"
            )
        said += [
            f"{one.law}, {one.foretold.test}: {one.foretold.words}"
            for one in self.judged
            if one.foretold.words
        ]
        means = {law: mean for law, mean in self.means.items() if not np.isnan(mean)}
        said += [f"{law}: foretold {100 * mean:.3g} % on average" for law, mean in means.items()]
        if len(means) > 1:
            said.append(f"foretells best: {min(means, key=means.__getitem__)}")
        return said

    def _shown(self) -> tuple[list[str], dict[str, list[float]], dict[str, list[float]]]:
        """Names of the tests or parts; by law the errors there, foretold and fitted."""
        names = list(dict.fromkeys(one.foretold.test for one in self.judged))
        laws = dict.fromkeys(one.law for one in self.judged)
        of = {(one.law, one.foretold.test): one for one in self.judged}

        def errors(law: str, fitted: bool) -> list[float]:
            found = [of.get((law, name)) for name in names]
            return [
                np.nan if one is None else _relative(one.fitted if fitted else one.foretold)
                for one in found
            ]

        after = {law: own for law in laws if np.isfinite(own := errors(law, True)).any()}
        return names, {law: errors(law, False) for law in laws}, after

    def write(self, folder: Path) -> None:
        """validation.csv, notes.csv, the page and, last, result.json; raises OutputError."""
        from ..reports import write_report
        from ..reports.named_charts import held_out_charts
        from .study_page import study_page

        with replacing(folder / TABLE) as path:
            self.table().to_csv(path, index=False, float_format="%.9g")
        write_notes(folder, self.notes)
        title = f"{self.title}: does a fit foretell what it was not given?"
        charts = held_out_charts(*self._shown(), "Errors at what a fit was not given, and was")
        said = (title, self.lines(), self.table(), TABLE, self.notes)
        write_report(folder, study_page(*said, charts=[charts]))
        Store(folder).finish(self.result)


def _relative(one: HeldOut | None) -> float:
    return np.nan if one is None or one.error is None else one.error


def _rms(one: HeldOut | None, comparison: str) -> float:
    return np.nan if one is None else one.rms.get(comparison, np.nan)
