"""Which test next? What each test that could be made would say of the moduli."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, cast

import numpy as np
from numpy.typing import NDArray

from ..errors import InputError, SolverFailure
from ..experiments.kinds import (
    Candidate,
    FittableTest,
    MakeSolver,
    Place,
    Plannable,
    Planning,
    Precision,
    PreparedTest,
    Weighting,
    beyond,
    by_strain,
    strains_of,
    unstable_words,
)
from ..experiments.registry import kinds
from ..inference.linear import Array as Array_of_linear
from ..inference.linear import Asked, information, information_of, summary
from ..inference.noise import Noise
from ..inference.problem import Evaluation, FitProblem
from ..inference.search import evaluate_law, problem_at
from ..materials.card import MaterialCard
from ..materials.forms.base import COMPONENTS, UNLIMITED
from ..materials.law import HypoelasticLaw
from ..notes import Note, NoteKind, percent, rows
from ..notes import lines as note_lines
from ..project.project import Project
from .presenters import write_report
from .series import card_of, card_words, fitted_card, thickness_notes
from .setup import FitSetup, prepare_fit

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
        """Write all files and the page into a folder; raises OutputError."""
        write_report(self, folder)


@dataclass(frozen=True, eq=False)
class Present:
    """The project's own tests at the law of a card."""

    problem: FitProblem
    point: Evaluation
    law: HypoelasticLaw
    precision: Mapping[str, Precision]

    @property
    def reached(self) -> Array_of_linear:
        """(3,) largest strains."""
        return np.max([strains_of(history) for history in self.point.histories], axis=0)

    @property
    def information(self) -> Array_of_linear:
        """(n, n) of all comparisons."""
        unknowns, point = self.problem.unknowns, self.point
        assert point.jacobian is not None
        whole = np.zeros((unknowns.size, unknowns.size))
        for k, comparison in enumerate(self.problem.comparisons):
            rows, own = self.problem.rows(k), unknowns.nuisance_places(comparison.name)
            slopes = point.jacobian[rows] * self.problem.scale[rows, None]
            slopes = np.hstack([slopes[:, : unknowns.size], slopes[:, own]])
            told = self.precision[comparison.name]
            sigma = told.noise * np.sqrt(told.alike)
            whole += information(slopes, sigma, comparison.nuisance)
        return whole


def present_tests(setup: FitSetup, card: MaterialCard) -> Present:
    """Run the tests with a card, what is no law (offsets, the sheet's surface) fitted to them.

    Raises
    ------
    SolverFailure : they cannot be run with it.
    """
    law = _law(setup, card)
    make = setup.make_leading
    comparisons = tuple(
        comparison
        for test, weighting in zip(setup.tests, setup.weightings, strict=True)
        for comparison in test.comparisons(make, weighting)
    )
    problem, y = problem_at(law, comparisons)
    point = evaluate_law(problem, y, with_jacobian=True)
    if point is None:
        said = f"the present tests cannot be run with the card: {problem.failure}"
        raise SolverFailure(said, problem.solver.name)
    noise = Noise.of(problem, point.residual)
    precision = {
        c.name: Precision(
            noise.level[c.name], noise.alike[c.name], round(np.mean(c.objective.sizes))
        )
        for c in comparisons
    }
    return Present(problem, point, law, precision)


def _law(setup: FitSetup, card: MaterialCard) -> HypoelasticLaw:
    """The card's law over the strains of the project's, where both are of one form."""
    if card.law.form != setup.law.form:
        return card.law
    return replace(setup.law, beta=card.law.beta, nu12=card.law.nu12)


#: Told how many of how many analyses are done, and of what.
Progress = Callable[[int, int, str], None]


def plan(
    project: Project,
    card: MaterialCard | Path | str | None = None,
    tests: str | Sequence[str] | None = None,
    *,
    strain: Sequence[float] | None = None,
    rank: str = WORST,
    specimens: int | None = None,
    noise: Mapping[str, float] | None = None,
    progress: Progress | None = None,
) -> Plan:
    """What each test that could be made next would say of the moduli, best first.

    From the derivatives at a law: the information of the present tests (with their misfit or
    noise, whichever is larger, neighbours that err as one counted as one) and that of the candidate
    are added. Nothing is fitted but what is no law (offsets, the sheet's surface).

    Parameters
    ----------
    card : the present optimum, as itself, its file or its name; the one that the project's fit
        left in its usual folder unless given.
    tests : the present ones, by name or kind; every test that can be fitted unless given.
    strain : ends (warp, fill, shear) up to which moduli are asked for; the card's valid range
        unless given.
    rank : "worst" for the least certain modulus, or "E1", "E2", "G12".
    specimens : of every candidate; as the kind usually tests unless given.
    noise : of measured values of a kind (mm, N), instead of that of the project's own tests.

    Raises
    ------
    InputError : in the project or its data, no card, no candidates. SolverFailure : the present
        tests cannot be run with the card.
    """
    if rank not in (WORST, *COMPONENTS):
        expected = f"{WORST}, {', '.join(COMPONENTS)}"
        raise InputError(None, "--rank", f"expected one of {expected}, got {rank!r}")
    known = {name: kind for name, kind in kinds().items() if isinstance(kind, Plannable)}
    for name, value in (noise or {}).items():
        if name not in known or not value > 0:
            problem = f"expected KIND=VALUE above 0, KIND of: {', '.join(known)}"
            raise InputError(None, "--noise", f"{problem}; got {name}={value:g}")
    material = card_of(project, card if card is not None else fitted_card(project))
    chosen = cast(Sequence[FittableTest], project.chosen(tests, fitted=True))
    setup = prepare_fit(project, chosen)
    present = present_tests(setup, material)
    asked = Asked(present.problem.unknowns, present.law, present.point.unknowns,
                  _ends(project, material, present, strain))  # fmt: skip
    before = present.information
    make = setup.make_leading
    offered = {
        name: kind.candidates(
            Planning(
                _place(setup),
                _of_kind(setup, name),
                present.precision,
                present.law,
                make,
                (noise or {}).get(name),
            ),
        )
        for name, kind in known.items()
    }
    total = sum(map(len, offered.values()))
    found: list[tuple[Planned, Array_of_linear]] = []
    notes = thickness_notes(project, material)
    for done, (kind, candidate) in enumerate(_each(offered)):
        if progress is not None:
            progress(done, total, candidate.name)
        count = candidate.specimens if specimens is None else specimens
        try:
            more, words, told = _added(candidate, present, make)
        except (SolverFailure, InputError) as error:
            said = f"left out, it cannot be computed: {str(error).splitlines()[0]}"
            notes.append(Note(NoteKind.FAILED, said, candidate.name))
            continue
        notes += told
        sigma = asked.sigma(before + count * more)
        found.append((Planned(candidate.name, kind, count, words, sigma), count * more))
    if not found:
        raise InputError(project.path, "", "no test could be made that a plan can compute")
    found.sort(key=lambda pair: pair[0].value(rank))
    return Plan(
        project.title,
        project.path,
        "of the fit" if card is None else card_words(card),
        [test.name for test in chosen],
        asked.ends,
        rank,
        Planned(NOW, "", 1, "", asked.sigma(before)),
        [planned for planned, _ in found],
        _following(asked, before, found, rank),
        notes,
    )


def _ends(
    project: Project, card: MaterialCard, present: Present, given: Sequence[float] | None
) -> Array_of_linear:
    if given is not None:
        ends = np.array(given, dtype=float)
        if ends.shape != (3,) or not (ends > 0).all():
            problem = f"expected three strains above 0 (warp, fill, shear), got {given}"
            raise InputError(None, "--strain", problem)
        return ends
    own = card.law.strain_range
    return np.where(own < 0.1 * UNLIMITED, np.minimum(own, present.law.strain_range),
                    present.reached)  # fmt: skip


def _place(setup: FitSetup) -> Place:
    project = setup.project
    return Place(project.path, "plan", project.fabric, project.scales, None, need_data=False)


def _of_kind(setup: FitSetup, kind: str) -> list[PreparedTest]:
    return [test for test in setup.tests if test.test.kind == kind]


def _each(offered: Mapping[str, Sequence[Candidate]]) -> Iterator[tuple[str, Candidate]]:
    for kind, several in offered.items():
        for candidate in several:
            yield kind, candidate


def _added(
    candidate: Candidate, present: Present, make: MakeSolver
) -> tuple[Array_of_linear, str, list[Note]]:
    """What a candidate says of the law, its noise in words, and what to know of it."""
    unknowns, law, notes = present.problem.unknowns, present.law, []
    whole = np.zeros((unknowns.size, unknowns.size))
    said = []
    for comparison in candidate.make().comparisons(make, Weighting()):
        more, history = information_of(comparison, law, unknowns)
        whole += more
        objective = comparison.objective
        size = round(np.mean(objective.sizes))
        said.append(f"{objective.least_noise:.3g} {objective.unit} at {size} values")
        for strain, at, end in beyond(strains_of(history), law.strain_range):
            words = f"{strain} strain {at:.3f} is beyond {end:.3f}: the modulus is held there"
            notes.append(Note(NoteKind.BEYOND_LAW, words, candidate.name))
        if comparison.must_be_stable:
            notes += [note.about(candidate.name) for note in unstable_words(history.unstable)]
    return whole, f"{'; '.join(said)} ({candidate.noise_is})", notes


def _following(
    asked: Asked,
    before: Array_of_linear,
    found: Sequence[tuple[Planned, Array_of_linear]],
    rank: str,
) -> Planned | None:
    """The best test after the first; it may be the same again."""
    first = before + found[0][1]
    every = [replace(planned, sigma=asked.sigma(first + more)) for planned, more in found]
    return min(every, key=lambda planned: planned.value(rank), default=None)
