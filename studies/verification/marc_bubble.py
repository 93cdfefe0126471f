"""The thesis' bubble (Table 4.2) as Marc inflated it."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import pandas as pd

from ...materials.law import HypoelasticLaw
from ...meshes.disk import disk_mesh
from ...models.bubble import BubbleModel, default_increments
from ...solvers.membrane.solver import MembraneSolver
from .abaqus import PUBLISHED
from .number import Number

TABLE = PUBLISHED / "marc_bubble_profiles.csv"
SOURCE = "MSC Marc; Jekel et al., preprint of SMO (2016)"
#: Table 4.2, "solution", GPa.
SOLUTION = (
    -7.96788e-3, 7.10747e-1, -1.56912e-1, 2.00439e-2,
    -1.06241e1, 1.37830e1, -9.31830e-1, 1.39437e-1,
    -4.79622e2, 2.12650e2, -2.02028e1, 8.06350e-1,
)  # fmt: skip
STRAIN_RANGE = (0.13, 0.13, 0.13)
PRESSURES = (0.022, 0.059, 0.097, 0.132, 0.186, 0.251, 0.3)
#: Two figures of the paper disagree by 5 %, and the load stepping is not known.
ALLOWED = 0.06
ELEMENTS = 800


def known_law(nu12: float = 0.24) -> HypoelasticLaw:
    """The law of Table 4.2."""
    return HypoelasticLaw(1e3 * np.array(SOLUTION), nu12, np.array(STRAIN_RANGE))


def known_bubble() -> BubbleModel:
    """The thesis' bubble: radius 100 mm, thickness 0.81 mm, seven pressures; a quarter of it."""
    mesh = disk_mesh(100.0, ELEMENTS, "quarter")
    return BubbleModel(mesh, 0.81, PRESSURES, default_increments(PRESSURES))


def marc_bubble() -> Iterator[Number]:
    """Height of the apex at the seven pressures."""
    table = pd.read_csv(TABLE, comment="#")
    model = known_bubble()
    history = MembraneSolver().run(model, known_law())
    apex = history.displacement[:, model.mesh.node_sets["apex"][0], 2]
    for pressure, ours in zip(1e3 * np.array(PRESSURES), apex, strict=True):
        theirs = table[np.isclose(table["p_kPa"], pressure)]["z_mm"].max()
        what = f"apex of Table 4.2, {pressure:g} kPa"
        yield Number(what, float(ours), float(theirs), "mm", ALLOWED, SOURCE)
