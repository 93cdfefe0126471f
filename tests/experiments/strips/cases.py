"""Builders of the tests of strips."""

import tomllib
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
from bubblefit.experiments.base import FittedTest, Weighting
from bubblefit.experiments.doubts import Expected
from bubblefit.experiments.sections import Fabric, Place, Scales
from bubblefit.experiments.strips import KIND, StripsTest
from bubblefit.experiments.strips.data import Strip
from bubblefit.experiments.strips.doubts import doubts_of_strips
from bubblefit.experiments.strips.gauge import virtual_strain_gauge
from bubblefit.experiments.strips.load_objective import LoadObjective
from bubblefit.experiments.strips.prepared import PreparedStrips
from bubblefit.experiments.strips.reading import StripsSection
from bubblefit.inference.comparison import Comparison
from bubblefit.inference.problem import FitProblem
from bubblefit.inference.unknowns import LawBounds, Unknowns
from bubblefit.materials.forms import polynomial
from bubblefit.materials.forms.base import COMPONENTS
from bubblefit.materials.forms.spline import TriLinear
from bubblefit.materials.law import HypoelasticLaw
from bubblefit.meshes.bubble_model import BubbleModel
from bubblefit.meshes.disk import disk_mesh
from bubblefit.meshes.strip_models import bias_strip, straight_strip
from bubblefit.readers.curves import LoadCurve, fit_load_polynomial, specimen_deviation
from bubblefit.readers.frames import Frame
from bubblefit.readers.sections import LENGTH_UNITS, first_error
from bubblefit.solvers.base import History
from bubblefit.solvers.membrane.solver import MembraneSolver
from pydantic import ValidationError

from ...builders.laws import TABLE_3_2
from ...builders.projects import project_file
from ...support.paths import EXAMPLES


def strip_grid(spacing: float = 1.0, jitter: float = 0.0, seed: int = 0) -> np.ndarray:
    """Reference points (m, 3) on a 25 x 60 mm strip that is not quite flat."""
    x, y = np.meshgrid(np.arange(0, 25.1, spacing), np.arange(0, 60.1, spacing))
    flat = np.stack([x.ravel(), y.ravel()], axis=1)
    flat += jitter * spacing * np.random.default_rng(seed).uniform(-1, 1, flat.shape)
    return np.column_stack([flat, 0.02 * flat[:, 1] + 1.0])


def stretched_frame(points: np.ndarray, stretch: float, angle: float, shift=(3.0, -7.0, 2.0)):
    """Stretch along the strip, turn about x (out of the camera's plane), slip in the grips."""
    c, s = np.cos(angle), np.sin(angle)
    turn = np.array([[1, 0, 0], [0, c, -s], [0, s, c]])
    moved = (points * [0.9, stretch, stretch]) @ turn.T + shift
    return Frame(points, moved - points)


LOWER, UPPER = (12.3, 20.1), (12.3, 40.122)


def gauge_of_three_frames():
    points = strip_grid()
    frames = [stretched_frame(points, stretch, 0.0) for stretch in (1.0, 1.1, 1.2)]
    frames[1] = Frame(points[points[:, 1] < 38], frames[1].displacement[points[:, 1] < 38])
    return virtual_strain_gauge(frames, LOWER, UPPER)


def square_with_hole(spacing: float = 1.0, without: tuple[float, float] | None = None) -> Frame:
    x, y = (part.ravel() for part in np.meshgrid(*2 * [spacing * np.arange(11.0)]))
    points = np.column_stack([x, y, 0 * x])
    if without is not None:
        points = points[np.hypot(x - without[0], y - without[1]) > 0.1]
    return Frame(points, np.zeros_like(points))


# The strains that the tests of table 3.2 reached (logarithmic).
RANGE = (0.153, 0.232, 0.883)
STRIP_LAW = HypoelasticLaw(1e3 * np.array(TABLE_3_2), 0.24, RANGE)
BREAKS = np.array([[0.04, 0.1], [0.06, 0.15], [0.2, 0.5]])
# MPa: least and largest E1, E2, G12 anywhere on the range.
LEAST, LARGEST = np.array([20.0, 20.0, 2.0]), np.array([2000.0, 1000.0, 600.0])
BOUNDS = LawBounds.of_moduli(dict(zip(COMPONENTS, zip(LEAST, LARGEST, strict=True), strict=True)))
CUBIC_UNKNOWNS, REGIONS, CONSTANTS = (
    Unknowns.of(form, 0.24, RANGE, BOUNDS)
    for form in (polynomial.CUBIC, TriLinear.at(BREAKS), polynomial.CONSTANT)
)
# Thesis Table 3.1, mm; ten increments and few quads.
STRIP_MODELS = {
    "warp": straight_strip("warp", 20.022, 23.329, 0.81, increments=10),
    "fill": straight_strip("fill", 22.780, 28.721, 0.81, increments=10),
    "bias": bias_strip(19.767, 30.734, 0.81, increments=10, across=4, along=6),
}
BUBBLE = BubbleModel(
    disk_mesh(100.0, 192, "quarter"), 0.81, [0.05, 0.12, 0.2], [0.02, 0.05, 0.12, 0.2]
)
TIGHT = 1e-10


@cache
def exact_history(part: str, law: HypoelasticLaw) -> History:
    return MembraneSolver(TIGHT).run(BUBBLE if part == "bubble" else STRIP_MODELS[part], law)


def strip_tests(law, relative: bool = False, noise: float = 0.0, seed: int = 0):
    for k, (name, model) in enumerate(STRIP_MODELS.items()):
        load = exact_history(name, law).load
        load = load + noise * np.random.default_rng(10 * seed + k).standard_normal(len(load))
        scale = float(load.max()) if relative else 1.0
        objective = LoadObjective(model.elongations, model.elongations, load, scale)
        yield Comparison(name, model, MembraneSolver(), objective, must_be_stable=False)


def strip_problem(
    unknowns: Unknowns = CUBIC_UNKNOWNS, law: HypoelasticLaw = STRIP_LAW, **how: Any
) -> Any:
    return FitProblem(tuple(strip_tests(law, **how)), law, unknowns)


def near_law(unknowns: Unknowns, law: HypoelasticLaw, factor: float = 1.03) -> Any:
    y = unknowns.at(law.beta[list(unknowns.free)] * factor)
    y[unknowns.size :] = [0.3, -0.2, 0.5, 1.5][: len(unknowns.nuisance.names)]
    return y


ELONGATION = np.linspace(0.1, 3.0, 30)
WHOLE = 100.0 * ELONGATION


def noisy_strip(loads: np.ndarray) -> Strip:
    curves = [LoadCurve("warp", str(k), ELONGATION, f, None) for k, f in enumerate(loads)]
    points = np.tile(ELONGATION, len(loads)), loads.ravel()
    polynomial = fit_load_polynomial(*points, 2, True)
    scatter = specimen_deviation(*points, polynomial)
    return Strip("warp", 20.0, 23.0, polynomial, tuple(curves), scatter)


GAUGE, WIDTH, THICKNESS = 20.0, 25.0, 0.8
EXPECTED = Expected({"E1": (300.0, 1500.0), "E2": (100.0, 600.0), "G12": (5.0, 60.0)})
MODULI = {"warp": 700.0, "fill": 300.0, "bias": 40.0}
ENDS = {"warp": 3.0, "fill": 5.0, "bias": 10.0}


def curve_of_moduli(direction: str) -> LoadCurve:
    elongation = np.linspace(0.0, ENDS[direction], 60)
    strain = np.log1p(elongation / GAUGE)
    load = MODULI[direction] * WIDTH * THICKNESS * strain * (1 - 0.5 * strain)
    noise = np.random.default_rng(5).normal(0, 1.0, 60)
    return LoadCurve(direction, "1", elongation, load + noise, None)


def strip_of_curves(one: LoadCurve, end: float | None = None) -> Strip:
    length = ENDS[one.direction] if end is None else end
    polynomial = fit_load_polynomial(one.elongation, one.load, 4)
    twin = replace(one, specimen="2", load=0.98 * one.load)
    return Strip(one.direction, GAUGE, GAUGE + length, polynomial, (one, twin))


GOOD_CURVES = {direction: curve_of_moduli(direction) for direction in MODULI}
GOOD_WARP, GOOD_FILL = GOOD_CURVES["warp"], GOOD_CURVES["fill"]


def strip_doubts_of(strips, thickness=THICKNESS, expected=EXPECTED, grips=75.0, by_points=True):
    return list(doubts_of_strips(strips, WIDTH, thickness, expected, grips, by_points))


def strip_doubt_names(curves, **ends):
    return {
        d.name: d
        for d in strip_doubts_of({d: strip_of_curves(c, ends.get(d)) for d, c in curves.items()})
    }


def changed_curve(direction: str, **parts):
    return {**GOOD_CURVES, direction: replace(GOOD_CURVES[direction], **parts)}


BROKEN = changed_curve("fill", load=GOOD_FILL.load * np.where(np.arange(60) < 50, 1.0, 0.2))
LAW = HypoelasticLaw.linear(500.0, 200.0, 20.0)


def prepared_strips(folder: Path, text: str, *changes: tuple[str, str]) -> PreparedStrips:
    return KIND.prepare(read_strips(project_file(folder, text, *changes)), LAW, MembraneSolver)


def fitted_strips(prepared: PreparedStrips) -> FittedTest:
    comparisons = prepared.comparisons(MembraneSolver, Weighting())
    histories = tuple(c.solver.run(c.model, LAW) for c in comparisons)
    valid = np.array([0.1, 0.5, 0.3])
    return FittedTest(comparisons, histories, {}, LAW, (LAW,), 1.5 * valid, valid, None)


def residual_norms(prepared: PreparedStrips, *weighting) -> dict[str, float]:
    return {
        c.name: float(np.linalg.norm(c.objective.residual(c.solver.run(c.model, LAW), {})))
        for c in prepared.comparisons(MembraneSolver, Weighting(*weighting))
    }


CURVES = EXAMPLES / "uniaxial-valmex7318"
#: The published polynomials, everything said.
PUBLISHED = """
width = 25.0
grip_distance = 75.0
bias_angle = 45.0
increments = 100
match = "polynomial"
objective = "N"

[data]
polynomials = "curves.csv"
"""
#: As little as there can be, and machine exports as they come: one file a direction.
SMALL = """
[warp]
gauge_length = 20.0

[fill]
gauge_length = 22.0

[bias]
gauge_length = 19.0

[data]
files = { warp = ["w1.csv", "w2.csv"], fill = ["f.TXT"], bias = ["b.csv"] }
"""


def read_strips(
    path: Path, data_folder: Path | None = None, need_data: bool = True, length: str = "mm"
) -> StripsTest:
    try:
        section = StripsSection.model_validate(tomllib.loads(path.read_text()))
    except ValidationError as found:
        raise first_error(path, found, StripsSection, at="strips[0]") from None
    scales = Scales(length=LENGTH_UNITS[length], length_unit=length)
    place = Place(path, "strips[0]", Fabric("", 0.81), scales, data_folder, need_data)
    return KIND.read(section, place, section.name or "strips")


def rows_of(separator: str, *columns: np.ndarray, comma: bool = False) -> str:
    lines = [separator.join(f"{v:.6f}" for v in row) for row in zip(*columns, strict=True)]
    text = "\n".join(lines)
    return text.replace(".", ",") if comma else text


def write_exports(folder: Path):
    """MTS (warp, 200 N/mm, in kN), ZwickRoell (fill, 80 N/mm), Instron (bias, 50 N/mm)."""
    u = np.linspace(0, 4, 21)
    mts = "Test: cut strip\nTest Run: 3\n\nAxial Displacement,Axial Force,Running Time\nmm,kN,sec\n"
    (folder / "w1.csv").write_text(mts + rows_of(",", u, 0.2 * u, u))
    (folder / "w2.csv").write_text(mts + rows_of(",", 0.9 * u, 0.18 * u, u))
    zwick = (
        '"Prüfgeschwindigkeit"\t300\t"mm/min"\n"Prüfzeit"\t"Standardkraft"\t"Standardweg"\n'
        '"s"\t"N"\t"mm"\n'
    )
    text = zwick + rows_of("\t", u, 80 * u, u, comma=True)
    (folder / "f.TXT").write_bytes(text.encode("latin-1"))
    instron = "Specimen label,,\n\nTime,Extension,Load,Tensile stress\n(s),(mm),(N),(MPa)\n"
    # Two specimens one after the other.
    two = np.concatenate([u, u[:11]])
    (folder / "b.csv").write_text(instron + rows_of(",", two, two, 50 * two, two))
