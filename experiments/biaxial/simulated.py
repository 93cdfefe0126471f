"""Material cards on a biaxial test, side by side."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
import pandas as pd

from ...errors import SolverFailure
from ...materials.card import MaterialCard
from ...models.patch import elongations
from ...reports import BiaxialPanel, plot_biaxial
from ...writing import replacing
from ..base import CardRun, Output, Simulation
from ..notes import STRAINS, strains_of
from .objective import PERCENT
from .test import BiaxialTest


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
    told: dict[str, Any] = {}
    tables, lines, panels = [], [], []
    for path in test.data.paths:
        larger, curves = path.load.max(axis=1), []
        for name, card in cards.items():
            ratios = told.setdefault(name, {"ratios": {}})["ratios"]
            run = runs[name, path.ratio]
            if isinstance(run.outcome, SolverFailure):
                ratios[path.ratio] = {"failed": run.outcome.reason}
                lines.append(f"{name}: ratio {path.ratio} failed: {run.outcome.reason}")
                continue
            own = elongations(run.outcome.displacement)
            shown = _within(card, own) if within_range else len(own)
            strain = PERCENT * (own - own[0])[:shown]
            off = strain - PERCENT * path.since[:shown]
            rms = np.sqrt(np.mean(off**2, axis=0)).tolist() if shown else [None, None]
            reached = strains_of(run.outcome).tolist()
            ratios[path.ratio] = {
                "rms_warp_percent": rms[0],
                "rms_fill_percent": rms[1],
                "shown_to_kN_per_m": float(larger[shown - 1]) if shown else 0.0,
                "strain_reached": dict(zip(STRAINS, reached, strict=True)),
            }
            if shown:
                curves.append((name, larger[:shown], strain))
                lines.append(
                    f"{name}: ratio {path.ratio}: RMS of strain {rms[0]:.3g} % along warp, "
                    f"{rms[1]:.3g} % along fill, to {larger[shown - 1]:.3g} kN/m"
                )
            tables.append(
                pd.DataFrame(
                    {
                        "card": name,
                        "ratio": path.ratio,
                        "warp_load_kN_per_m": path.load[:shown, 0],
                        "fill_load_kN_per_m": path.load[:shown, 1],
                        "warp_strain_percent": strain[:, 0],
                        "fill_strain_percent": strain[:, 1],
                    }
                )
            )
        panels.append(BiaxialPanel(path.ratio, larger, PERCENT * path.since, tuple(curves)))
    if tables:
        with replacing(out.path("paths.csv")) as file:
            pd.concat(tables, ignore_index=True).to_csv(file, index=False, float_format="%.9g")
    plot_biaxial(out.path("paths.png"), panels)
    figures = [(out.name("paths.png"), "Strain over the larger load")]
    return Simulation({"cards": told}, lines, figures)


def _within(card: MaterialCard, elongation: np.ndarray) -> int:
    """Loads before a strain leaves the card's valid range."""
    beyond = (np.log1p(elongation) > card.law.strain_range[:2] * (1 + 1e-6)).any(axis=1)
    return int(np.argmax(beyond)) if beyond.any() else len(elongation)
