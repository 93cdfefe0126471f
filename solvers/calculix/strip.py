"""The strip models in CalculiX: what the template is given, and how far the grips are pulled."""

from __future__ import annotations

import logging
import math
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline

from ...errors import SolverFailure
from ...materials.law import HypoelasticLaw
from ...models.uniaxial import UniaxialModel
from ..base import History
from ..membrane.solver import MembraneSolver
from .deck import deck_files
from .library import constants
from .shells import ShellMesh
from .strip_results import StripRun, strip_history, strip_run

log = logging.getLogger(__name__)

Array = NDArray[np.float64]
#: Runs a deck in a scratch folder and hands .frd file and iterations to a reader.
Run = Callable[[dict[str, str], Callable[[Path, int], Any]], Any]

DECK = "strip.inp.j2"
#: Those of the bubble would do, but the increments are a hundredth of the whole: the load is
#: within 2e-8 of what they give, for a sixth fewer iterations.
TOLERANCES = (1e-5, 1e-4)
#: Least increment of CalculiX as a part of one of the law.
LEAST = 1 / 256
#: How much further than expected the grips go, so that the gauge reaches its length for sure.
BEYOND = 1.02


def analyse(
    model: UniaxialModel,
    law: HypoelasticLaw,
    shells: ShellMesh,
    element: str,
    folder: Path | None,
    run: Run,
) -> History:
    """History of a strip, at the model's elongations of the gauge.

    CalculiX drives the grips: an equation for the gauge would put the force at its nodes. Grips
    that are the gauge are driven as the model has it. Others follow the path on which the membrane
    opens the gauge under the same law (without one: an even stretch, run once to correct it).
    CalculiX' own gauge then differs a little, and its results are interpolated to the model's.

    Raises
    ------
    SolverFailure : a run that did not end well, a gauge that did not reach its length.
    """

    def decks(pulls: Array) -> dict[str, str]:
        return strip_decks(model, law, shells, element, pulls, folder)

    pulls = _direct(model)
    if pulls is None:
        pulls = _as_the_membrane(model, law)
    if pulls is None:
        even = _even(model)
        first = run(decks(even), lambda frd, _: strip_run(frd, model, shells, len(even)))
        pulls = corrected(model, even, first)
    count = len(pulls)

    def read(frd: Path, iterations: int) -> History:
        return strip_history(strip_run(frd, model, shells, count), model, shells, iterations)

    history: History = run(decks(pulls), read)
    return history


def strip_decks(
    model: UniaxialModel,
    law: HypoelasticLaw,
    shells: ShellMesh,
    element: str,
    pulls: Array,
    folder: Path | None = None,
) -> dict[str, str]:
    """Text of each input file; `pulls` (increments,) mm of the pulled end, along -y.

    Raises
    ------
    InputError : a template that cannot be used.
    """
    angle = math.degrees(math.atan2(model.warp[1], model.warp[0]))
    context = {
        # A law's increment is a whole time, whatever CalculiX makes of it.
        "constants": constants(law, angle=angle, whole_times=True),
        "thickness": model.thickness,
        "supports": [
            {"set": name.upper(), "dofs": [d + 1 for d in directions]}
            for name, directions in model.supports.items()
        ],
        "pulled": model.pulled.upper(),
        "pulls": pulls.tolist(),
        "least": LEAST,
        "most_increments": 4 * len(pulls) + 200,
    }
    return deck_files(DECK, "Strip", shells, element, TOLERANCES, context, folder)


def corrected(model: UniaxialModel, pulls: Array, first: StripRun) -> Array:
    """Pulls (increments + 1,) at which the gauge of a `first` run with `pulls` was as wanted.

    Beyond the end of the first run as steeply as at its end.
    """
    gauge, pull = np.insert(first.gauge, 0, 0.0), np.insert(pulls, 0, 0.0)
    if not (np.diff(gauge) > 0).all():
        raise SolverFailure("the gauge gets shorter while the grips move apart", "calculix")
    levels = np.array(model.elongations)
    steep = (pull[-1] - pull[-2]) / (gauge[-1] - gauge[-2])
    inside = CubicSpline(gauge, pull)(np.minimum(levels, gauge[-1]))
    found = inside + steep * np.maximum(levels - gauge[-1], 0.0)
    return _onward(found)


def _direct(model: UniaxialModel) -> Array | None:
    """The pulls when the gauge lies between the grips themselves, along the pull."""
    lower, upper = (3 * node + np.arange(3) for node in model.mesh.node_sets["gauge"])
    held = np.isin(np.concatenate([lower[[0, 2]], upper]), model.fixed).all()
    ends = model.mesh.points[model.mesh.node_sets["gauge"]]
    along = ends[0, 0] == ends[1, 0] and ends[0, 1] < ends[1, 1]
    if held and along and lower[1] in model.driven:
        return np.array(model.elongations)
    return None


def _as_the_membrane(model: UniaxialModel, law: HypoelasticLaw) -> Array | None:
    try:
        history = MembraneSolver().run(model, law)
    except SolverFailure as failure:
        log.info("grips are pulled evenly first: %s", failure)
        return None
    return _onward(-history.displacement[:, model.mesh.node_sets[model.pulled][0], 1])


def _even(model: UniaxialModel) -> Array:
    """As if the whole strip stretched as the gauge does."""
    length = float(np.ptp(model.mesh.points[:, 1]))
    return np.array(model.elongations) * length / model.gauge_length


def _onward(pulls: Array) -> Array:
    return np.append(pulls, BEYOND * pulls[-1])
