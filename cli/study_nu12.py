"""`bubblefit study nu12`: how much the response depends on Poisson's ratio (Fig. 4.2)."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import click
import numpy as np

from ..errors import InputError, SolverFailure
from ..reports import plot_nu12
from ..solvers.base import History
from ..studies.poisson import NU12, Ratios, by_response
from ..studies.refinement import Level
from ..studies.results import UNSTABLE
from .progress import run_progress
from .study_kinds import levels
from .study_options import Study, card_options, finish

HEADER = ("model", "response", "nu12", "value", "to_base", "to_mean")
ByModel = Mapping[str, Mapping[str, Ratios]]


@click.command("nu12")
@card_options
@click.option(
    "--nu12", "given", type=float, multiple=True,
    help="A value to run, as often as wanted [0.05 0.15 0.25 0.35 0.45].",
)  # fmt: skip
def study_nu12(open_study: Callable[[str], Study], given: tuple[float, ...], as_json: bool) -> None:
    """Run PROJECT.toml with a card whose Poisson's ratio is changed, the moduli as they are.

    Reports every response relative to that at the card's own nu12 and, as Fig. 4.2 does, relative
    to the mean of the values. A value whose analysis fails is named and left out; when the card's
    own fails, or all others do, the exit code is 4.
    """
    values = tuple(sorted(set(given))) or NU12
    for value in values:
        if not 0 <= value < 1:
            raise InputError(None, "--nu12", f"expected 0 <= nu12 < 1, got {value:g}")
    study = open_study("nu12")
    found = _run(study, values, as_json)
    ratios = {name: model.responses for name, model in found.items()}
    finish(
        study,
        "nu12",
        HEADER,
        _rows(ratios),
        lambda path: plot_nu12(
            path,
            _panels(ratios),
            study.card.law.nu12,
            study.kind.response,
            study.kind.published,
        ),
        _result(study, found),
        _lines(study, found),
        as_json,
    )


@dataclass(frozen=True, eq=False)
class ModelFound:
    """One model: ratios by response, why a run failed by nu12, what to know of the base run."""

    responses: Mapping[str, Ratios]
    failed: Mapping[str, str]
    warnings: Sequence[str]


def _run(study: Study, values: Sequence[float], quiet: bool) -> dict[str, ModelFound]:
    """Every value on every model.

    Raises
    ------
    SolverFailure : of the card as it is, or of all other values.
    """
    planned = levels(study.kind, study.project, "elements", 1.0, study.card.thickness)
    return {name: _run_model(study, level, values, quiet) for name, level in planned.items()}


def _run_model(study: Study, level: Level, values: Sequence[float], quiet: bool) -> ModelFound:
    def run(nu12: float) -> History:
        with run_progress(study.solver, level.increments, quiet):
            return study.solver.run(level.model, replace(study.card.law, nu12=nu12))

    base = run(study.card.law.nu12)
    warnings, failed = study.notes(base), {}
    responses: list[Mapping[str, float] | None] = []
    for value in values:
        try:
            history = run(value)
        except SolverFailure as failure:
            responses.append(None)
            failed[f"{value:g}"] = failure.reason
            if len(failed) == len(values):
                raise
            continue
        responses.append(study.kind.responses(level.model, history))
        # Strains beyond the card's range are those of the base run, more or less.
        if history.stable is False:
            warnings.append(f"nu12 = {value:g}: {UNSTABLE}")
    own = study.kind.responses(level.model, base)
    return ModelFound(by_response(values, responses, own), failed, warnings)


def _result(study: Study, found: Mapping[str, ModelFound]) -> dict[str, Any]:
    return {
        "command": "study nu12",
        "project": str(study.project.path),
        "card": study.card_path,
        "solver": study.solver.name,
        "base_nu12": study.card.law.nu12,
        "response": study.kind.response,
        "models": {
            name: {
                "responses": {
                    response: {
                        "nu12": r.nu12.tolist(),
                        "value": _known(r.values),
                        "to_base": _known(r.to_base),
                        "to_mean": _known(r.to_mean),
                    }
                    for response, r in model.responses.items()
                },
                "failed": dict(model.failed),
                "warnings": list(model.warnings),
            }
            for name, model in found.items()
        },
    }


def _known(values: np.ndarray) -> list[float | None]:
    """Numbers for JSON, which has no NaN."""
    return [float(v) if np.isfinite(v) else None for v in values]


def _rows(found: ByModel) -> list[list[object]]:
    return [
        [name, response, *(float(v) for v in row)]
        for name, responses in found.items()
        for response, r in responses.items()
        for row in zip(r.nu12, r.values, r.to_base, r.to_mean, strict=True)
    ]


def _panels(found: ByModel) -> dict[str, dict[str, tuple[np.ndarray, np.ndarray]]]:
    return {
        name: {response: (r.nu12, r.to_base) for response, r in responses.items()}
        for name, responses in found.items()
    }


def _lines(study: Study, found: Mapping[str, ModelFound]) -> list[str]:
    words = [f"{study.kind.response}, relative to that at nu12 = {study.card.law.nu12:g}"]
    named = {f"{n}, {k}": r for n, model in found.items() for k, r in model.responses.items()}
    wide = max(map(len, named))
    first = next(iter(named.values()))
    words.append(" " * wide + "".join(f"{f'{v:g}':>9}" for v in first.nu12) + "   spread")
    for name, r in named.items():
        numbers = "".join(f"{v:9.4f}" for v in r.to_base)
        low, high = (100 * s for s in r.spread)
        words.append(f"{name:<{wide}}{numbers}   {low:+.1f} to {high:+.1f} %")
    for name, model in found.items():
        words += [f"note: {name}, nu12 = {v}: {reason}" for v, reason in model.failed.items()]
        words += [f"note: {name}: {warning}" for warning in model.warnings]
    return words
