"""Which test next? What each test that could be made would say of the moduli."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import cast

import numpy as np

from ..errors import InputError, SolverFailure
from ..experiments.base import MakeSolver, Place
from ..experiments.candidates import Candidate, Plannable, Planning
from ..experiments.fittable import FittableTest, PreparedTest, Weighting
from ..experiments.notes import beyond, strains_of, unstable_words
from ..experiments.registry import kinds
from ..fits.project import Project
from ..fits.setup import FitSetup, prepare_fit
from ..identification.information import Array, Asked, information_of
from ..materials.card import MaterialCard
from ..materials.forms.base import COMPONENTS, UNLIMITED
from ..notes import Note, NoteKind
from .planned import NOW, WORST, Plan, Planned
from .present_tests import Present, present_tests
from .series import card_of, card_words, fitted_card, thickness_notes

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
    found: list[tuple[Planned, Array]] = []
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
) -> Array:
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
) -> tuple[Array, str, list[Note]]:
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
    asked: Asked, before: Array, found: Sequence[tuple[Planned, Array]], rank: str
) -> Planned | None:
    """The best test after the first; it may be the same again."""
    first = before + found[0][1]
    every = [replace(planned, sigma=asked.sigma(first + more)) for planned, more in found]
    return min(every, key=lambda planned: planned.value(rank), default=None)
