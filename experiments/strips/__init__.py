"""Strip tests: cut strips pulled along warp, fill and 45 degrees, loads over a gauge's length."""

from __future__ import annotations

import numpy as np
from pydantic import BaseModel

from ...materials.law import HypoelasticLaw
from ...meshes.strip_models import UniaxialModel
from ...solvers.base import History
from ..kinds import Kind, MakeSolver, Predicted, Studied
from .candidates import candidates
from .prepared import Array, PreparedStrips
from .section import StripsSection
from .test import StripsTest, read


def _end_load(model: UniaxialModel, history: History) -> dict[str, float]:
    return {"load at the end, N": float(history.load[-1])}


def _load_curve(model: UniaxialModel, history: History) -> tuple[Array, Array]:
    return np.array(model.elongations), history.load


class Strips:
    """Cut strips pulled along warp, fill and across the yarns."""

    name: str = "strips"
    title: str = "cut strips pulled along warp, fill and 45 degrees"
    section: type[BaseModel] = StripsSection
    folder_key: str = "data.folder"
    fitted: bool = True
    predicted: Predicted | None = None
    doubts: tuple[str, ...] = (
        "elongation-unit", "load-unit", "preload", "after-failure", "swapped",
    )  # fmt: skip
    read = staticmethod(read)
    candidates = staticmethod(candidates)
    studied: Studied | None = Studied(
        steps=lambda model: model.elongations,
        quantities=_end_load,
        responses=_end_load,
        response="load",
        curve=_load_curve,
    )

    def prepare(
        self, test: StripsTest, law: HypoelasticLaw, make_solver: MakeSolver
    ) -> PreparedStrips:
        """Return the test, which was read with its data."""
        return PreparedStrips(test)


KIND: Kind = Strips()
