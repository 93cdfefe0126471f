"""A solver for strips along a yarn: the strain is the same everywhere, no mesh is needed."""

from pathlib import Path
from typing import Any

import numpy as np
from bubblefit.errors import InputError, SolverFailure
from bubblefit.materials.deformation_curves import bar
from bubblefit.materials.law import HypoelasticLaw
from bubblefit.meshes.strip_models import UniaxialModel
from bubblefit.solvers.bars import homogeneous_history
from bubblefit.solvers.base import History, SolverCheck

NAME, VERSION = "bar", "1.0"


class BarSolver:
    """What `solver = "bar"` and `--solver bar` make."""

    name = NAME
    #: In this process: nothing has to be there but this file.
    external = False
    progress = None
    #: What a result depends on beside model and law.
    identity = f"{NAME} {VERSION}"

    def check(self) -> SolverCheck:
        """It is there if this runs; `bubblefit doctor` then pulls bars with it."""
        return SolverCheck(NAME, True, VERSION, True)

    def run(
        self,
        model: Any,
        law: HypoelasticLaw,
        scratch: Path | None = None,
        timeout: float | None = None,
    ) -> History:
        """Pull a strip along warp or fill, all else free; SolverFailure for any other model."""
        if not isinstance(model, UniaxialModel) or set(model.supports) != {"top", "symmetry_x"}:
            raise SolverFailure("takes strips along warp or fill only", NAME)
        pulled = 0 if abs(model.warp[1]) > 0.999 else 1
        stretch = 1 + np.array(model.elongations) / model.gauge_length
        try:
            strain, stress = bar(law, pulled, np.log(stretch))
        except InputError as error:
            raise SolverFailure(error.problem, NAME) from None
        across = np.exp(strain[:, 1 - pulled])
        # Cauchy stress on the deformed width and thickness.
        thickness = model.thickness * (stretch * across) ** (law.area_power - 1)
        width = model.load_factor * float(np.ptp(model.mesh.points[:, 0])) * across
        return homogeneous_history(model, strain, stress[:, pulled] * width * thickness)
