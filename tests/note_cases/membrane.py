"""Notes of the membrane's analyses, provoked."""

from collections.abc import Iterable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from bubblefit.errors import Note
from bubblefit.experiments.kinds import notes_of
from bubblefit.materials.card import MaterialCard
from bubblefit.materials.law import HypoelasticLaw
from bubblefit.meshes.strip_models import straight_strip
from bubblefit.solvers.membrane import bending
from bubblefit.solvers.membrane import bending as inflated
from bubblefit.solvers.membrane.closed import ClosedMembrane
from bubblefit.solvers.membrane.solver import MembraneSolver

from ..solvers.membrane.test_bending import LINEAR, beam

Array = np.ndarray


def notes_of_bending(*_: Any) -> Iterable[Note]:
    """A beam bent to 6 of 8 mm, every move called a jump."""
    find, heights = ClosedMembrane.equilibrium, list[float]()

    def tired(self: ClosedMembrane, u: Array, pressure: float) -> Array | None:
        if self.bodies:
            heights.append(self.bodies[-1].centre[1])
            if heights[0] - heights[-1] > 4.5:
                return None
        return find(self, u, pressure)

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(ClosedMembrane, "equilibrium", tired)
        patch.setattr(bending, "LEAP", 1e-6)
        solver = MembraneSolver(1e-6, wrinkle_stiffness=0.01)
        return solver.run(beam((2.0, 4.0, 6.0, 8.0), across=4), LINEAR).remarks


def notes_of_inflation(_: Path, patch: pytest.MonkeyPatch) -> Iterable[Note]:
    """Every increment is gone through by volume."""
    patch.setattr(inflated, "MOST_GROWTH_INFLATED", 0.0)
    model = replace(beam(across=4), bending=None)
    return MembraneSolver(1e-6).run(model, LINEAR).remarks


def notes_of_analysis(*_: Any) -> list[Note]:
    """Yarns slide where half the stress along them is more than the shear modulus."""
    soft = replace(HypoelasticLaw.linear(500.0, 200.0, 4.0), strain_range=np.array([0.05, 1, 1]))
    model = straight_strip("warp", 20.0, 21.6, 0.81, increments=10, across=8)
    return notes_of(MembraneSolver().run(model, soft), MaterialCard(soft, 0.81))
