"""The strip models in CalculiX: what the template is given, and how far the grips are pulled."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ...materials.law import HypoelasticLaw
from ...models.uniaxial import UniaxialModel
from ..base import History
from ..pulls import grip_pulls
from .analysis import Run, Setup
from .deck import deck_files, supports_of
from .library import constants
from .shells import ShellMesh
from .strip_results import strip_history, strip_run

Array = NDArray[np.float64]

DECK = "strip.inp.j2"
#: Those of the bubble would do, but the increments are a hundredth of the whole: the load is
#: within 2e-8 of what they give, for a sixth fewer iterations.
TOLERANCES = (1e-5, 1e-4)
#: Least increment of CalculiX as a part of one of the law.
LEAST = 1 / 256


def analyse(model: UniaxialModel, law: HypoelasticLaw, setup: Setup, run: Run) -> History:
    """History of a strip, at the model's elongations of the gauge.

    CalculiX drives the grips, see `pulls`.

    Raises
    ------
    SolverFailure : a run that did not end well, a gauge that did not reach its length.
    """
    shells = setup.shells(model.mesh)

    def decks(pulls: Array) -> dict[str, str]:
        return strip_decks(model, law, shells, setup.element, pulls, setup.templates)

    def opened(pulls: Array) -> Array:
        return run(decks(pulls), lambda frd, _: strip_run(frd, model, shells, len(pulls))).gauge

    pulls, _ = grip_pulls(model, law, opened, "calculix")
    count = len(pulls)

    def read(frd: Path, iterations: int) -> History:
        return strip_history(strip_run(frd, model, shells, count), model, shells, iterations)

    return run(decks(pulls), read)


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
        "supports": supports_of(model.supports),
        "pulled": model.pulled.upper(),
        "pulls": pulls.tolist(),
        "least": LEAST,
        "most_increments": 4 * len(pulls) + 200,
    }
    return deck_files(DECK, "Strip", shells, element, TOLERANCES, context, folder)
