"""Vary Poisson's ratio nu12 in the analyses of a project, with the moduli as they are."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..errors import InputError, Note, SolverFailure, rows
from ..errors import lines as note_lines
from ..experiments.kinds import notes_of, other_thickness
from ..files import known
from ..files import pandas as pd
from ..project.project import Project
from .folder import Presented, check_unused, finished
from .progress import Listener
from .simulation import (
    FAILED,
    Analyses,
    GivenCard,
    Part,
    attempt,
    card_of,
    card_words,
    parts_of,
    studied_tests,
)

Array = NDArray[np.float64]
#: The range of coated fabrics, in equal steps.
NU12 = (0.05, 0.15, 0.25, 0.35, 0.45)


@dataclass(frozen=True, eq=False)
class Ratios:
    """A response at several nu12, (n,) each: itself, over that at the base nu12, over the mean."""

    nu12: Array
    value: Array
    to_base: Array
    to_mean: Array

    @property
    def spread(self) -> tuple[float, float]:
        """Return the lowest and highest `to_base`, less one; NaN where no run ended."""
        known = self.to_base[np.isfinite(self.to_base)]
        return (float(known.min() - 1), float(known.max() - 1)) if len(known) else (np.nan, np.nan)


def ratios(nu12: Sequence[float], values: ArrayLike, base: float) -> Ratios:
    """Return a response (n,) and its ratios; NaN where a run failed, left out of the mean."""
    v = np.asarray(values, dtype=float)
    mean = float(np.mean(v[np.isfinite(v)])) if np.isfinite(v).any() else np.nan
    return Ratios(np.asarray(nu12, dtype=float), v, v / base, v / mean)


@dataclass(frozen=True, eq=False)
class PartRatios:
    """One part of a test; response : name of their kind; failed : why a run failed, by nu12."""

    response: str
    responses: Mapping[str, Ratios]
    failed: Mapping[str, str]
    notes: Sequence[Note]


@dataclass(frozen=True, eq=False)
class Nu12Study(Presented):
    """The result of a study of nu12, by part of a test. base : the card's own nu12."""

    project: Project
    card: str
    solver: str
    base: float
    parts: Mapping[str, PartRatios]
    warnings: tuple[Note, ...] = ()

    @property
    def response(self) -> str:
        """Return the names of the kinds of responses, of all parts."""
        return " or ".join(dict.fromkeys(part.response for part in self.parts.values()))

    @property
    def result(self) -> dict[str, Any]:
        return known({
            "command": "study nu12", "project": str(self.project.path),
            "card": self.card,
            "solver": self.solver, "base_nu12": self.base, "response": self.response,
            "models": {
                name: {
                    "responses": {
                        response: {key: own.tolist() for key, own in vars(r).items()}
                        for response, r in part.responses.items()
                    },
                    "failed": dict(part.failed),
                }
                for name, part in self.parts.items()
            },
            "notes": rows(self.notes),
        })  # fmt: skip

    def table(self) -> pd.DataFrame:
        """Return columns model, response, nu12, value, to_base, to_mean."""
        frames = [
            pd.DataFrame({"model": name, "response": response, **vars(r)})
            for name, part in self.parts.items()
            for response, r in part.responses.items()
        ]
        return pd.concat(frames, ignore_index=True)

    def lines(self) -> list[str]:
        words = [f"{self.response}, relative to that at nu12 = {self.base:g}"]
        named = {
            f"{n}, {k}": r for n, part in self.parts.items() for k, r in part.responses.items()
        }
        wide = max(map(len, named))
        first = next(iter(named.values()))
        words.append(" " * wide + "".join(f"{f'{v:g}':>9}" for v in first.nu12) + "   spread")
        for name, r in named.items():
            numbers = "".join(f"{v:9.4f}" for v in r.to_base)
            low, high = (100 * s for s in r.spread)
            words.append(f"{name:<{wide}}{numbers}   {low:+.1f} to {high:+.1f} %")
        return [*words, *note_lines(self.notes)]

    @property
    def notes(self) -> list[Note]:
        of_parts = [n.about(name) for name, part in self.parts.items() for n in part.notes]
        return [*of_parts, *self.warnings]


def vary_nu12(
    project: Project, card: GivenCard | None = None, values: Sequence[float] = NU12,
    tests: str | Sequence[str] | None = None, *, out: Path | str | None = None,
    resume: bool = False, overwrite: bool = False, progress: Listener = None,
) -> Nu12Study:  # fmt: skip
    """Run tests with a card whose nu12 is changed; arguments and errors as of `refine`."""
    check_unused(out, resume, overwrite)
    for value in values:
        if not 0 <= value < 1:
            raise InputError(None, "--nu12", f"expected 0 <= nu12 < 1, got {value:g}")
    material, several = card_of(project, card), tuple(sorted(set(values)))
    analyses, base = Analyses(project, progress, out, resume), material.law.nu12
    parts = parts_of(project, studied_tests(project, tests), material.thickness)
    analyses.total = len(parts) * (1 + len(several))

    def run(part: Part) -> PartRatios:
        """Run a part at every value; raises SolverFailure where its own, or all, fail."""
        responses: dict[float | None, Mapping[str, float]] = {}
        failed, notes = {}, []
        for value in (None, *several):
            nu12 = base if value is None else value
            law = replace(material.law, nu12=nu12)
            history = attempt(analyses.run, part.name, part.model, law, part.increments)
            if isinstance(history, SolverFailure):
                failed[f"{nu12:g}"] = history.reason
                if value is None or len(failed) == len(several):
                    raise history
                own = [Note(FAILED, history.reason)]
            else:
                responses[value] = part.studied.responses(part.model, history)
                own = notes_of(history, material)
            notes += [note.about(f"nu12 = {nu12:g}") for note in own]
        every = [responses.get(value, {}) for value in several]
        found = {
            name: ratios(several, [own.get(name, np.nan) for own in every], at_base)
            for name, at_base in responses[None].items()
        }
        return PartRatios(part.studied.response, found, failed, notes)

    study = Nu12Study(
        project, card_words(card), analyses.solver.name, base,
        {name: run(part) for name, part in parts.items()},
        tuple(other_thickness(material, project.fabric.thickness)),
    )  # fmt: skip
    return finished(study, out)
