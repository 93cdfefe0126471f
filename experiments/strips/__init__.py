"""Uniaxial tests of cut strips along warp, fill and the bias: load over a gauge's elongation."""

import numpy as np

from ...lazy_modules import LazyFunction
from ...meshes.strip_models import UniaxialModel
from ...solvers.base import History
from ..forward import Studied
from ..measured import MeasuredKind
from .section import StripsSection
from .test import read


def end_load(model: UniaxialModel, history: History) -> dict[str, float]:
    """Return the load (N) at the end of a strip's history, by the name that studies give it."""
    return {"load at the end, N": float(history.load[-1])}


class StripsKind(MeasuredKind):
    """Cut strips pulled along warp, fill and across the yarns."""

    name = "strips"
    title = "cut strips pulled along warp, fill and 45 degrees"
    section = StripsSection
    folder_key = "data.folder"
    prepared = LazyFunction(f"{__name__}.prepared", "PreparedStrips")
    doubts = (
        "elongation-unit",
        "load-unit",
        "preload",
        "after-failure",
        "swapped",
        "grip-travel",
        "gauge-still",
        "load-limit",
        "slack-strip",
        "force-unit",
        "repeated-specimen",
        "odd-specimen",
    )
    read = staticmethod(read)
    candidates = LazyFunction(f"{__name__}.planning", "candidates")
    studied = Studied(
        steps=lambda model: model.elongations,
        quantities=end_load,
        responses=end_load,
        response="load",
        curve=lambda model, history: (np.array(model.elongations), history.load),
    )


KIND = StripsKind()
