"""Planning of tests: candidates for the next test, ranked by the uncertainty they would leave."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from ..arguments import Positive, checked_arguments
from ..errors import InputError, SolverFailure, check_one_of
from ..experiments.base import Candidate, Plannable, Planning, Precision, Weighting
from ..experiments.forward import (
    BEYOND_LAW,
    by_strain,
    notes_beyond,
    other_thickness,
    strains_of,
    unstable_words,
)
from ..experiments.registry import kinds
from ..experiments.sections import Place
from ..inference.linear import information_of
from ..inference.nuisance import Nuisance
from ..inference.posterior import Posterior
from ..inference.reported import POINTS, UNKNOWN, ReportedModulus, reported_moduli, sigma_words
from ..lazy_modules import pandas as pd
from ..materials.card import MaterialCard
from ..materials.forms.base import COMPONENTS, UNLIMITED, Array
from ..materials.forms.symmetry import modulus_labels
from ..materials.law import HypoelasticLaw
from ..notes import Note, State, Verdict
from ..project.project import Project
from .folder import Presented, check_unused, finished
from .in_use import alone_in_folder
from .law_setup import shared_unknowns
from .optimum import CardOptimum, find_optimum
from .progress import Listener, listener
from .setup import with_shared
from .simulation import FAILED, card_of, card_words, check_has_law

#: The ranking by the least certain of the three moduli.
WORST = "worst"
ASSUMED = (
    "Assumed: the law at the optimum, and its form, are right; the present tests determine what "
    "their fit reports; values of a candidate err independently of each other but for neighbours "
    "that the fit counts as one, and agree with the law but for their noise; a candidate is "
    "made on a flat and taut sheet unless the project's own tests look for its shape."
)


@dataclass(frozen=True, eq=False)
class Prospect:
    """Hold the predicted uncertainty of the moduli with one more test.

    Attributes
    ----------
    name, kind : str
        Name and kind of the test; "now" and "" for the present tests alone.
    specimens : int
        Number of specimens that are tested.
    noise : str
        Noise of the measured values, in words.
    moduli : mapping of str to ReportedModulus
        Each modulus as a fit with this test would report it.
    """

    name: str
    kind: str
    specimens: int
    noise: str
    moduli: Mapping[str, ReportedModulus]

    @property
    def title(self) -> str:
        """Return the name of the test, with the number of specimens if there are several."""
        return self.name if self.specimens == 1 else f"{self.name}, {self.specimens} specimens"

    @property
    def summary(self) -> dict[str, float]:
        """Return the root mean square of relative sigma along the strain, by modulus."""
        return {name: modulus.rms_sigma for name, modulus in self.moduli.items()}

    @property
    def words(self) -> dict[str, str]:
        """Return `summary` in words, not determined where most of the strains are not."""
        return {
            name: sigma_words(modulus.rms_sigma, modulus.numbers["not_determined"] > 0.5)
            for name, modulus in self.moduli.items()
        }

    def value(self, rank: str) -> float:
        """Return the uncertainty by which tests are ranked; smaller is better."""
        return max(self.summary.values()) if rank == WORST else self.summary[rank]

    def order(self, rank: str) -> tuple[float, float]:
        """Return the sorting key: `value` as shown, then the sum over all moduli."""
        return float(f"{self.value(rank):.2g}"), sum(self.summary.values())

    @property
    def row(self) -> dict[str, Any]:
        """Return the test as plain values, without its uncertainties."""
        return {
            "test": self.name,
            "kind": self.kind,
            "specimens": self.specimens,
            "noise": self.noise,
        }


@dataclass(frozen=True, eq=False)
class Plan(Presented):
    """Hold the tests that could be made next, best first.

    Attributes
    ----------
    project : Project
    card : str
        Name of the card.
    tests : sequence of str
        Names of the present tests.
    ends : (3,) array
        Largest strains (eps1, eps2, gamma12) of the moduli.
    rank : str
        "worst", or a modulus.
    present : Prospect
        The uncertainty with the present tests alone.
    candidates : sequence of Prospect
        The uncertainty with one more test, for each candidate, best first.
    fit_verdict : Verdict
        The verdict of the fit to the present tests.
    following : Prospect or None
        The best second test once the first of `candidates` has been made.
    notes : sequence of Note
    """

    project: Project
    card: str
    tests: Sequence[str]
    ends: Array
    rank: str
    present: Prospect
    candidates: Sequence[Prospect]
    fit_verdict: Verdict
    following: Prospect | None = None
    notes: Sequence[Note] = ()

    @property
    def criterion(self) -> str:
        """Return the quantity that candidates are ranked by, in words."""
        modulus = "the least certain modulus" if self.rank == WORST else self.rank
        return f"1 sigma of {modulus}, root of the mean square along its strain"

    @property
    def strains(self) -> dict[str, Array]:
        """Return, by modulus, the three strains at which its uncertainty is listed."""
        shares = np.array([0.0, 0.5, 1.0])
        return {name: shares * m.strain[-1] for name, m in self.present.moduli.items()}

    def sigma_at_strains(self, prospect: Prospect) -> dict[str, Array]:
        """Return 1-sigma relative uncertainties by modulus at the listed strains."""
        return {
            name: np.interp(strain, modulus.strain, modulus.sigma)
            for (name, modulus), strain in zip(
                prospect.moduli.items(), self.strains.values(), strict=True
            )
        }

    def table(self) -> pd.DataFrame:
        """Return the tests, ranked.

        Returns
        -------
        DataFrame
            One row per test: `rank` (0 for the present tests), `test`, `kind`, `specimens`,
            `noise`; the relative 1 sigma of each modulus as root mean square along its strain
            (`sigma_E1`), and at the listed strains (`sigma_E1_at_0.05`).
        """
        table = []
        for rank, prospect in enumerate((self.present, *self.candidates)):
            row = {"rank": rank, **prospect.row}
            for name, sigma in prospect.summary.items():
                row[f"sigma_{name}"] = sigma
            for name, sigmas in self.sigma_at_strains(prospect).items():
                for strain, sigma in zip(self.strains[name], sigmas, strict=True):
                    row[f"sigma_{name}_at_{strain:.4g}"] = sigma
            table.append(row)
        return pd.DataFrame(table)

    @property
    def verdict(self) -> Verdict:
        """Return which test would leave the least uncertainty, and what it would not determine."""
        best = self.candidates[0]
        sigmas = [f"{name} {words}" for name, words in best.words.items() if words != UNKNOWN]
        unknown = [name for name, words in best.words.items() if words == UNKNOWN]
        verdict = Verdict(
            "usable within limits" if unknown else "usable",
            f"the best next test is {best.title}: it would leave {', '.join(sigmas) or 'nothing'}"
            " (1 sigma)",
            unknown=f"{', '.join(unknown)} even with that test" if unknown else "",
            next_step="make that test, add it to the project and fit again",
        )
        # A further test may be what makes the fit usable.
        of_study = verdict.of_study(self.fit_verdict)
        state: State = "usable within limits" if of_study.reasons else verdict.state
        return replace(of_study, state=state, next_step=verdict.next_step)

    @property
    def numbers(self) -> dict[str, Any]:
        """Return the numbers of the study."""
        return {
            "command": "plan",
            "title": self.project.title,
            "project": str(self.project.path),
            "card": self.card,
            "tests": self.tests,
            "criterion": self.criterion,
            "strains": self.strains,
            "up_to_strain": by_strain(self.ends),
            "now": self._numbers(self.present),
            "candidates": [self._numbers(prospect) for prospect in self.candidates],
            "following": None if self.following is None else self._numbers(self.following),
            "assumed": ASSUMED,
        }

    def _numbers(self, prospect: Prospect) -> dict[str, Any]:
        """Return a test and its sigma as plain values."""
        return {
            **prospect.row,
            "sigma": prospect.summary,
            "sigma_at": self.sigma_at_strains(prospect),
            "unknown": [name for name, words in prospect.words.items() if words == UNKNOWN],
        }

    def result_lines(self) -> list[str]:
        """Return the results of the study as lines of the terminal."""
        prospects = (self.present, *self.candidates)
        width = max(len(prospect.title) for prospect in prospects) + 2
        head = "".join(f"{name:>10}" for name in self.present.moduli)
        lines = [
            "1 sigma of the moduli up to strains of "
            f"{', '.join(f'{100 * e:.3g}' for e in self.ends)} % (warp, fill, shear),",
            f"with one more test beside {', '.join(self.tests) or 'none'}",
            f"{'':4}{'test':<{width}}{head}   noise",
        ]
        for rank, prospect in enumerate(prospects):
            mark = f"{rank:>2}. " if rank else "    "
            numbers = "".join(f"{words:>10}" for words in prospect.words.values())
            lines.append(f"{mark}{prospect.title:<{width}}{numbers}   {prospect.noise}".rstrip())
        lines.append(f"ranked by {self.criterion}")
        if self.following is not None:
            numbers = ", ".join(f"{name} {words}" for name, words in self.following.words.items())
            lines.append(f"after the first, {self.following.title} would give {numbers}")
        return [*lines, ASSUMED]


@dataclass(frozen=True, eq=False)
class Query:
    """Hold what a plan asks for: the moduli of a law up to given strains.

    Attributes
    ----------
    posterior : Posterior
        Distribution of the unknowns given the present tests.
    law : HypoelasticLaw
        The present law.
    ends : (3,) array
        Largest strains of the moduli.
    """

    posterior: Posterior
    law: HypoelasticLaw
    ends: Array

    def moduli(self, information: Array | None = None) -> dict[str, ReportedModulus]:
        """Return the moduli by label, as reported with further information."""
        posterior = self.posterior
        if information is not None:
            posterior = posterior.with_information(information)
        strains = {name: np.linspace(0.0, self.ends[c], POINTS) for name, c in COMPONENTS.items()}
        moduli = reported_moduli(posterior, self.law, strains)
        return {label: moduli[name] for name, label in modulus_labels(self.law.form).items()}


def precision_of(optimum: CardOptimum) -> dict[str, Precision]:
    """Return the noise of the values of each present comparison, as the fit counts it."""
    noise = optimum.certainty.noise
    return {
        c.name: Precision(
            noise.level[c.name], noise.correlated_count[c.name], round(np.mean(c.objective.sizes))
        )
        for c in optimum.problem.comparisons
    }


@checked_arguments
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

    The information matrix of a candidate, which follows from the derivatives of its values at the
    present law, is added to that of the fit to the present tests.

    Parameters
    ----------
    project : Project
    card : MaterialCard, path or str, optional
        The card of the present fit, as in `profile`.
    tests : str or sequence of str, optional
        Names of the present tests, or a kind of test; by default all that can be fitted.
    strain : sequence of 3 floats, optional
        Largest (warp, fill, shear) strain of the moduli; by default the card's valid range.
    rank : str
        "worst" for the least certain modulus, or "E1", "E2", "G12"; "E" of an isotropic law.
    specimens : int, optional
        Number of specimens of every candidate; by default the usual number of its kind.
    noise : mapping of str to float, optional
        Noise of the measured values of a kind (mm, N), instead of that of the project's tests.
    out, overwrite, progress
        As in `profile`.

    Returns
    -------
    Plan

    Raises
    ------
    InputError, OutputError, SolverFailure
        As in `profile`; also if no candidate can be computed.
    """
    check_unused(out, False, overwrite)
    plannable = {name: kind for name, kind in kinds().items() if isinstance(kind, Plannable)}
    noise = noise or {}
    _check_noise(noise, plannable)
    check_has_law(project)
    material = card_of(project, card)
    optimum = find_optimum(project, material, tests)
    check_one_of(rank, (WORST, *modulus_labels(optimum.best.law.form).values()), "--rank")
    ends = _ends(material, optimum, strain)
    query = Query(
        optimum.certainty.corrected or optimum.certainty.posterior, optimum.best.law, ends
    )
    notes = [*optimum.notes, *other_thickness(material, project.fabric.thickness)]
    notes += notes_beyond(ends, material.law.strain_range)
    offers = _offers(project, optimum, plannable, noise)
    additions = _additions(optimum, offers, specimens, notes, listener(progress))
    if not additions:
        raise InputError(project.path, "", "no test could be made that a plan can compute")
    additions = [addition.with_moduli(query) for addition in additions]
    additions.sort(key=lambda addition: addition.prospect.order(rank))
    first = additions[0].information
    following = [addition.with_moduli(query, first).prospect for addition in additions]
    result = Plan(
        project=project,
        card=card_words(card),
        tests=optimum.setup.test_names,
        ends=ends,
        rank=rank,
        present=Prospect("now", "", 1, "", query.moduli()),
        candidates=[addition.prospect for addition in additions],
        following=min(following, key=lambda prospect: prospect.order(rank)),
        fit_verdict=optimum.fit_verdict,
        notes=notes,
    )
    return finished(result, out)


def _check_noise(noise: Mapping[str, float], plannable: Mapping[str, Plannable]) -> None:
    """Raise InputError for a noise that is not positive, or of a kind that cannot be planned."""
    for name, value in noise.items():
        if name not in plannable or not 0 < value < math.inf:
            problem = f"expected KIND=VALUE above 0, KIND of: {', '.join(plannable)}"
            raise InputError(None, "--noise", f"{problem}; got {name}={value:g}")


def _ends(card: MaterialCard, optimum: CardOptimum, strain: Sequence[float] | None) -> Array:
    """Return the largest strains (3,) of the moduli: the user's, or the card's valid range."""
    if strain is not None:
        ends = np.array(strain, dtype=float)
        if ends.shape != (3,) or not ((ends > 0) & (ends < 2)).all():
            problem = "expected three strains between 0 and 2 (warp, fill, shear), not in percent"
            raise InputError(None, "--strain", f"{problem}; got {strain}")
        return ends
    valid = card.law.strain_range
    limited = np.minimum(valid, optimum.best.law.strain_range)
    # A form without strain holds at any: its moduli are asked for where tests strained the fabric.
    return np.where(valid < 0.1 * UNLIMITED, limited, optimum.best.reached)


def _offers(
    project: Project,
    optimum: CardOptimum,
    plannable: Mapping[str, Plannable],
    noise: Mapping[str, float],
) -> list[tuple[str, Candidate]]:
    """Return the candidates of every kind of test, with the name of their kind."""
    place = Place(project.path, "plan", project.fabric, project.scales, None, need_data=False)
    precision = precision_of(optimum)
    setup = optimum.setup
    offers = []
    for name, kind in plannable.items():
        present = [prepared for prepared in setup.tests if prepared.test.kind == name]
        planning = Planning(
            place, present, precision, optimum.best.law, setup.make_leading, noise.get(name)
        )
        offers += [(name, candidate) for candidate in kind.candidates(planning)]
    return offers


@dataclass(frozen=True, eq=False)
class Addition:
    """A candidate test, with the information matrix of all its specimens, see `information_of`."""

    prospect: Prospect
    information: Array

    def with_moduli(self, query: Query, information: Array | float = 0.0) -> Addition:
        """Return the candidate with the moduli as reported with it and with `information`."""
        moduli = query.moduli(information + self.information)
        return replace(self, prospect=replace(self.prospect, moduli=moduli))


def _additions(
    optimum: CardOptimum,
    offers: Sequence[tuple[str, Candidate]],
    specimens: int | None,
    notes: list[Note],
    on_event: Callable[[int, int, str], None],
) -> list[Addition]:
    """Return the candidates that can be computed; add notes on all others to `notes`."""
    additions = []
    shared = shared_unknowns(optimum.setup.project)
    for number, (kind, candidate) in enumerate(offers):
        on_event(number, len(offers), candidate.name)
        count = candidate.specimens if specimens is None else specimens
        try:
            information, noise, candidate_notes = _information(candidate, optimum, shared)
        except (SolverFailure, InputError) as error:
            words = f"left out, it cannot be computed: {str(error).splitlines()[0]}"
            notes.append(Note(FAILED, words, candidate.name))
            continue
        notes += candidate_notes
        prospect = Prospect(candidate.name, kind, count, noise, {})
        additions.append(Addition(prospect, count * information))
    return additions


def _information(
    candidate: Candidate, optimum: CardOptimum, shared: Sequence[Nuisance]
) -> tuple[Array, str, list[Note]]:
    """Return the information matrix of one specimen, its noise in words, and notes.

    `shared` are the unknowns of all tests, of which a candidate is one more.
    """
    notes = []
    noises = []
    law = optimum.best.law
    matrices = []
    comparisons = candidate.make().comparisons(optimum.setup.make_leading, Weighting())
    for comparison in with_shared(comparisons, shared):
        matrix, history = information_of(
            comparison, law, optimum.problem.unknowns, optimum.best.point.unknowns
        )
        matrices.append(matrix)
        objective = comparison.objective
        count = round(np.mean(objective.sizes))
        noises.append(f"{objective.least_noise:.3g} {objective.unit} at {count} values")
        words = "{} strain {} % is beyond {} %: the modulus is held there"
        remarks = notes_beyond(strains_of(history), law.strain_range, BEYOND_LAW, words)
        if comparison.must_be_stable:
            remarks += unstable_words(history.unstable)
        notes += [note.about(candidate.name) for note in remarks]
    return np.sum(matrices, axis=0), f"{'; '.join(noises)} ({candidate.noise_is})", notes
