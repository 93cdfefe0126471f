"""A plan: what is known of the moduli now, and with each test that could be made; ranked."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from ..experiments.notes import by_strain
from ..identification.information import summary
from ..materials.forms.base import COMPONENTS
from ..notes import Note, rows
from ..notes import lines as note_lines
from ..reports import percent

if TYPE_CHECKING:
    import pandas as pd

Array = NDArray[np.float64]

#: A modulus less certain than this (1 sigma, relative) is as good as unknown.
UNKNOWN = 1.0
#: Shares of the strains asked for at which moduli are listed.
SHARES = (0.0, 0.5, 1.0)
#: What a rank is by: the least certain of the three moduli, or one of them.
WORST = "worst"
#: The line of a plan that is no candidate.
NOW = "now"
ASSUMED = (
    "Assumed: the law at the card, and its form, are right; values err independently of each other "
    "but for neighbours that the fit of the present tests counts as one; every value counts by its "
    "noise, not by a weight of the objective; the error of the mesh is in no sigma; a candidate is "
    "made on a flat and taut sheet unless the project's own tests look for its shape."
)


def words(sigma: float) -> str:
    """A relative uncertainty as percent, as long as it says anything."""
    return percent(sigma) if sigma < UNKNOWN else "unknown"


@dataclass(frozen=True, eq=False)
class Planned:
    """What would be known of the moduli.

    Parameters
    ----------
    name : of the candidate, NOW for the present tests alone. kind : of the test, "" for those.
    specimens : how many. noise : of its values, in words. sigma : by modulus, 1-sigma relative
    uncertainty (n,) along its strain.
    """

    name: str
    kind: str
    specimens: int
    noise: str
    sigma: Mapping[str, Array]

    @property
    def title(self) -> str:
        """With how many specimens."""
        return self.name if self.specimens == 1 else f"{self.name}, {self.specimens} specimens"

    @property
    def summary(self) -> dict[str, float]:
        """One figure a modulus: root of the mean square along its strain."""
        return summary(self.sigma)

    def value(self, rank: str) -> float:
        """What is ranked by: the smaller the better."""
        return max(self.summary.values()) if rank == WORST else self.summary[rank]


@dataclass(frozen=True, eq=False)
class Plan:
    """The tests that could be made next, best first.

    Parameters
    ----------
    card : what it is named. tests : the present ones. ends : (3,) strains (eps1, eps2, gamma12) up
    to which moduli are asked for. rank : WORST, or a modulus. now : of the present tests.
    candidates : ranked. following : name of the best test after the first, and what would then be
    known; None where there is none.
    """

    title: str
    project: Path
    card: str
    tests: Sequence[str]
    ends: Array
    rank: str
    now: Planned
    candidates: Sequence[Planned]
    following: Planned | None = None
    notes: Sequence[Note] = ()

    @property
    def criterion(self) -> str:
        """What the candidates are ranked by, in words."""
        of = "the least certain modulus" if self.rank == WORST else self.rank
        return f"1 sigma of {of}, root of the mean square along its strain"

    @property
    def strains(self) -> dict[str, Array]:
        """(3,) by modulus: where moduli are listed."""
        return {n: np.array(SHARES) * float(self.ends[c]) for n, c in COMPONENTS.items()}

    def at(self, planned: Planned) -> dict[str, list[float]]:
        """1-sigma relative uncertainty by modulus at the listed strains."""
        found = {}
        for name, strain in self.strains.items():
            along = np.linspace(0.0, strain[-1], len(planned.sigma[name]))
            found[name] = np.interp(strain, along, planned.sigma[name]).tolist()
        return found

    def table(self) -> pd.DataFrame:
        """Columns rank, test, kind, specimens, noise, then by modulus sigma_E1, sigma_E1_at_0 ...

        The first row, of rank 0, is what is known now. Relative: 0.01 is 1 %.
        """
        import pandas as pd

        table = []
        for place, planned in enumerate((self.now, *self.candidates)):
            row: dict[str, object] = {
                "rank": place,
                "test": planned.name,
                "kind": planned.kind,
                "specimens": planned.specimens,
                "noise": planned.noise,
            }
            row |= {f"sigma_{name}": value for name, value in planned.summary.items()}
            for name, values in self.at(planned).items():
                strains = self.strains[name]
                row |= {
                    f"sigma_{name}_at_{strain:.4g}": value
                    for strain, value in zip(strains, values, strict=True)
                }
            table.append(row)
        return pd.DataFrame(table)

    @property
    def result(self) -> dict[str, Any]:
        """What result.json says."""
        return {
            "command": "plan",
            "title": self.title,
            "project": str(self.project),
            "card": self.card,
            "tests": list(self.tests),
            "criterion": self.criterion,
            "strains": {name: at.tolist() for name, at in self.strains.items()},
            "up_to_strain": by_strain(self.ends),
            "now": self._numbers(self.now),
            "candidates": [self._numbers(planned) for planned in self.candidates],
            "following": None if self.following is None else self._numbers(self.following),
            "assumed": ASSUMED,
            "notes": rows(self.notes),
        }

    def _numbers(self, planned: Planned) -> dict[str, Any]:
        return {
            "test": planned.name,
            "kind": planned.kind,
            "specimens": planned.specimens,
            "noise": planned.noise,
            "sigma": planned.summary,
            "sigma_at": self.at(planned),
            "unknown": [name for name, value in planned.summary.items() if value >= UNKNOWN],
        }

    def lines(self) -> list[str]:
        """A table for the terminal, and what it rests on."""
        every = (self.now, *self.candidates)
        wide = max(len(planned.title) for planned in every) + 2
        head = "".join(f"{name:>10}" for name in COMPONENTS)
        told = [
            f"1 sigma of the moduli up to strain {', '.join(f'{e:.3g}' for e in self.ends)} (warp, "
            f"fill, shear), with one more test beside {', '.join(self.tests) or 'none'}",
            f"{'':4}{'test':<{wide}}{head}   noise",
        ]
        for place, planned in enumerate(every):
            mark = f"{place:>2}. " if place else "    "
            numbers = "".join(f"{words(planned.summary[name]):>10}" for name in COMPONENTS)
            told.append(f"{mark}{planned.title:<{wide}}{numbers}   {planned.noise}".rstrip())
        told.append(f"ranked by {self.criterion}")
        if self.following is not None:
            numbers = ", ".join(f"{n} {words(s)}" for n, s in self.following.summary.items())
            told.append(f"after the first, {self.following.title} would give {numbers}")
        return [*told, ASSUMED, *note_lines(self.notes)]

    def write(self, folder: Path | str) -> None:
        """Write plan.csv, plan.png, report.html, notes.csv and, last, result.json.

        Raises
        ------
        OutputError : the folder cannot be written.
        """
        from .plan_page import write_plan

        write_plan(self, Path(folder))
