"""What a study of weights says: a table, a figure, result.json, lines for the terminal."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from .. import __version__
from ..fits.result import Fit
from ..materials.forms.base import COMPONENTS
from ..notes import Note, NoteKind, rows, write_notes
from ..writing import replacing
from .weighted_fit import PLACES, WeightedFit

if TYPE_CHECKING:
    import pandas as pd

TABLE, FIGURE = "weights.csv", "weights.png"
ERROR = "mean relative RMS error of a test"


@dataclass(frozen=True, eq=False)
class WeightStudy:
    """Fits over the weight of some of the tests.

    counted : the kind or name asked for, names : of the tests. found : the fit at the project's
    weights. runs : by rising weight.
    """

    title: str
    counted: str
    names: Sequence[str]
    found: Fit
    runs: Sequence[WeightedFit]

    @property
    def ended(self) -> list[WeightedFit]:
        """The fits that ended well."""
        return [run for run in self.runs if not run.failure]

    def strain(self, name: str, place: float) -> float:
        """The strain at which a modulus is followed."""
        return float(place * self.found.best.valid[COMPONENTS[name]])

    def table(self) -> pd.DataFrame:
        """A row a weight: how many times it counts, errors by test and comparison, moduli."""
        import pandas as pd

        units = {c.name: c.objective.unit for c in self.found.problem.comparisons}
        told = []
        for run in self.ended:
            row: dict[str, float] = {"weight_times": run.count}
            row |= {f"relative {test}": value for test, value in run.relative.items()}
            row |= {f"rms {name}, {units[name]}": value for name, value in run.rms.items()}
            for name, values in run.moduli.items():
                for place, value in zip(PLACES, values, strict=True):
                    row[f"{name}_MPa at {self.strain(name, place):.4g}"] = value
            told.append({**row, "analyses": run.analyses})
        return pd.DataFrame(told)

    def change(self, name: str) -> tuple[float, float]:
        """Least and largest relative change of a modulus at any place, over all weights."""
        own = next(run for run in self.runs if run.count == 1)
        before = np.array(own.moduli[name])
        changes = np.array([run.moduli[name] for run in self.ended]) / before - 1.0
        low, high = np.round([changes.min(), changes.max()], 9) + 0.0  # no rounding of the fits
        return float(low), float(high)

    def sigma(self, name: str) -> list[float] | None:
        """1 sigma, relative, at the places, at the project's weights; None where not known."""
        sure = self.found.best.certainty
        if sure is None:
            return None
        strains = [self.strain(name, place) for place in PLACES]
        return [float(v) for v in np.interp(strains, sure.strain[name], sure.total[name])]

    @property
    def notes(self) -> list[Note]:
        """Fits that failed, and what a reader should know of the one at the project's weights."""
        failed = [
            Note(NoteKind.FAILED, run.failure, f"weight times {run.count:.3g}")
            for run in self.runs
            if run.failure
        ]
        return [*failed, *self.found.notes]

    @property
    def result(self) -> dict[str, Any]:
        """What result.json says."""
        return {
            "command": "validate",
            "title": self.title,
            "version": __version__,
            "weights_of": self.counted,
            "tests_counted": list(self.names),
            "error": ERROR,
            "strain": {n: [self.strain(n, p) for p in PLACES] for n in COMPONENTS},
            "sigma_relative": {name: self.sigma(name) for name in COMPONENTS},
            "change": {name: list(self.change(name)) for name in COMPONENTS},
            "rows": [
                {
                    "weight_times": run.count,
                    "relative": dict(run.relative),
                    "rms": dict(run.rms),
                    "moduli_MPa": {name: list(values) for name, values in run.moduli.items()},
                    "analyses": run.analyses,
                }
                for run in self.ended
            ],
            "notes": rows(self.notes),
        }

    def lines(self) -> list[str]:
        """A table for the terminal, and how far the weight moves each modulus."""
        tests = list(self.ended[0].relative)
        wide = [max(12, 2 + len(name)) for name in tests]
        head = "".join(f"{name:>{w}}" for name, w in zip(tests, wide, strict=True))
        half = [f"{name} at {self.strain(name, 0.5):.3g}" for name in COMPONENTS]
        said = [
            f"weight of {self.counted}, times what the project says; {ERROR}; moduli in MPa",
            f"{'weight':>8}{head}" + "".join(f"{words:>16}" for words in half),
        ]
        middle = list(PLACES).index(0.5)
        for run in self.ended:
            values = "".join(
                f"{run.relative[name]:>{w}.4g}" for name, w in zip(tests, wide, strict=True)
            )
            moduli = "".join(f"{run.moduli[name][middle]:>16.4g}" for name in COMPONENTS)
            said.append(f"{run.count:>8.3g}{values}{moduli}")
        for name in COMPONENTS:
            low, high = self.change(name)
            sigma = self.sigma(name)
            beside = "" if sigma is None else f" (1 sigma there: {100 * max(sigma):.2g} % at most)"
            said.append(f"{name} changes by {100 * low:+.2g} to {100 * high:+.2g} %{beside}")
        return said

    def write(self, folder: Path) -> None:
        """weights.csv, weights.png, notes.csv and, last, result.json; raises OutputError."""
        from ..fits.store import Store
        from ..reports import plot_weights, write_report
        from ..reports.weights_charts import weights_charts
        from .study_page import study_page

        with replacing(folder / TABLE) as path:
            self.table().to_csv(path, index=False, float_format="%.9g")
        shown = (
            self.counted,
            [run.count for run in self.ended],
            {name: [run.relative[name] for run in self.ended] for name in self.ended[0].relative},
            {
                name: {
                    self.strain(name, place): [run.moduli[name][k] for run in self.ended]
                    for k, place in enumerate(PLACES)
                }
                for name in COMPONENTS
            },
            {name: self.sigma(name) for name in COMPONENTS},
        )
        plot_weights(folder / FIGURE, *shown)
        write_notes(folder, self.notes)
        title = f"{self.title}: the weight of {self.counted}"
        said = (title, self.lines(), self.table(), TABLE, self.notes)
        write_report(folder, study_page(*said, FIGURE, weights_charts(*shown)))
        Store(folder).finish(self.result)
