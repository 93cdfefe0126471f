"""Made-up runs of cylinders with cards: curves, their measures, bands, and the outcome of all."""

from types import SimpleNamespace
from typing import Any

import numpy as np
from bubblefit.experiments.cylinder.measures import BendingMeasures, BendingRun, CurvePoint
from bubblefit.experiments.cylinder.predicted import CylinderOutcome
from bubblefit.notes import SOLVER, Note
from bubblefit.readers.bending import BendingCurve, BendingError
from bubblefit.solvers.base import EARLY, SNAP
from bubblefit.solvers.calculix.cylinder import GAS

MEASURES = BendingMeasures(
    stiffness=4.256, loads={"20 mm": 86.4, "a long way": None}, knee=CurvePoint(61.0, 251.0),
    limit=CurvePoint(120.0, 502.6), wrinkles=CurvePoint(33.0, 140.0), straightness=(0.99, 0.02),
    body_strain=(0.011, 0.022), anywhere_strain=(0.033, 0.044), pressure_rise=1.6, reached=150.0,
    error=BendingError(3.1, -1.2, 0.0519, 17, 4),
)  # fmt: skip


WAY, LOAD = np.array([0.0, 40.0, 80.0]), np.array([0.0, 100.0, 90.0])


BENT = BendingRun(
    deflection=WAY, load=LOAD, pressure=np.array([0.1, 0.101, 0.102]),
    volume=np.array([5e7, 4.9e7, 4.8e7]), inflated=np.empty(0), wrinkled=np.array([0.0, 0.1, 0.2]),
    bent=np.empty(0),
)  # fmt: skip


CURVE = BendingCurve("1", WAY, LOAD)


def case(name: str, diameter: float = 150.0, **other: Any) -> SimpleNamespace:
    fields = {
        "name": name, "diameter": diameter, "length": 3000.0, "size": 40.0, "seam_width": 35.0,
        "supports": SimpleNamespace(span=2000.0), "measured": (), "assumed": (),
        "deflections": (80.0, 160.0),
        "reading": SimpleNamespace(places={"20 mm": 20.0, "a long way": 200.0}, slope_over=20.0),
    }  # fmt: skip
    return SimpleNamespace(**(fields | other))


def run(test, card: str, end=None, notes=None, **record: Any) -> SimpleNamespace:
    said = SimpleNamespace(**({"failure": "", "early": "", "seconds": 12.34} | record))
    kinds = (EARLY, SNAP) if said.early else (GAS, SOLVER)
    kinds = kinds if notes is None else notes
    return SimpleNamespace(
        test=test, card=card, notes=tuple(Note(kind, "words") for kind in kinds), record=said,
        end=end, wall=end.name if end else "", predicted=end is None or end.predicted,
        around=None, model=f"model of {test.name}", material=SimpleNamespace(certainty="known"),
    )  # fmt: skip


def outcome_of(*runs, bent=None, measures=None) -> CylinderOutcome:
    found = CylinderOutcome(runs)
    found.__dict__["bent"] = bent or {}
    found.__dict__["measures"] = measures or dict.fromkeys(bent or {}, MEASURES)
    return found
