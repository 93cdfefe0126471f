"""The cylinder on CalculiX, run by run: inflate, bend, bend again at the pressures of the gas."""

from __future__ import annotations

import logging
from dataclasses import replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ...materials.law import HypoelasticLaw
from ...models.cylinder import CylinderModel
from ...notes import Note, NoteKind
from ..base import History
from .analysis import Converged, Run, Setup
from .cylinder import cylinder_decks
from .cylinder_bending import bending_context
from .cylinder_gas import GasCurve, better_pressure, compliance, gas_pressure
from .cylinder_results import BentCylinder, bending_history, bent_cylinder, volumes
from .results import whole_times
from .solids import solid_mesh

log = logging.getLogger(__name__)

Array = NDArray[np.float64]
#: Most passes at the pressures that the last one's volumes give, and what may be left between the
#: gas and the deck, over absolute pressure: p V is constant to that.
PASSES, SETTLED = 4, 3e-4


def analyse(model: CylinderModel, law: HypoelasticLaw, setup: Setup, run: Run) -> History:
    """History of inflation and bending with a constant mass of gas.

    CalculiX knows no gas: the deck has its pressure over the collar's way, and the volumes found
    give that for the next pass. The history's is the one the deck had; a remark says how far it
    is from the gas'. A run that stops early is reported up to there.

    Raises
    ------
    SolverFailure : inflation did not end well, or bending not even its first reported deflection.
    """
    solids, folder = solid_mesh(model), setup.templates

    def blown(frd: Path, iterations: int) -> tuple[Array, Array]:
        start = whole_times(frd, len(model.inflation), len(solids.points))[0]
        return start[-1], volumes(model, solids.middle(start))

    def bent(
        frd: Path, iterations: int, stopped: Converged | None = None, why: str = ""
    ) -> BentCylinder:
        return bent_cylinder(frd, model, solids, iterations, stopped, why)

    start, filling = run(cylinder_decks(model, law, solids, folder=folder), blown)
    rest = volumes(model, np.zeros((1, *model.mesh.points.shape)))
    slope = compliance(np.array([0.0, *model.inflation]), np.concatenate([rest, filling]))
    gas = GasCurve(np.zeros(1), np.full(1, model.pressure))
    for number in range(1, PASSES + 1):
        context = bending_context(model, solids, start, gas)
        found: BentCylinder = run(cylinder_decks(model, law, solids, context, folder), bent, bent)
        given = gas.at(found.deflection)
        closed = model.gas.closed_in(model.pressure, float(found.volume[0]))
        gap = gas_pressure(closed, found.volume) - given
        left = float(np.abs(gap).max()) / (model.pressure + model.gas.ambient)
        log.info("pass %d to %.4g mm: p V within %.1e", number, found.deflection[-1], left)
        if left <= SETTLED or number == PASSES:
            break
        better = better_pressure(closed, found.volume, given, slope)
        gas = GasCurve(found.deflection, better)
    history = bending_history(model, found, gas)
    rise = 1e3 * (float(gas.at(found.deflection)[-1]) - model.pressure)
    words = f"gas: pass {number}, p V constant within {left:.1e} (wanted: {SETTLED:g}), "
    words += f"pressure {rise:+.3g} kPa at the end"
    return replace(history, remarks=(*history.remarks, Note(NoteKind.GAS, words)))
