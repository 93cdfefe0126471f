"""Rank tests that could be made next by the predicted uncertainty of the moduli."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from ..errors import InputError, Note, Positive, SolverFailure, check_one_of, checked, percent, rows
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
from ..inference.linear import Array, LawQuery, information, information_of, summary
from ..inference.noise import Noise
from ..inference.problem import Evaluation, FitProblem
from ..inference.search import evaluate_law, problem_at
from ..materials.card import MaterialCard
from ..materials.forms.base import COMPONENTS, UNLIMITED
from ..materials.law import HypoelasticLaw
from ..project.project import Project
from .folder import Presented, check_unused, finished
from .in_use import alone_in_folder
from .progress import Listener, listener
from .setup import FitSetup, prepare_fit
from .simulation import FAILED, card_of, card_words

#: 1 sigma, relative, from which a modulus is called unknown.
UNKNOWN = 1.0
#: Shares of the largest strains at which moduli are listed.
SHARES = (0.0, 0.5, 1.0)
#: Rank by the least certain of the three moduli.
WORST = "worst"
#: Name of the row of the present tests.
NOW = "now"
ASSUMED = (
    "Assumed: the law at the card, and its form, are right; values err independently of each other "
    "but for neighbours that the fit of the present tests counts as one; every value counts by its "
    "noise, not by a weight of the objective; the error of the mesh is in no sigma; a candidate is "
    "made on a flat and taut sheet unless the project's own tests look for its shape."
)


def words(sigma: float) -> str:
    """Return a relative uncertainty as percent, or "unknown"."""
    return percent(sigma) if sigma < UNKNOWN else "unknown"


@dataclass(frozen=True, eq=False)
class Prospect:
    """The predicted uncertainty of the moduli with one more test.
    name, kind : of the test; NOW and "" for the present tests alone. noise : of its values, in
    words. sigma : by modulus, 1-sigma relative uncertainty (n,) along its strain."""

    name: str
    kind: str
    specimens: int
    noise: str
    sigma: Mapping[str, Array]

    @property
    def title(self) -> str:
        return self.name if self.specimens == 1 else f"{self.name}, {self.specimens} specimens"

    @property
    def summary(self) -> dict[str, float]:
        """Return the root mean square of sigma along the strain, by modulus."""
        return summary(self.sigma)

    def value(self, rank: str) -> float:
        """Return the number that tests are ranked by: the smaller the better."""
        return max(self.summary.values()) if rank == WORST else self.summary[rank]

    @property
    def row(self) -> dict[str, Any]:
        return {"test": self.name, "kind": self.kind, "specimens": self.specimens,
                "noise": self.noise}  # fmt: skip


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
        found = {}
        for name, strain in self.strains.items():
            along = np.linspace(0.0, strain[-1], len(test.sigma[name]))
            found[name] = np.interp(strain, along, test.sigma[name]).tolist()
        return found

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
            "command": "plan", "title": self.project.title,
            "project": str(self.project.path), "card": self.card,
            "tests": list(self.tests), "criterion": self.criterion,
            "strains": {name: at.tolist() for name, at in self.strains.items()},
            "up_to_strain": by_strain(self.ends), "now": self._numbers(self.now),
            "candidates": [self._numbers(test) for test in self.candidates],
            "following": None if self.following is None else self._numbers(self.following),
            "assumed": ASSUMED, "notes": rows(self.notes),
        }  # fmt: skip

    def _numbers(self, test: Prospect) -> dict[str, Any]:
        return {
            **test.row, "sigma": test.summary, "sigma_at": self.at(test),
            "unknown": [name for name, value in test.summary.items() if value >= UNKNOWN],
        }  # fmt: skip

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
            numbers = "".join(f"{words(test.summary[name]):>10}" for name in COMPONENTS)
            lines.append(f"{mark}{test.title:<{wide}}{numbers}   {test.noise}".rstrip())
        lines.append(f"ranked by {self.criterion}")
        if self.following is not None:
            numbers = ", ".join(f"{n} {words(s)}" for n, s in self.following.summary.items())
            lines.append(f"after the first, {self.following.title} would give {numbers}")
        return [*lines, ASSUMED, *note_lines(self.notes)]


@dataclass(frozen=True, eq=False)
class Present:
    """The project's own tests at the law of a card."""

    problem: FitProblem
    point: Evaluation
    law: HypoelasticLaw
    precision: Mapping[str, Precision]

    @property
    def information(self) -> Array:
        """Return the Fisher information of all comparisons, (n, n)."""
        unknowns, point = self.problem.unknowns, self.point
        assert point.jacobian is not None
        whole = np.zeros((unknowns.size, unknowns.size))
        for k, comparison in enumerate(self.problem.comparisons):
            rows, own = self.problem.rows(k), unknowns.nuisance_places(comparison.name)
            slopes = point.jacobian[rows] * self.problem.scale[rows, None]
            slopes = np.hstack([slopes[:, : unknowns.size], slopes[:, own]])
            own_noise = self.precision[comparison.name]
            sigma = own_noise.noise * np.sqrt(own_noise.alike)
            whole += information(slopes, sigma, comparison.nuisance)
        return whole


def present_tests(setup: FitSetup, card: MaterialCard) -> Present:
    """Run the tests with a card, offsets and surface fitted; raises SolverFailure."""
    law = card.law
    if law.form == setup.law.form:
        law = replace(setup.law, beta=law.beta, nu12=law.nu12)
    weighted = zip(setup.tests, setup.weightings, strict=True)
    comparisons = tuple(c for t, w in weighted for c in t.comparisons(setup.make_leading, w))
    problem, y = problem_at(law, comparisons)
    point = evaluate_law(problem, y, with_jacobian=True)
    if point is None:
        said = f"the present tests cannot be run with the card: {problem.failure}"
        raise SolverFailure(said, problem.solver.name)
    noise = Noise.from_residual(problem, point.residual)
    precision = {
        c.name: Precision(
            noise.level[c.name], noise.correlated_count[c.name], round(np.mean(c.objective.sizes))
        )
        for c in comparisons
    }
    return Present(problem, point, law, precision)


@checked
@alone_in_folder
def plan(
    project: Project, card: MaterialCard | Path | str | None = None,
    tests: str | Sequence[str] | None = None, *, strain: Sequence[float] | None = None,
    rank: str = WORST, specimens: Positive | None = None, noise: Mapping[str, float] | None = None,
    out: Path | str | None = None, overwrite: bool = False,
    progress: Listener = None,
) -> Plan:  # fmt: skip
    """Rank the tests that could be made next by the uncertainty of the moduli with each.
    The information of the present tests (misfit or noise, whichever is larger; neighbours that err
    as one counted as one) and that of the candidate, from the derivatives at a law, are added.
    Nothing is fitted but offsets and the sheet's surface. card : the present optimum. tests : the
    present ones. strain : largest (warp, fill, shear) of the moduli; the card's valid range unless
    given. rank : "worst" for the least certain modulus, or "E1", "E2", "G12". specimens : of every
    candidate; the usual number of its kind unless given. noise : of measured values of a kind (mm,
    N), instead of that of the project's own tests. The other arguments and the errors are those of
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
    chosen = project.chosen(tests, fitted=True)
    setup = prepare_fit(project, chosen)
    present = present_tests(setup, material)
    asked = LawQuery(present.problem.unknowns, present.law, present.point.unknowns,
                  _ends(project, material, present, strain))  # fmt: skip
    before = present.information
    make = setup.make_leading
    place = Place(project.path, "plan", project.fabric, project.scales, None, need_data=False)
    offered: list[tuple[str, Candidate]] = []
    for name, kind in known.items():
        own = [test for test in setup.tests if test.test.kind == name]
        given = (noise or {}).get(name)
        planning = Planning(place, own, present.precision, present.law, make, given)
        offered += [(name, candidate) for candidate in kind.candidates(planning)]
    found: list[tuple[Prospect, Array]] = []
    notes = other_thickness(material, project.fabric.thickness)
    for done, (name, candidate) in enumerate(offered):
        tell(done, len(offered), candidate.name)
        count = candidate.specimens if specimens is None else specimens
        try:
            more, words, added = _added(candidate, present, make)
        except (SolverFailure, InputError) as error:
            said = f"left out, it cannot be computed: {str(error).splitlines()[0]}"
            notes.append(Note(FAILED, said, candidate.name))
            continue
        notes += added
        sigma = asked.sigma(before + count * more)
        found.append((Prospect(candidate.name, name, count, words, sigma), count * more))
    if not found:
        raise InputError(project.path, "", "no test could be made that a plan can compute")
    found.sort(key=lambda pair: pair[0].value(rank))
    first = before + found[0][1]
    after = [replace(test, sigma=asked.sigma(first + more)) for test, more in found]
    made = Plan(
        project, card_words(card),
        [test.name for test in chosen], asked.ends, rank,
        Prospect(NOW, "", 1, "", asked.sigma(before)), [test for test, _ in found],
        min(after, key=lambda test: test.value(rank)), notes,
    )  # fmt: skip
    return finished(made, out)


def _ends(
    project: Project, card: MaterialCard, present: Present, given: Sequence[float] | None
) -> Array:
    if given is not None:
        ends = np.array(given, dtype=float)
        if ends.shape != (3,) or not (ends > 0).all():
            problem = f"expected three strains above 0 (warp, fill, shear), got {given}"
            raise InputError(None, "--strain", problem)
        return ends
    own = card.law.strain_range
    reached = np.max([strains_of(history) for history in present.point.histories], axis=0)
    return np.where(own < 0.1 * UNLIMITED, np.minimum(own, present.law.strain_range), reached)


def _added(
    candidate: Candidate, present: Present, make: MakeSolver
) -> tuple[Array, str, list[Note]]:
    """Return the information of a candidate, its noise in words, and notes on it."""
    unknowns, law, notes = present.problem.unknowns, present.law, []
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
