"""The cylinder on CalculiX, run by run: inflate, bend, bend again at the pressures of the gas."""

from __future__ import annotations

import logging
from collections.abc import Callable, Collection
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...errors import SolverFailure
from ...materials.law import HypoelasticLaw
from ...models.cylinder import CylinderModel
from ..base import History
from .cylinder import cylinder_decks
from .cylinder_bending import bending_context
from .cylinder_results import bending_history
from .results import whole_times
from .solids import solid_mesh

log = logging.getLogger(__name__)

Array = NDArray[np.float64]
#: Steps and increments that converged, of a run that stopped early; None when it did not.
Converged = Collection[tuple[int, int]] | None
Read = Callable[[Path, int, Converged], Any]
#: Runs a deck in a scratch folder and hands .frd file and iterations to a reader; the flag says
#: whether the reader is to have a run that stopped early as well.
Run = Callable[[dict[str, str], Read, bool], Any]

#: Most passes at the pressures that the last one's volumes give (the error falls to a quarter in
#: each on the thesis' cylinders), and the difference at which it is left, over absolute pressure.
PASSES, SETTLED = 5, 1e-4


def analyse(model: CylinderModel, law: HypoelasticLaw, folder: Path | None, run: Run) -> History:
    """History of inflation and bending with a constant mass of gas.

    CalculiX knows no gas: the deck has the pressure of each increment, and the volumes found give
    the pressures for the next pass. The history's are those the deck had; a remark says by how
    much the gas would differ at the end. A run that stops early is reported up to there.

    Raises
    ------
    SolverFailure : inflation did not end well, or bending not even its first reported deflection.
    """
    solids = solid_mesh(model)

    def inflated(frd: Path, iterations: int, _: Converged) -> Array:
        return whole_times(frd, len(model.inflation), len(solids.points))[0][-1]

    start: Array = run(cylinder_decks(model, law, solids, folder=folder), inflated, False)
    # Every increment is looked at: the gas has a pressure at each.
    every = replace(model, deflections=model.increments)
    pressures = np.full(len(model.increments), model.pressure)
    for number in range(1, PASSES + 1):
        bending = bending_context(model, solids, start, pressures.tolist())

        def bent(frd: Path, iterations: int, stopped: Converged, gauge: Array = pressures) -> Any:
            return bending_history(frd, every, solids, gauge, iterations, stopped)

        history: History = run(cylinder_decks(model, law, solids, bending, folder), bent, True)
        done = len(history.load) - 1
        wanted = _of_the_gas(model, history)
        gap = float(np.abs(wanted - pressures)[:done].max())
        log.info("pass %d: the gas is %.2g kPa off the deck", number, 1e3 * gap)
        if gap <= SETTLED * (model.pressure + model.gas.ambient):
            break
        pressures = wanted
    remark = f"{number} passes; the gas is within {1e3 * gap:.2g} kPa of the pressure in the deck"
    return _reported(replace(history, remarks=(*history.remarks, remark)), model)


def _of_the_gas(model: CylinderModel, history: History) -> Array:
    """Gauge pressure (increments,) of the gas in the volumes found; the last one's beyond them."""
    assert history.cavity_volume is not None
    full, volume = float(history.cavity_volume[0]), history.cavity_volume[1:]
    gas = model.gas.closed_in(model.pressure, full)
    found = [gas.pressure(float(v)) for v in volume]
    return np.array(found + [found[-1]] * (len(model.increments) - len(found)))


def _reported(history: History, model: CylinderModel) -> History:
    """The inflated state and the reported deflections out of every increment."""
    keep = np.concatenate([[0], model.reported + 1])
    keep = keep[keep < len(history.load)]
    if len(keep) < 2:
        raise SolverFailure("bending stopped before the first reported deflection", "calculix")
    assert history.cavity_pressure is not None and history.cavity_volume is not None
    return replace(
        history,
        load=history.load[keep],
        displacement=history.displacement[keep],
        reactions={name: values[keep] for name, values in history.reactions.items()},
        cavity_pressure=history.cavity_pressure[keep],
        cavity_volume=history.cavity_volume[keep],
    )
