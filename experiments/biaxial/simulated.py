"""Material cards on a biaxial test, side by side."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from ...errors import SolverFailure
from ...materials.card import MaterialCard
from ...meshes.strip_models import elongations
from ...readers.biaxial import BiaxialPath
from ...reports.strips import BiaxialPanel, biaxial_charts
from ...reports.vega import save
from ...writing import replacing
from ..kinds import STRAINS, CardRun, Output, Simulation, strains_of
from .objective import PERCENT
from .test import BiaxialTest

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Loading:
    """One card along one measured path.

    larger : (n,) kN/m, strain : (n, 2) % since the beginning, of the loads that are shown. rms :
    (2,) % off the measured strains, None where no load is shown. reached : (3,) strains.
    """

    path: BiaxialPath
    larger: Array
    strain: Array
    rms: tuple[float | None, float | None]
    reached: Array


#: By (card, ratio).
Loadings = Mapping[tuple[str, str], "Loading | SolverFailure"]


def simulate(
    test: BiaxialTest,
    cards: Mapping[str, MaterialCard],
    runs: Mapping[tuple[str, str], CardRun],
    out: Output,
    within_range: bool = False,
) -> Simulation:
    """Write paths.csv and paths.png; a failed analysis is told as such.

    within_range : show each path only to where the card's valid range ends.
    """
    found: Loadings = {
        (name, path.ratio): _loading(path, card, runs[name, path.ratio], within_range)
        for path in test.data.paths
        for name, card in cards.items()
    }
    _write(test, found, out)
    told: dict[str, Any] = {name: {"ratios": {}} for name in cards}
    for (name, ratio), one in found.items():
        told[name]["ratios"][ratio] = _numbers(one)
    figures = [(out.name("paths.png"), "Strain over the larger load")]
    return Simulation({"cards": told}, _lines(found), figures)


def _loading(
    path: BiaxialPath, card: MaterialCard, run: CardRun, within_range: bool
) -> Loading | SolverFailure:
    if isinstance(run.outcome, SolverFailure):
        return run.outcome
    own = elongations(run.outcome.displacement)
    shown = _within(card, own) if within_range else len(own)
    strain = PERCENT * (own - own[0])[:shown]
    off = strain - PERCENT * path.since[:shown]
    warp, fill = np.sqrt(np.mean(off**2, axis=0)).tolist() if shown else (None, None)
    larger = path.load.max(axis=1)[:shown]
    return Loading(path, larger, strain, (warp, fill), strains_of(run.outcome))


def _numbers(one: Loading | SolverFailure) -> dict[str, Any]:
    """For result.json."""
    if isinstance(one, SolverFailure):
        return {"failed": one.reason}
    return {
        "rms_warp_percent": one.rms[0],
        "rms_fill_percent": one.rms[1],
        "shown_to_kN_per_m": float(one.larger[-1]) if len(one.larger) else 0.0,
        "strain_reached": dict(zip(STRAINS, one.reached.tolist(), strict=True)),
    }


def _lines(found: Loadings) -> list[str]:
    """The same for the terminal."""
    lines = []
    for (name, ratio), one in found.items():
        if isinstance(one, SolverFailure):
            lines.append(f"{name}: ratio {ratio} failed: {one.reason}")
        elif len(one.larger):
            lines.append(
                f"{name}: ratio {ratio}: RMS of strain {one.rms[0]:.3g} % along warp, "
                f"{one.rms[1]:.3g} % along fill, to {one.larger[-1]:.3g} kN/m"
            )
    return lines


def _write(test: BiaxialTest, found: Loadings, out: Output) -> None:
    ended = {key: one for key, one in found.items() if isinstance(one, Loading)}
    tables = [
        pd.DataFrame(
            {
                "card": name,
                "ratio": ratio,
                "warp_load_kN_per_m": one.path.load[: len(one.larger), 0],
                "fill_load_kN_per_m": one.path.load[: len(one.larger), 1],
                "warp_strain_percent": one.strain[:, 0],
                "fill_strain_percent": one.strain[:, 1],
            }
        )
        for (name, ratio), one in ended.items()
    ]
    if tables:
        with replacing(out.path("paths.csv")) as file:
            pd.concat(tables, ignore_index=True).to_csv(file, index=False, float_format="%.9g")
    panels = []
    for path in test.data.paths:
        curves = tuple(
            (name, one.larger, one.strain)
            for (name, ratio), one in ended.items()
            if ratio == path.ratio and len(one.larger)
        )
        larger = path.load.max(axis=1)
        panels.append(BiaxialPanel(path.ratio, larger, PERCENT * path.since, curves))
    save(out.path("paths.png"), biaxial_charts("ratios", panels))


def _within(card: MaterialCard, elongation: Array) -> int:
    """Loads before a strain leaves the card's valid range."""
    beyond = (np.log1p(elongation) > card.law.strain_range[:2] * (1 + 1e-6)).any(axis=1)
    return int(np.argmax(beyond)) if beyond.any() else len(elongation)
