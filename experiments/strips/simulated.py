"""Material cards on the strips of a test, side by side."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
import pandas as pd

from ...errors import SolverFailure
from ...materials.card import MaterialCard
from ...meshes.mesh import middle_strain
from ...meshes.strip_models import UniaxialModel
from ...reports.strips import load_charts
from ...reports.vega import save
from ...solvers.base import History
from ...writing import replacing
from ..kinds import STRAINS, CardRun, Output, Simulation, strains_of
from .report import Array, Curve, draw_bias, load_panels
from .test import StripsTest


@dataclass(frozen=True, eq=False)
class Pull:
    """One card on one strip: how many of its increments are shown, and how far off they are (N)."""

    model: UniaxialModel
    history: History
    shown: int
    rms: float | None

    @property
    def elongation(self) -> Array:
        """mm of the gauge, at every increment."""
        return np.array(self.model.elongations)

    @property
    def whole(self) -> bool:
        """Whether nothing is left out."""
        return self.shown == len(self.model.elongations)


#: By (card, direction).
Pulls = Mapping[tuple[str, str], "Pull | SolverFailure"]


def simulate(
    test: StripsTest,
    cards: Mapping[str, MaterialCard],
    runs: Mapping[tuple[str, str], CardRun],
    out: Output,
    within_range: bool = False,
) -> Simulation:
    """Write loads.csv, loads.png and the deformed bias strips; a failed analysis is told as such.

    within_range : show each curve only to where the card's valid range ends.
    """
    pulls = {
        (name, direction): _pull(test, cards[name], direction, run, within_range)
        for (name, direction), run in runs.items()
    }
    told = {name: _card(test, name, card, pulls) for name, card in cards.items()}
    _write(test, list(cards), pulls, out)
    figures = [(out.name("loads.png"), "Load over gauge elongation")]
    return Simulation({"cards": told}, _lines(told), figures)


def _pull(
    test: StripsTest, card: MaterialCard, direction: str, run: CardRun, within_range: bool
) -> Pull | SolverFailure:
    if isinstance(run.outcome, SolverFailure):
        return run.outcome
    history, u = run.outcome, np.array(run.model.elongations)
    shown = _within(run.model, card, history) if within_range else len(u)
    polynomial, rms = test.strips[direction].polynomial, None
    if polynomial is not None and shown:
        error = history.load[:shown] - polynomial(u[:shown])
        rms = float(np.sqrt(np.mean(error**2)))
    return Pull(run.model, history, shown, rms)


def _within(model: UniaxialModel, card: MaterialCard, history: History) -> int:
    """Increments before a strain in the middle of a quad leaves the card's valid range."""
    for i, u in enumerate(history.displacement):
        strain = middle_strain(model.mesh, u, model.warp)
        reached = np.array([*strain[:, :2].max(axis=0), np.abs(strain[:, 2]).max()])
        if (reached > card.law.strain_range * (1 + 1e-6)).any():
            return i
    return len(history.load)


def _card(test: StripsTest, name: str, card: MaterialCard, pulls: Pulls) -> dict[str, Any]:
    """RMS errors, end loads and strains of a card, strip by strip."""
    directions: dict[str, Any] = {}
    total: float | None = 0.0
    for direction in test.strips:
        pull = pulls[name, direction]
        if isinstance(pull, SolverFailure):
            directions[direction], total = {"failed": pull.reason}, None
            continue
        reached = strains_of(pull.history)
        directions[direction] = {
            "rms_N": pull.rms,
            "end_load_N": float(pull.history.load[-1]),
            "shown_to_mm": float(pull.elongation[pull.shown - 1]) if pull.shown else 0.0,
            "strain_reached": dict(zip(STRAINS, reached.tolist(), strict=True)),
        }
        # A sum of errors over parts of the curves could be compared with nothing.
        known = pull.whole and pull.rms is not None and total is not None
        total = total + pull.rms if known else None  # type: ignore[operator]
    return {"e_uniaxial_N": total, "directions": directions}


def _write(test: StripsTest, cards: list[str], pulls: Pulls, out: Output) -> None:
    ended = {key: pull for key, pull in pulls.items() if isinstance(pull, Pull)}
    tables = [
        pd.DataFrame(
            {
                "card": name,
                "direction": direction,
                "elongation_mm": pull.elongation,
                "load_N": pull.history.load,
            }
        )
        for (name, direction), pull in ended.items()
    ]
    with replacing(out.path("loads.csv")) as path:
        pd.concat(tables).to_csv(path, index=False)
    drawn: dict[str, list[Curve]] = {d: [] for d in test.strips}
    rms: dict[str, list[float]] = {d: [] for d in test.strips}
    for (name, direction), pull in ended.items():
        if pull.shown:
            part = slice(pull.shown)
            drawn[direction].append((name, pull.elongation[part], pull.history.load[part]))
            rms[direction] += [] if pull.rms is None else [pull.rms]
    panels = load_panels(list(test.strips.values()), drawn, rms)
    save(out.path("loads.png"), load_charts("loads", panels))
    for number, name in enumerate(cards, start=1):
        if (name, "bias") in ended:
            stem = "bias" if len(cards) == 1 else f"bias-{number}"
            pull = ended[name, "bias"]
            draw_bias(pull.model, pull.history, out.path(f"{stem}.png"), out.path(f"{stem}.vtu"))


def _lines(cards: Mapping[str, dict[str, Any]]) -> list[str]:
    """The same for the terminal."""
    lines = []
    for name, card in cards.items():
        parts = []
        for direction, told in card["directions"].items():
            if "failed" in told:
                parts.append(f"{direction} failed")
            elif told["rms_N"] is None:
                parts.append(f"{direction} {told['end_load_N']:.4g} N at the end")
            else:
                parts.append(f"{direction} {told['rms_N']:.4g} N to {told['shown_to_mm']:.3g} mm")
        total = card["e_uniaxial_N"]
        words = "" if total is None else f"; sum {total:.4g} N"
        lines.append(f"{name}: RMS {', '.join(parts)}{words}")
    return lines
