"""Four bars with published end stresses of another program: does a solver carry the law?"""

import numpy as np

from ..errors import SolverFailure
from ..light_dataclasses import dataclass
from ..materials.law import HypoelasticLaw
from ..meshes.strip_models import UniaxialModel, straight_strip
from .base import Array, History, Solver

#: Relative. The integral of the published coefficients (5 digits) is within 6e-5 of every stress.
TOLERANCE = 1e-4
INCREMENTS = 100
#: mm, of the one element of half a bar.
SIZE = 10.0


@dataclass(frozen=True)
class Bar:
    """A bar of Valmex 7318 in Marc (Composite Structures, 2017): E in GPa, end stress in MPa."""

    model: str
    direction: str
    modulus: tuple[float, float, float, float]
    elongation: float
    stress: float


BARS = (
    Bar("direct", "warp", (0.80335, -20.444, 217.66, -589.2), 0.16516831, 62.677),
    Bar("direct", "fill", (0.07528, 1.07347, -0.82337, 0.0), 0.26079895, 42.855),
    Bar("inverse", "warp", (0.80877, -20.725, 225.88, -575.28), 0.16516831, 71.912),
    Bar("inverse", "fill", (0.07624, 1.14164, 0.75244, 0.0), 0.26079895, 51.448),
)


def bar_law(model: str) -> HypoelasticLaw:
    """Return the law of a published model; the shear modulus (20 MPa) plays no part in a bar."""
    of = {bar.direction: bar.modulus for bar in BARS if bar.model == model}
    gigapascal = (0.0, 0.0, 0.0, 0.02, *of["fill"][::-1], *of["warp"][::-1])
    return HypoelasticLaw(1e3 * np.array(gigapascal))


def difference(stresses: tuple[float, ...]) -> float:
    """Return the largest relative difference of end stresses (MPa) of BARS from Marc's."""
    return max(abs(s / bar.stress - 1) for bar, s in zip(BARS, stresses, strict=True))


def checked_stresses(
    stresses: tuple[float, ...], solver_in_words: str, solver: str
) -> tuple[float, ...]:
    """Return end stresses (MPa) of BARS; SolverFailure where one is off by more than TOLERANCE."""
    for bar, stress in zip(BARS, stresses, strict=True):
        if not abs(stress / bar.stress - 1) < TOLERANCE:
            problem = f"{bar.model} {bar.direction} bar: {stress:.4g} MPa, not {bar.stress}"
            raise SolverFailure(f"{solver_in_words} does not carry the law ({problem})", solver)
    return stresses


def bar_model(bar: Bar) -> UniaxialModel:
    """Return a strip of one element (half of its width), free to contract; thickness 1 mm."""
    return straight_strip(
        "warp" if bar.direction == "warp" else "fill",
        gauge_length=SIZE,
        final_length=SIZE * (1.0 + bar.elongation),
        thickness=1.0,
        width=2.0 * SIZE,
        increments=INCREMENTS,
        across=1,
        along=1,
    )


def stress_of(model: UniaxialModel, history: History) -> float:
    """Return the Cauchy stress (MPa) at the end: load over section; the thickness is constant."""
    width = np.ptp(model.mesh.points[:, 0] + history.displacement[-1, :, 0])
    return float(history.load[-1] / (model.load_factor * width * model.thickness))


def strip_stresses(solver: Solver) -> tuple[float, ...]:
    """Return the end stresses (MPa) of BARS by a solver's own strips; SolverFailure if none."""
    stresses = []
    for bar in BARS:
        model = bar_model(bar)
        history = solver.run(model, bar_law(bar.model))
        if len(history.load) != INCREMENTS:
            problem = f"{len(history.load)} frames of a strip of {INCREMENTS} elongations"
            raise SolverFailure(problem, solver.name)
        stresses.append(stress_of(model, history))
    return tuple(stresses)


def homogeneous_history(model: UniaxialModel, strain: Array, force: Array) -> History:
    """Return the history of a strip along a yarn that is strained alike everywhere.

    It serves solvers that know a strip as one state of strain only.

    Parameters
    ----------
    strain : (n, 3) array
        Log strain along warp and fill, and shear, which is not used; a row for each increment.
    force : (n,) array, N
        Of the whole strip.
    """
    points = model.mesh.points
    sets = model.mesh.node_sets
    along = 0 if abs(model.warp[1]) > 0.999 else 1
    middle = points[sets["symmetry_x"], 0].mean(), points[sets["top"], 1].mean()
    elongation = np.expm1(strain[:, [1 - along, along]])
    displacement = np.zeros((len(strain), len(points), 3))
    displacement[..., :2] = elongation[:, None] * (points[:, :2] - middle)
    strain_from_rest = np.vstack([np.zeros(3), strain])
    up = np.outer(force / model.load_factor, [0, 1, 0])
    reactions = {"top": up, model.pulled: -up}
    return History(
        force, displacement, strain_from_rest.min(axis=0), strain_from_rest.max(axis=0), reactions
    )
