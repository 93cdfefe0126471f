"""Rank tests that could be made next by the predicted uncertainty of the moduli."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from ..errors import InputError, Note, Positive, SolverFailure, check_one_of, checked, rows
from ..errors import lines as note_lines
from ..experiments.kinds import (
    BEYOND_LAW,
    Candidate,
    MakeSolver,
    Place,
    Plannable,
    Planning,
    Precision,
    Weighting,
    by_strain,
    notes_beyond,
    other_thickness,
    strains_of,
    unstable_words,
)
from ..experiments.registry import kinds
from ..files import pandas as pd
from ..inference.linear import POINTS, information_of
from ..inference.posterior import Posterior
from ..inference.reported import UNKNOWN, ReportedModulus, reported_moduli, sigma_words
from ..inference.unknowns import Unknowns
from ..materials.card import MaterialCard
from ..materials.forms.base import COMPONENTS, UNLIMITED, Array
from ..materials.law import HypoelasticLaw
from ..project.project import Project
from .best import CardOptimum, find_optimum
from .folder import Presented, check_unused, finished
from .in_use import alone_in_folder
from .progress import Listener, listener
from .simulation import FAILED, card_of, card_words

#: Shares of the largest strains at which moduli are listed.
SHARES = (0.0, 0.5, 1.0)
#: Rank by the least certain of the three moduli.
WORST = "worst"
#: Name of the row of the present tests.
NOW = "now"
ASSUMED = (
    "Assumed: the law at the optimum, and its form, are right; the present tests determine what "
    "their fit reports; values of a candidate err independently of each other but for neighbours "
    "that the fit counts as one, and agree with the law but for their noise; a candidate is "
    "made on a flat and taut sheet unless the project's own tests look for its shape."
)


@dataclass(frozen=True, eq=False)
class Prospect:
    """The predicted uncertainty of the moduli with one more test.
    name, kind : of the test; NOW and "" for the present tests alone. noise : of its values, in
    words. moduli : what would be reported of each."""

    name: str
    kind: str
    specimens: int
    noise: str
    moduli: Mapping[str, ReportedModulus]

    @property
    def title(self) -> str:
        return self.name if self.specimens == 1 else f"{self.name}, {self.specimens} specimens"

    @property
    def summary(self) -> dict[str, float]:
        """Return the root mean square of sigma along the strain, by modulus."""
        return {name: modulus.rms_sigma for name, modulus in self.moduli.items()}

    @property
    def words(self) -> dict[str, str]:
        """Return `summary` in words, not determined where most of the strains are not."""
        return {
            name: sigma_words(modulus.rms_sigma, modulus.numbers["not_determined"] > 0.5)
            for name, modulus in self.moduli.items()
        }

    def value(self, rank: str) -> float:
        """Return the number that tests are ranked by: the smaller the better."""
        return max(self.summary.values()) if rank == WORST else self.summary[rank]

    def order(self, rank: str) -> tuple[float, float]:
        """Return `value` as it is shown; of equal ones the sum of all moduli decides."""
        return float(f"{self.value(rank):.2g}"), sum(self.summary.values())

    @property
    def row(self) -> dict[str, Any]:
        return {
            "test": self.name,
            "kind": self.kind,
            "specimens": self.specimens,
            "noise": self.noise,
        }


@dataclass(frozen=True, eq=False)
class Plan(Presented):
    """The tests that could be made next, best first.
    card : its name. tests : the present ones. ends : (3,) largest strains (eps1, eps2, gamma12) of
    the moduli. rank : WORST, or a modulus. now : of the present tests alone. candidates : ranked.
    following : the best test after the first, None where there is none."""

    project: Project
    card: str
    tests: Sequence[str]
    ends: Array
    rank: str
    now: Prospect
    candidates: Sequence[Prospect]
    following: Prospect | None = None
    notes: Sequence[Note] = ()

    @property
    def criterion(self) -> str:
        """Return the quantity that candidates are ranked by, in words."""
        of = "the least certain modulus" if self.rank == WORST else self.rank
        return f"1 sigma of {of}, root of the mean square along its strain"

    @property
    def strains(self) -> dict[str, Array]:
        """Return strains (3,) by modulus at which moduli are listed."""
        return {n: np.array(SHARES) * float(self.ends[c]) for n, c in COMPONENTS.items()}

    def at(self, test: Prospect) -> dict[str, list[float]]:
        """Return 1-sigma relative uncertainties by modulus at the listed strains."""
        return {
            name: np.interp(strain, modulus.strain, modulus.sigma).tolist()
            for (name, modulus), strain in zip(
                test.moduli.items(), self.strains.values(), strict=True
            )
        }

    def table(self) -> pd.DataFrame:
        """Return a row a test, with relative sigma of each modulus; rank 0 is the present."""
        table = []
        for place, test in enumerate((self.now, *self.candidates)):
            row: dict[str, object] = {"rank": place, **test.row}
            row |= {f"sigma_{name}": value for name, value in test.summary.items()}
            for name, values in self.at(test).items():
                for strain, value in zip(self.strains[name], values, strict=True):
                    row[f"sigma_{name}_at_{strain:.4g}"] = value
            table.append(row)
        return pd.DataFrame(table)

    @property
    def result(self) -> dict[str, Any]:
        return {
            "command": "plan",
            "title": self.project.title,
            "project": str(self.project.path),
            "card": self.card,
            "tests": list(self.tests),
            "criterion": self.criterion,
            "strains": {name: at.tolist() for name, at in self.strains.items()},
            "up_to_strain": by_strain(self.ends),
            "now": self._numbers(self.now),
            "candidates": [self._numbers(test) for test in self.candidates],
            "following": None if self.following is None else self._numbers(self.following),
            "assumed": ASSUMED,
            "notes": rows(self.notes),
        }

    def _numbers(self, test: Prospect) -> dict[str, Any]:
        return {
            **test.row,
            "sigma": test.summary,
            "sigma_at": self.at(test),
            "unknown": [n for n, words in test.words.items() if words == UNKNOWN],
        }

    def lines(self) -> list[str]:
        every = (self.now, *self.candidates)
        wide = max(len(test.title) for test in every) + 2
        head = "".join(f"{name:>10}" for name in COMPONENTS)
        lines = [
            "1 sigma of the moduli up to strains of "
            f"{', '.join(f'{100 * e:.3g}' for e in self.ends)} % (warp, fill, shear),",
            f"with one more test beside {', '.join(self.tests) or 'none'}",
            f"{'':4}{'test':<{wide}}{head}   noise",
        ]
        for place, test in enumerate(every):
            mark = f"{place:>2}. " if place else "    "
            numbers = "".join(f"{test.words[name]:>10}" for name in COMPONENTS)
            lines.append(f"{mark}{test.title:<{wide}}{numbers}   {test.noise}".rstrip())
        lines.append(f"ranked by {self.criterion}")
        if self.following is not None:
            numbers = ", ".join(f"{n} {words}" for n, words in self.following.words.items())
            lines.append(f"after the first, {self.following.title} would give {numbers}")
        return [*lines, ASSUMED, *note_lines(self.notes)]


@dataclass(frozen=True, eq=False)
class Query:
    """The question of a plan: the posterior of the present law, and the strains of its moduli."""

    posterior: Posterior
    law: HypoelasticLaw
    ends: Array

    def moduli(self, more: Array | None = None) -> dict[str, ReportedModulus]:
        """Return what is reported of the moduli with more information (size, size)."""
        posterior = self.posterior if more is None else self.posterior.with_information(more)
        strains = {n: np.linspace(0.0, self.ends[c], POINTS) for n, c in COMPONENTS.items()}
        return reported_moduli(posterior, self.law, strains)


def precision_of(found: CardOptimum) -> dict[str, Precision]:
    """Return the noise of the values of each present comparison, as the fit counts it."""
    noise = found.sure.noise
    return {
        c.name: Precision(
            noise.level[c.name], noise.correlated_count[c.name], round(np.mean(c.objective.sizes))
        )
        for c in found.problem.comparisons
    }


@checked
@alone_in_folder
def plan(
    project: Project,
    card: MaterialCard | Path | str | None = None,
    tests: str | Sequence[str] | None = None,
    *,
    strain: Sequence[float] | None = None,
    rank: str = WORST,
    specimens: Positive | None = None,
    noise: Mapping[str, float] | None = None,
    out: Path | str | None = None,
    overwrite: bool = False,
    progress: Listener = None,
) -> Plan:
    """Rank the tests that could be made next by the uncertainty of the moduli with each.
    To what the fit of the present tests reports the information of a candidate is added, from its
    derivatives at the law. card : the present optimum, or near it. tests : the present ones. strain
    : largest (warp, fill, shear) of the moduli; the card's valid range unless given. rank : "worst"
    for the least certain modulus, or "E1", "E2", "G12". specimens : of every candidate; the usual
    number of its kind unless given. noise : of measured values of a kind (mm, N), instead of that
    of the project's own tests. The other arguments and the errors are those of
    `profile`. InputError also : no candidates."""
    check_unused(out, False, overwrite)
    tell = listener(progress)
    check_one_of(rank, (WORST, *COMPONENTS), "--rank")
    known = {name: kind for name, kind in kinds().items() if isinstance(kind, Plannable)}
    for name, value in (noise or {}).items():
        if name not in known or not value > 0:
            problem = f"expected KIND=VALUE above 0, KIND of: {', '.join(known)}"
            raise InputError(None, "--noise", f"{problem}; got {name}={value:g}")
    material = card_of(project, card)
    found = find_optimum(project, material, tests)
    setup = found.setup
    law = found.best.law
    sure = found.sure
    make = setup.make_leading
    ends = _ends(material, found, strain)
    asked = Query(sure.fine or sure.posterior, law, ends)
    place = Place(project.path, "plan", project.fabric, project.scales, None, need_data=False)
    precision = precision_of(found)
    offered: list[tuple[str, Candidate]] = []
    for name, kind in known.items():
        own = [test for test in setup.tests if test.test.kind == name]
        given = (noise or {}).get(name)
        planning = Planning(place, own, precision, law, make, given)
        offered += [(name, candidate) for candidate in kind.candidates(planning)]
    ranked: list[tuple[Prospect, Array]] = []
    notes = [*found.notes, *other_thickness(material, project.fabric.thickness)]
    for done, (name, candidate) in enumerate(offered):
        tell(done, len(offered), candidate.name)
        count = candidate.specimens if specimens is None else specimens
        try:
            more, words, added = _added(candidate, found.problem.unknowns, law, make)
        except (SolverFailure, InputError) as error:
            said = f"left out, it cannot be computed: {str(error).splitlines()[0]}"
            notes.append(Note(FAILED, said, candidate.name))
            continue
        notes += added
        moduli = asked.moduli(count * more)
        ranked.append((Prospect(candidate.name, name, count, words, moduli), count * more))
    if not ranked:
        raise InputError(project.path, "", "no test could be made that a plan can compute")
    ranked.sort(key=lambda pair: pair[0].order(rank))
    first = ranked[0][1]
    after = [replace(test, moduli=asked.moduli(first + more)) for test, more in ranked]
    now = asked.moduli()
    made = Plan(
        project,
        card_words(card),
        [test.test.name for test in setup.tests],
        ends,
        rank,
        Prospect(NOW, "", 1, "", now),
        [test for test, _ in ranked],
        min(after, key=lambda test: test.order(rank)),
        notes,
    )
    return finished(made, out)


def _ends(card: MaterialCard, found: CardOptimum, given: Sequence[float] | None) -> Array:
    if given is not None:
        ends = np.array(given, dtype=float)
        if ends.shape != (3,) or not (ends > 0).all():
            problem = f"expected three strains above 0 (warp, fill, shear), got {given}"
            raise InputError(None, "--strain", problem)
        return ends
    own = card.law.strain_range
    limited = np.minimum(own, found.best.law.strain_range)
    return np.where(own < 0.1 * UNLIMITED, limited, found.best.reached)


def _added(
    candidate: Candidate, unknowns: Unknowns, law: HypoelasticLaw, make: MakeSolver
) -> tuple[Array, str, list[Note]]:
    """Return the information of a candidate, its noise in words, and notes on it."""
    notes: list[Note] = []
    whole = np.zeros((unknowns.size, unknowns.size))
    said = []
    for comparison in candidate.make().comparisons(make, Weighting()):
        more, history = information_of(comparison, law, unknowns)
        whole += more
        objective = comparison.objective
        size = round(np.mean(objective.sizes))
        said.append(f"{objective.least_noise:.3g} {objective.unit} at {size} values")
        words = "{} strain {} % is beyond {} %: the modulus is held there"
        own = notes_beyond(strains_of(history), law.strain_range, BEYOND_LAW, words)
        own += unstable_words(history.unstable) if comparison.must_be_stable else []
        notes += [note.about(candidate.name) for note in own]
    return whole, f"{'; '.join(said)} ({candidate.noise_is})", notes
