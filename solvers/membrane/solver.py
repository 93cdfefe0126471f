"""The embedded membrane solver, which selects the analysis that fits the class of a model."""

from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from ...errors import InputError
from ...materials.deformation_curves import bar
from ...materials.law import HypoelasticLaw
from ...meshes.beam_model import BeamModel
from ...meshes.bubble_model import SLACK, TENSION, BubbleModel, MeasuredShape
from ...meshes.cylinder_model import CylinderModel, InflatedModel
from ...meshes.mesh import Array
from ...meshes.strip_models import PatchModel, TubeModel, UniaxialModel
from ...processes import limit_blas
from ...version import __version__
from ..bars import BARS, INCREMENTS, TOLERANCE, bar_law, difference
from ..base import BandEnd, Diagnosis, History, Progress, SolverCheck, analysis_of, parameters_of
from ..decks import in_words
from ..pretension import slack_slopes, stretched
from . import beam, bubble, closed, cylinder, homogeneous_tube, inflation, patch, strip
from .factorisation import BandedTangent
from .loading import RunRequest
from .membrane import Membrane
from .wall import BAND, TENSION_FIELD, Walls, chosen_wall


class Analysis(NamedTuple):
    """The two functions of an analysis.

    Attributes
    ----------
    prepare : callable
        Takes model, law, tolerance and wall; returns the membrane or other state, which is kept
        for the next run of the same model.
    analyse : callable
        Takes the membrane, the model and a `RunRequest`; returns history and derivatives.
    """

    prepare: Callable[..., Membrane | patch.Patch | beam.Beam]
    analyse: Callable[..., tuple[History, Array]]


#: Analyses by the class of the model. They get None for the wall where the settings name none.
ANALYSES: dict[type, Analysis] = {
    BubbleModel: Analysis(bubble.prepare, bubble.analyse),
    MeasuredShape: Analysis(bubble.prepare, bubble.balance),
    UniaxialModel: Analysis(strip.prepare, strip.analyse),
    InflatedModel: Analysis(closed.prepare, inflation.analyse_inflated),
    CylinderModel: Analysis(cylinder.prepare, cylinder.analyse_cylinder),
    PatchModel: Analysis(patch.prepare, patch.analyse),
    TubeModel: Analysis(homogeneous_tube.prepare, homogeneous_tube.analyse),
    BeamModel: Analysis(beam.prepare, beam.analyse),
}


class MembraneSolver:
    """Finite element solver for membranes in this process, with derivatives of its results.

    Parameters
    ----------
    tolerance : float
        Ratio of the largest residual force to the largest nodal pressure force (for a strip, to the
        largest reaction) below which a state is an equilibrium; 1000 times that in a bending.
    wrinkle_stiffness, bending_stiffness : float, optional
        Stiffness of the wall of an inflated cylinder, see `Wall`.
    wall : {"band", "tension field", "stiff"}
        The wall of an inflated cylinder. With "band" and neither stiffness, `band` returns both
        walls and `run` takes the tension field.
    """

    name = "membrane"
    external = False
    load_ratios = remembers = True

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
        self._prepared: tuple[Any, Membrane | patch.Patch | beam.Beam] | None = None

    @property
    def identity(self) -> str:
        wall = self.wall or TENSION_FIELD
        return in_words(self.name, __version__, tolerance=self.tolerance, wall=wall)

    def band(self, model: Any) -> Sequence[BandEnd]:
        return BAND if self.wall is None and isinstance(model, CylinderModel) else ()

    def check(self) -> SolverCheck:
        return SolverCheck(self.name, True, __version__, True)

    def run(
        self,
        model: Any,
        law: HypoelasticLaw,
        scratch: Path | None = None,
        timeout: float | None = None,
        guess: Array | None = None,
    ) -> History:
        """Run the analysis of a model and return its history; see `Solver.run`.

        Parameters
        ----------
        scratch, timeout
            Not used, as no other program is run.
        guess : array or None
            Displacements (increments, nodes, 3) in mm from which the increments start.
        """
        return self._analyse(model, law, (), guess)[0]

    def run_with_sensitivity(
        self,
        model: Any,
        law: HypoelasticLaw,
        parameters: Sequence[str] | None = None,
        guess: Array | None = None,
    ) -> tuple[History, Array]:
        """Return the history, and the derivatives of its displacements by parameters.

        Parameters
        ----------
        parameters : sequence of str or None
            Names out of `parameters_of`; all entries of the law's beta unless given.
        guess : (increments, nodes, 3) array or None, mm
            Displacements from which the increments start.

        Returns
        -------
        History
            Derivatives of the load are in it (`load_slope`).
        (frames, nodes, 3, parameters) array
            Derivatives of the displacements, mm per unit of the parameter (MPa for beta).

        Raises
        ------
        InputError
            A name is unknown.
        """
        available = parameters_of(law, model)
        if parameters is None:
            parameters = available[: law.form.size]
        unknown = [name for name in parameters if name not in available]
        if unknown:
            raise InputError(None, "parameters", f"{unknown} not among {available}")
        return self._analyse(model, law, parameters, guess)

    @property
    def stress(self) -> Array:
        """Return the Cauchy stress (warp, fill, shear) at the end of the last run.

        It is (quads, 4 Gauss points, 3) in MPa. LookupError before the first run, or after a beam.
        """
        if self._prepared is None or isinstance(self._prepared[1], beam.Beam):
            raise LookupError("no run of a membrane yet: there is no stress")
        return self._prepared[1].stress_old.copy()

    def _analyse(
        self,
        model: Any,
        law: HypoelasticLaw,
        parameters: Sequence[str],
        guess: Array | None,
    ) -> tuple[History, Array]:
        """Return the history and the derivatives (frames, nodes, 3, parameters) of displacements.

        Parameters
        ----------
        guess : (increments, nodes, 3) array, mm
            Displacements from which the increments start.
        """
        analyse = analysis_of(ANALYSES, model, self.name).analyse
        if isinstance(model, BubbleModel) and any((*model.tension, *set(TENSION) & {*parameters})):
            return self._analyse_stretched(model, law, parameters, guess)
        request = RunRequest(parameters, guess, self.progress)
        # The bands are too small to share: where another program uses a core, BLAS threads that
        # wait for each other made an analysis 12 to 290 times slower (bench_cost.py analysis).
        with limit_blas(1):
            return analyse(self._membrane(model, law), model, request)

    def _analyse_stretched(
        self,
        model: BubbleModel,
        law: HypoelasticLaw,
        parameters: Sequence[str],
        guess: Array | None,
    ) -> tuple[History, Array]:
        """Analyse a sheet under tension as one of negative slack, which depends on the law.

        Parameters
        ----------
        guess : (increments, nodes, 3) array, mm
            Displacements from which the increments start.
        """
        direct = [name for name in parameters if name not in (*SLACK, *TENSION)]
        of_slack = SLACK if parameters else ()
        history, slopes = self._analyse(stretched(model, law), law, [*direct, *of_slack], guess)
        if not parameters:
            return history, slopes
        columns = [parameters.index(name) for name in direct]
        chain = slack_slopes(model, law, parameters)

        def by_parameters(slope: Array) -> Array:
            total = slope[..., len(direct) :] @ chain
            total[..., columns] += slope[..., : len(direct)]
            return np.asarray(total)

        if history.path_slope is not None:
            history = replace(history, path_slope=by_parameters(history.path_slope))
        return history, by_parameters(slopes)

    def _new_membrane(self, model: Any, law: HypoelasticLaw) -> Membrane | patch.Patch | beam.Beam:
        """Return the membrane of a model, made from that of the last run if only the sheet differs.

        Sparse tangents are made anew, as the order of their unknowns depends on the sheet.
        """
        if self._prepared is not None and isinstance(model, BubbleModel):
            previous, membrane = self._prepared
            if isinstance(previous, BubbleModel) and isinstance(membrane, Membrane):
                is_same_disk = (
                    model.mesh.quads is previous.mesh.quads and model.supports is previous.supports
                )
                is_banded = isinstance(membrane.tangent, BandedTangent)
                if is_same_disk and is_banded and membrane.law.state == law.state:
                    return bubble.with_sheet(membrane, model)
        prepare = analysis_of(ANALYSES, model, self.name).prepare
        return prepare(model, law, self.tolerance, self.wall)

    def _membrane(self, model: Any, law: HypoelasticLaw) -> Membrane | patch.Patch | beam.Beam:
        """Return the membrane of a model, unloaded; the last one again for the same model."""
        prepared = self._prepared
        state = law.state if prepared is None else getattr(prepared[1], "law", law).state
        if prepared is None or prepared[0] is not model or state != law.state:
            self._prepared = (model, self._new_membrane(model, law))
        assert self._prepared is not None
        membrane = self._prepared[1]
        if isinstance(membrane, beam.Beam):
            return membrane
        membrane.law = law
        membrane.keep_tangent = False
        membrane.iterations = 0
        membrane.strain_old[:] = 0.0
        membrane.stress_old[:] = 0.0
        return membrane


EMBEDDED = "embedded"


def diagnose(named: Path | str | None = None) -> list[Diagnosis]:
    """Return the diagnosis of the embedded solver, a list of one entry.

    Parameters
    ----------
    named
        Not used, as there is no other program. The law is integrated along `bars.BARS` in their
        increments.
    """
    stresses = []
    for published in BARS:
        pulled = int(published.direction == "fill")
        ends = np.log1p(published.elongation * np.arange(1, INCREMENTS + 1) / INCREMENTS)
        stresses.append(float(bar(bar_law(published.model), pulled, ends)[1][-1, pulled]))
    off = difference(tuple(stresses))
    advice = "the embedded law is broken; install bubblefit and numba again"
    return [
        Diagnosis(
            name="membrane",
            version=__version__,
            origin=EMBEDDED,
            expected=True,
            usable=off < TOLERANCE,
            stresses=tuple(stresses),
            difference=off,
            advice="" if off < TOLERANCE else advice,
        )
    ]
