"""Four bars with published end stresses of another program: does a solver carry the law?"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from ..errors import BubblefitError, SolverFailure
from ..materials.law import HypoelasticLaw
from ..meshes.strip_models import UniaxialModel, straight_strip
from .base import Diagnosis, History, Solver
from .registry import SOLVERS, PlugIn, checked, plug_ins, solver_named
from .settings import Offer

#: Relative. The integral of the published coefficients (5 digits) is within 6e-5 of every stress.
TOLERANCE = 1e-4
INCREMENTS = 100
#: mm, of the one element of half a bar.
SIZE = 10.0


@dataclass(frozen=True)
class Bar:
    """A uniaxial test of Valmex 7318 computed with MSC Marc (Composite Structures, 2017).

    modulus: E of log strain, constant term first, GPa; elongation: engineering strain at the
    end; stress: Marc's end stress, MPa.
    """

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


def bar_model(bar: Bar) -> UniaxialModel:
    """Return a strip of one element (half of its width), free to contract; thickness 1 mm."""
    return straight_strip(
        "warp" if bar.direction == "warp" else "fill", gauge_length=SIZE,
        final_length=SIZE * (1.0 + bar.elongation), thickness=1.0, width=2.0 * SIZE,
        increments=INCREMENTS, across=1, along=1,
    )  # fmt: skip


def stress_of(model: UniaxialModel, history: History) -> float:
    """Return the Cauchy stress (MPa) at the end: load over section; the thickness is constant."""
    width = np.ptp(model.mesh.points[:, 0] + history.displacement[-1, :, 0])
    return float(history.load[-1] / (model.load_factor * width * model.thickness))


def strip_stresses(solver: Solver) -> tuple[float, ...]:
    """Return the end stresses (MPa) of BARS by a solver's own uniaxial analysis.

    Raises SolverFailure : it does not take a `UniaxialModel`, or a strip does not end well.
    """
    found = []
    for bar in BARS:
        model = bar_model(bar)
        history = solver.run(model, bar_law(bar.model))
        if len(history.load) != INCREMENTS:
            problem = f"{len(history.load)} frames of a strip of {INCREMENTS} elongations"
            raise SolverFailure(problem, solver.name)
        found.append(stress_of(model, history))
    return tuple(found)


def diagnose(**programs: Path | str | None) -> list[Diagnosis]:
    """Diagnose the embedded solver, then our others, then every plug-in.

    programs : by the option that names a solver's program (`ccx`, `marc`), the one to look at.
    """
    ours = [make for make in SOLVERS.values() if isinstance(make, Offer)]
    ours.sort(key=lambda offer: offer.program is not None)  # the embedded ones have no program
    found = []
    for offer in ours:
        found += offer.diagnose(programs.get(offer.program.name) if offer.program else None)
    return [*found, *(_plug_in(one) for one in plug_ins())]


def _plug_in(plug_in: PlugIn) -> Diagnosis:
    """Diagnose a plug-in, on the bars where it runs strips; never raises on its account."""
    origin = f"plug-in of {plug_in.distribution}"

    def found(
        version: str, advice: str, usable: bool = False, stresses: tuple[float, ...] | None = None
    ) -> Diagnosis:
        off = None if stresses is None else difference(stresses)
        return Diagnosis(plug_in.name, version, None, origin, False, None, usable,
                         stresses, off, advice)  # fmt: skip

    if plug_in.name in SOLVERS:
        advice = f"{plug_in.name} is bubblefit's own: the plug-in needs another name"
        return found("", f"{advice}; tell those who make it")
    try:
        solver = solver_named(plug_in.name)
        check = checked(plug_in.name, solver)
    except BubblefitError as error:
        return found("", str(error).splitlines()[0])
    if not (check.available and check.carries_law):
        return found(check.version, check.advice or "says that it is not usable, and not why")
    try:
        stresses = strip_stresses(solver)
    except BubblefitError as error:
        # It may be for bubbles only, or have failed: the reader knows which.
        return found(check.version, f"its law was not tried: {str(error).splitlines()[0]}", True)
    except Exception as error:
        return found(check.version, str(plug_in.solver_failure("fails on a strip", error)))
    off = difference(stresses)
    advice = "" if off < TOLERANCE else f"does not carry the law: {off:.2g} from Marc's end stress"
    return found(check.version, advice, off < TOLERANCE, stresses)
