"""What a bootstrap found: bands of the moduli beside those of the fit, correlations, words."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from ..experiments.notes import by_strain
from ..identification.bands import LEVEL, bands_of
from ..identification.information import summary
from ..identification.optimum import ANALYSES_USED_UP
from ..identification.propagation import moduli_of
from ..identification.resampling import Group
from ..materials.forms.base import COMPONENTS
from ..notes import Note, NoteKind, rows
from ..notes import lines as note_lines
from ..reports import percent
from .bootstrap_record import Sample
from .refound import Refound

if TYPE_CHECKING:
    import pandas as pd

Array = NDArray[np.float64]

#: Units of a group, below which their percentiles say little; samples, likewise.
FEW, FEW_SAMPLES = 5, 40
#: Of a number: what differs by less does not differ.
ROUNDING = 1e-9
#: Strains of each modulus in the table.
PLACES = 21
METHOD = (
    "Units are drawn with replacement, each among its own group, and count as often as they were "
    "drawn; every sample is fitted from the optimum of all. The bands are percentiles of the "
    "samples. They hold what differs between the units, and nothing that all of them share: "
    "the error of the mesh, a wrong form of the law or of the model, noise that is given and not "
    "in the residual."
)


@dataclass(frozen=True, eq=False)
class Bootstrap:
    """Samples of a fit's data, fitted.

    Parameters
    ----------
    found : the fit to all of the data. over : the sort of units. groups : the units. before :
        analyses that were needed before the first sample.
    """

    found: Refound
    over: str
    groups: Sequence[Group]
    samples: Sequence[Sample]
    before: int

    @property
    def analyses(self) -> int:
        """In all."""
        return self.before + sum(sample.analyses for sample in self.samples)

    @property
    def unfinished(self) -> int:
        """Samples whose analyses were used up on the way."""
        return sum(sample.status == ANALYSES_USED_UP for sample in self.samples)

    @property
    def strains(self) -> dict[str, Array]:
        """(n,) by modulus, up to what the tests reached."""
        valid = self.found.best.valid
        return {name: np.linspace(0.0, valid[c], PLACES) for name, c in COMPONENTS.items()}

    @cached_property
    def unknowns(self) -> Array:
        """(samples, count)."""
        return np.array([sample.unknowns for sample in self.samples])

    @cached_property
    def moduli(self) -> dict[str, Array]:
        """(samples, n) MPa by modulus."""
        own = self.found.problem.unknowns
        each = [moduli_of(own, y, self.strains) for y in self.unknowns]
        return {name: np.array([one[name] for one in each]) for name in COMPONENTS}

    @cached_property
    def bands(self) -> dict[str, Array]:
        """(2, n) MPa by modulus: percentiles."""
        ends = [(1 - LEVEL) / 2, (1 + LEVEL) / 2]
        return {name: np.quantile(own, ends, axis=0) for name, own in self.moduli.items()}

    @cached_property
    def of_fit(self) -> dict[str, Array]:
        """(2, n) MPa by modulus: the fit's own bands by the noise alone."""
        return bands_of(self.found.posterior, self.found.best.law, self.strains)

    @cached_property
    def sigma(self) -> dict[str, tuple[float, float]]:
        """By modulus, 1 sigma relative, root mean square along its strain: samples, and fit."""
        spread, first, sure = {}, {}, self.found.sure
        for name, own in self.moduli.items():
            best = self.found.best.law.modulus(name, self.strains[name])
            spread[name] = own.std(axis=0, ddof=1) / best
            first[name] = np.interp(self.strains[name], sure.strain[name], sure.sigma[name])
        samples, fit = summary(spread), summary(first)
        return {name: (samples[name], fit[name]) for name in samples}

    def coefficients(self) -> pd.DataFrame:
        """A row an unknown: value, sigma of the samples and of the fit, and correlations.

        Columns unknown, value, sigma, sigma_of_fit (MPa of a coefficient, else its own unit),
        and by each unknown's name the correlation over the samples.
        """
        import pandas as pd

        own, known = self.found.problem.unknowns, self.found.posterior
        turn = np.eye(own.count)
        turn[: own.size, : own.size] = own.to_coefficients
        each = self.unknowns @ turn.T
        sigma = each.std(axis=0, ddof=1)
        # What lies on a bound in every sample differs by rounding.
        sigma = np.where(sigma > ROUNDING * np.abs(each).max(axis=0), sigma, 0.0)
        moved = np.where(sigma > 0, sigma, np.inf)
        away = (each - each.mean(axis=0)) / moved
        correlation = away.T @ away / (len(each) - 1)
        names = list(known.labels)
        table = pd.DataFrame(
            {
                "unknown": names,
                "value": turn @ self.found.point.unknowns,
                "sigma": sigma,
                "sigma_of_fit": np.sqrt(np.diag(known.coefficients)),
            }
        )
        return pd.concat([table, pd.DataFrame(correlation, columns=names)], axis=1)

    def table(self) -> pd.DataFrame:
        """The moduli along their strains: modulus, strain, MPa, lower_MPa, upper_MPa, median_MPa,
        sigma_relative of the samples, fit_lower_MPa, fit_upper_MPa (noise alone)."""
        import pandas as pd

        found = []
        for name, strain in self.strains.items():
            best = self.found.best.law.modulus(name, strain)
            found.append(
                pd.DataFrame(
                    {
                        "modulus": name,
                        "strain": strain,
                        "MPa": best,
                        "lower_MPa": self.bands[name][0],
                        "upper_MPa": self.bands[name][1],
                        "median_MPa": np.median(self.moduli[name], axis=0),
                        "sigma_relative": self.moduli[name].std(axis=0, ddof=1) / best,
                        "fit_lower_MPa": self.of_fit[name][0],
                        "fit_upper_MPa": self.of_fit[name][1],
                    }
                )
            )
        return pd.concat(found, ignore_index=True)

    @property
    def notes(self) -> list[Note]:
        """Where percentiles say little."""
        told = list(self.found.notes)
        for group in self.groups:
            count = len(group.units)
            if count < FEW:
                words = (
                    f"{count} {self.over} only: so few drawn from themselves scatter less than "
                    "others would, and the percentiles are too narrow"
                )
                told.append(Note(NoteKind.FEW_UNITS, words, group.name))
        if len(self.samples) < FEW_SAMPLES:
            words = f"{len(self.samples)} samples: the ends of the bands are those of one or two"
            told.append(Note(NoteKind.FEW_UNITS, words))
        return told

    @property
    def result(self) -> dict[str, Any]:
        """What result.json says."""
        setup = self.found.setup
        return {
            "command": "bootstrap",
            "title": setup.project.title,
            "project": str(setup.project.path),
            "card": self.found.card,
            "tests": [test.test.name for test in setup.tests],
            "over": self.over,
            "groups": {group.name: [u.name for u in group.units] for group in self.groups},
            "seed": setup.project.fit.seed,
            "samples": len(self.samples),
            "analyses": self.analyses,
            "unfinished": self.unfinished,
            "level": LEVEL,
            "up_to_strain": by_strain(self.found.best.valid),
            "sigma_relative": {name: own for name, (own, _) in self.sigma.items()},
            "sigma_relative_of_fit": {name: of for name, (_, of) in self.sigma.items()},
            "method": METHOD,
            "notes": rows(self.notes),
        }

    def lines(self) -> list[str]:
        """For the terminal."""
        drawn = ", ".join(f"{group.name} ({len(group.units)})" for group in self.groups)
        told = [
            f"{len(self.samples)} samples of {self.over}: {drawn}; {self.analyses} analyses",
            "1 sigma, root mean square along the strain: "
            + ", ".join(
                f"{name} {percent(own)} (fit {percent(of)})"
                for name, (own, of) in self.sigma.items()
            ),
        ]
        if self.unfinished:
            told.append(f"{self.unfinished} samples used up their analyses before they settled")
        return [*told, *note_lines(self.notes)]

    def write(self, folder: Path | str) -> None:
        """Write bootstrap.csv, coefficients.csv, bootstrap.png, report.html, notes.csv and, last,
        result.json.

        Raises
        ------
        OutputError : the folder cannot be written.
        """
        from .bootstrap_page import write_bootstrap

        write_bootstrap(self, Path(folder))
