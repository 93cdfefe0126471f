"""Verification of inflated tubes: strains under small loads, collapse loads of cantilevers."""

from collections.abc import Iterator

import numpy as np

from ...materials.law import HypoelasticLaw
from ...meshes.beam_model import PlainWall, TubeCrossSection
from ...meshes.strip_models import TubeModel
from ...solvers.membrane.solver import MembraneSolver
from .number import Number

#: Radius and thickness of the thin tube, mm.
RADIUS = 100.0
THICKNESS = 0.8
#: Moduli of its wall along, around and in shear, MPa, and its contraction around under a force
#: along.
E1 = 400.0
E2 = 300.0
G12 = 20.0
NU12 = 0.24


def loaded_tubes() -> Iterator[Number]:
    """Compare strains of thin tubes with closed forms, collapse loads of cantilevers with tests."""
    law = HypoelasticLaw.linear(E1, E2, G12, NU12)
    # Small loads (MPa, N, N mm), and the component of the strain that they make.
    for name, load, component in (
        ("pressure", (1e-5, 0.0, 0.0), 1),
        ("tension", (0.0, 1.0, 0.0), 0),
        ("torsion", (0.0, 0.0, 10.0), 2),
    ):
        model = TubeModel(np.array([load]), RADIUS, THICKNESS)
        strains = model.strains(MembraneSolver().run(model, law).displacement)[0]
        theirs = rigid_tube_strains(*load)[component]
        quantity = f"strain of a thin tube by {name}"
        yield Number(quantity, strains[component], theirs, "", 1e-4, "closed form")
    # bar and m, of the range of the tests. The fits themselves are off the membrane's load by a
    # quarter, with a sign that turns.
    for bar, radius in ((0.2, 0.08), (0.3, 0.08), (0.5, 0.08)):
        yield Number(
            f"collapse load of a cantilever of 1 m, radius {radius:g} m, {bar:g} bar",
            collapse_load(0.1 * bar, 1e3 * radius),
            breukels_load(bar, radius),
            "N",
            0.25,
            "Breukels, TU Delft (2011), fits to tests of kite tubes, as in kite_fem",
        )


def rigid_tube_strains(pressure: float, force: float, torque: float) -> tuple[float, float, float]:
    """Return axial, hoop and shear strain of the thin tube; loads in MPa, N and N mm."""
    axial = 0.5 * pressure * RADIUS + force / (2 * np.pi * RADIUS)
    hoop = pressure * RADIUS
    return (
        (axial - NU12 * hoop) / E1 / THICKNESS,
        hoop / E2 / THICKNESS - NU12 * axial / E1 / THICKNESS,
        torque / (2 * np.pi * RADIUS**2 * THICKNESS * G12),
    )


def collapse_load(pressure: float, radius: float) -> float:
    """Return the tip load (N) at which a cantilever of 1 m is wrinkled almost around.

    The wall plays no part in it: MPa and mm.
    """
    section = TubeCrossSection(radius, pressure, PlainWall(200.0, 200.0, 30.0))
    curvature = np.array([20 * 0.5 * pressure / 200.0])
    strain = np.zeros(1)
    for _ in range(50):
        normal, moment, slope = section.resultants(strain, curvature)
        strain = strain - normal / slope[:, 0, 0]
    return moment[0] / 1e3


def breukels_load(bar: float, radius: float) -> float:
    """Return the tip load (N) at Breukels' collapse deflection of a tube of 1 m, radius in m."""
    limit = (6582.82 * radius - 272.43) * bar**2 + 40852.38 * radius**3 + 14.31
    slope = (271865251.42 * radius**5 + 215.93) * bar + 14021.79 * radius - 589.05
    collapse = (322.55 * radius**4 + 0.0239) * bar + 5.3833 * radius**2 + 0.0461
    return float(limit * (1 - np.exp(-slope * collapse / limit)))
