"""`bubblefit study nu12`: how much the response depends on Poisson's ratio (Fig. 4.2)."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import Any

import click
import numpy as np

from ..errors import InputError, SolverFailure
from ..reports import plot_nu12
from ..studies.poisson import NU12, Ratios, by_response
from .progress import run_progress
from .study_kinds import levels
from .study_options import Study, card_options, finish

HEADER = ("model", "response", "nu12", "value", "to_base", "to_mean")
Found = Mapping[str, Mapping[str, Ratios]]


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
    found, failures = _run(study, values, as_json)
    result = _result(study, found, failures)
    finish(
        study,
        "nu12",
        HEADER,
        _rows(found),
        lambda path: plot_nu12(
            path,
            _panels(found),
            study.card.law.nu12,
            study.kind.response,
            study.kind.published,
        ),
        result,
        _lines(study, found, failures),
        as_json,
    )


def _run(
    study: Study, values: tuple[float, ...], quiet: bool
) -> tuple[dict[str, dict[str, Ratios]], dict[str, dict[str, str]]]:
    """Ratios by model and response, and by model and nu12 why a run failed.

    Raises
    ------
    SolverFailure : of the card as it is, or of all other values.
    """
    found: dict[str, dict[str, Ratios]] = {}
    failures: dict[str, dict[str, str]] = {}
    planned = levels(study.kind, study.project, "elements", 1.0, study.card.thickness)
    for name, level in planned.items():

        def respond(nu12: float, level: Any = level) -> Mapping[str, float]:
            with run_progress(study.solver, level.increments, quiet):
                history = study.solver.run(level.model, replace(study.card.law, nu12=nu12))
            return study.kind.responses(level.model, history)

        base = respond(study.card.law.nu12)
        responses: list[Mapping[str, float] | None] = []
        failures[name] = {}
        for value in values:
            try:
                responses.append(respond(value))
            except SolverFailure as failure:
                responses.append(None)
                failures[name][f"{value:g}"] = failure.reason
                last = failure
        if not any(responses):
            raise last
        found[name] = by_response(values, responses, base)
    return found, failures


def _result(
    study: Study, found: Found, failures: Mapping[str, Mapping[str, str]]
) -> dict[str, Any]:
    return {
        "command": "study nu12",
        "project": str(study.project.path),
        "card": str(study.card_path),
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
                    for response, r in responses.items()
                },
                "failed": dict(failures[name]),
            }
            for name, responses in found.items()
        },
    }


def _known(values: np.ndarray) -> list[float | None]:
    """Numbers for JSON, which has no NaN."""
    return [float(v) if np.isfinite(v) else None for v in values]


def _rows(found: Found) -> list[list[object]]:
    return [
        [name, response, *(float(v) for v in row)]
        for name, responses in found.items()
        for response, r in responses.items()
        for row in zip(r.nu12, r.values, r.to_base, r.to_mean, strict=True)
    ]


def _panels(found: Found) -> dict[str, dict[str, tuple[np.ndarray, np.ndarray]]]:
    return {
        name: {response: (r.nu12, r.to_base) for response, r in responses.items()}
        for name, responses in found.items()
    }


def _lines(study: Study, found: Found, failures: Mapping[str, Mapping[str, str]]) -> list[str]:
    words = [f"{study.kind.response}, relative to that at nu12 = {study.card.law.nu12:g}"]
    first = next(iter(next(iter(found.values())).values()))
    wide = max(len(f"{n}, {r}") for n, responses in found.items() for r in responses)
    words.append(" " * wide + "".join(f"{f'{v:g}':>9}" for v in first.nu12) + "   spread")
    for name, responses in found.items():
        for response, r in responses.items():
            numbers = "".join(f"{v:9.4f}" for v in r.to_base)
            low, high = (100 * s for s in r.spread)
            words.append(f"{f'{name}, {response}':<{wide}}{numbers}   {low:+.1f} to {high:+.1f} %")
        for value, reason in failures[name].items():
            words.append(f"note: {name}, nu12 = {value}: {reason}")
    return words
