"""The embedded membrane solver: which analysis a model needs, and what all of them share."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from threadpoolctl import ThreadpoolController

from ...errors import InputError
from ...files import __version__
from ...materials.law import HypoelasticLaw
from ...meshes.bubble_model import BubbleModel
from ...meshes.cylinder_model import CylinderModel, InflatedModel
from ...meshes.strip_models import PatchModel, UniaxialModel
from ..base import BandEnd, History, Progress, SolverCheck, analysis_of, parameters_of
from ..decks import in_words
from . import bending as cylinder
from . import bending as inflated
from . import bubble, strip
from . import closed as closed_model
from . import strip as patch
from .bubble import BAND, TENSION_FIELD, Walls, chosen_wall
from .newton import Asked, Membrane

Array = NDArray[np.float64]


class Analysis(NamedTuple):
    """How a model is run: (model, law, tolerance, wall) -> membrane; (membrane, model, asked).

    The wall is None where none was asked for.
    """

    prepare: Callable[..., Membrane | patch.Patch]
    analyse: Callable[..., tuple[History, Array]]


#: What each model needs.
ANALYSES: dict[type, Analysis] = {
    BubbleModel: Analysis(bubble.prepare, bubble.analyse),
    UniaxialModel: Analysis(strip.prepare, strip.analyse),
    InflatedModel: Analysis(closed_model.prepare, inflated.analyse_inflated),
    CylinderModel: Analysis(cylinder.prepare, cylinder.analyse_cylinder),
    PatchModel: Analysis(patch.prepare_patch, patch.analyse_patch),
}

# The bands are too small to share: where another program uses a core, BLAS threads that wait for
# each other made an analysis 12 to 290 times slower (benchmarks/bench_cost.py analysis).
BLAS = ThreadpoolController()


class MembraneSolver:
    """In-process finite element solver with exact sensitivities (needs no other program).

    Parameters
    ----------
    tolerance : largest residual force over the largest nodal pressure force (a strip: over the
        largest reaction of a node).
    wrinkle_stiffness : share of its stiffness that a closed membrane keeps across its wrinkles
        (tension field, materials/wrinkles.py); None: it carries compression as it carries
        tension, as bubbles and strips do.
    bending_stiffness : share of the wall's own that counts where rigid bodies bend a closed
        membrane (solvers/membrane/closed.py).
    wall : of a bent cylinder: "tension field" or "stiff". Unless it, or one of the shares, is
        given, `band` names both, and `run` takes the tension field.

    Raises
    ------
    InputError : as `chosen_wall`.
    """

    name = "membrane"
    external = False
    load_ratios = True

    def __init__(
        self,
        tolerance: float = 1e-8,
        wrinkle_stiffness: float | None = None,
        bending_stiffness: float | None = None,
        wall: Walls = "band",
    ) -> None:
        self.tolerance = tolerance
        self.wall = chosen_wall(wall, wrinkle_stiffness, bending_stiffness)
        self.progress: Callable[[Progress], None] | None = None
        self._prepared: tuple[Any, Membrane | patch.Patch] | None = None

    @property
    def identity(self) -> str:
        """The tolerance, and what the wall of a closed membrane does."""
        wall = self.wall or TENSION_FIELD
        return in_words(self.name, __version__, tolerance=self.tolerance, wall=wall)

    def band(self, model: Any) -> Sequence[BandEnd]:
        """Both walls of a bent cylinder, where none was asked for."""
        return BAND if self.wall is None and isinstance(model, CylinderModel) else ()

    def check(self) -> SolverCheck:
        """Always there; the law is its own."""
        return SolverCheck(self.name, True, __version__, True)

    def run(
        self,
        model: Any,
        law: HypoelasticLaw,
        scratch: Path | None = None,
        timeout: float | None = None,
        guess: Array | None = None,
    ) -> History:
        """Inflate, bend or pull the model (scratch and timeout are for external solvers only).

        Parameters
        ----------
        guess : (increments, nodes, 3) displacements to start each increment from, mm.

        Raises
        ------
        SolverFailure : an increment has no equilibrium that Newton and cut-back can find.
        """
        return self._analyse(model, law, (), guess)[0]

    def run_with_sensitivity(
        self,
        model: Any,
        law: HypoelasticLaw,
        parameters: Sequence[str] | None = None,
        guess: Array | None = None,
    ) -> tuple[History, Array]:
        """History and d displacement / d parameters, (frames, nodes, 3, len(parameters)).

        The parameters are every entry of the law's beta unless given. Derivatives by them are per
        MPa, by the model's own parameters per unit of theirs. Those of a strip's load are in the
        history (`load_slope`).

        Raises
        ------
        InputError : a parameter that law and model do not have. SolverFailure : as `run`.
        """
        known = parameters_of(law, model)
        if parameters is None:
            parameters = known[: law.form.size]
        unknown = [name for name in parameters if name not in known]
        if unknown:
            raise InputError(None, "parameters", f"{unknown} not among {known}")
        return self._analyse(model, law, parameters, guess)

    @property
    def stress(self) -> Array:
        """(quads, points of a quad, 3) MPa: Cauchy stress along warp, fill and in shear at the end
        of the last run.

        Raises
        ------
        LookupError : nothing was run yet.
        """
        if self._prepared is None:
            raise LookupError("no run yet: there is no stress")
        return self._prepared[1].stress_old.copy()

    @BLAS.wrap(limits=1, user_api="blas")
    def _analyse(
        self, model: Any, law: HypoelasticLaw, parameters: Sequence[str], guess: Array | None
    ) -> tuple[History, Array]:
        asked = Asked(parameters, guess, self.progress)
        history, slope = analysis_of(ANALYSES, model, self.name).analyse(
            self._membrane(model, law), model, asked
        )
        return history, slope

    def _membrane(self, model: Any, law: HypoelasticLaw) -> Membrane | patch.Patch:
        """Geometry and sparsity are made once a model; strain history anew every run."""
        if self._prepared is None or self._prepared[0] is not model:
            prepare = analysis_of(ANALYSES, model, self.name).prepare
            self._prepared = (model, prepare(model, law, self.tolerance, self.wall))
        membrane = self._prepared[1]
        membrane.law = law
        membrane.keep_tangent, membrane.iterations = False, 0
        membrane.strain_old[:] = 0.0
        membrane.stress_old[:] = 0.0
        return membrane
