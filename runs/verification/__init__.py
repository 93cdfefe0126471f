"""Compare published and closed-form numbers with those of the program as it is installed.

bf.verify().table() lists them all, bf.verify(["bars"]) those of a subject.

Here are published results of Marc, Abaqus and the thesis: bars, bubbles, strips, Poisson's ratio.
"""

from __future__ import annotations

import functools
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from typing import Any, Literal

import numpy as np
import pandas as pd

from ...errors import check_one_of, checked
from ...materials.law import HypoelasticLaw
from ...meshes.bubble_model import BubbleModel, default_increments
from ...meshes.disk import disk_mesh
from ...meshes.strip_models import WIDTH, bias_strip, straight_strip
from ...readers.curves import fit_load_polynomial, read_load_curves
from ...solvers.bars import BARS, TOLERANCE, strip_stresses
from ...solvers.base import Solver
from ...solvers.calculix.solver import CalculixSolver, diagnose
from ...solvers.membrane.solver import MembraneSolver
from ..progress import Listener, listener
from .closed_forms import Number, bent_tubes, hencky_membranes, loaded_tubes, thin_walls

SOURCE = "MSC Marc; Jekel et al., Composite Structures 161 (2017)"


def marc_bars(stresses: Sequence[float] | None = None, program: str = "") -> Iterator[Number]:
    """Compare end stresses (MPa) of the four bars, in order, with Marc's; `program` begins each
    name. Those of the embedded membrane unless given."""
    for bar, stress in zip(BARS, stresses or strip_stresses(MembraneSolver()), strict=True):
        what = f"{program}end stress, {bar.model} {bar.direction} bar"
        yield Number(what, stress, bar.stress, "MPa", TOLERANCE, SOURCE)


PUBLISHED = Path(__file__).parent / "published"
TABLE = PUBLISHED / "abaqus_linear_orthotropic.csv"
SOURCE_ABAQUS = "Abaqus M3D4; figures of inv_bubble_opt (Jekel)"
#: Error of reading the published figures, mm.
DIGITISED = 0.03
#: A lower pressure, where reading the figure is 0.3 %, and the highest.
LOW_BAR = 1.0
ELEMENTS = 1600


def abaqus_bubbles() -> Iterator[Number]:
    """Compare the apex at about 100 kPa and at the highest pressure, and in-plane displacements."""
    for (test, model), rows in cases():
        found = shapes(rows, ELEMENTS, MembraneSolver())
        low, high = int((rows["p_bar"] - LOW_BAR).abs().to_numpy().argmin()), len(rows) - 1
        for i in (low, high):
            where = f"test {test} {model}, {100 * rows['p_bar'][i]:.0f} kPa"
            apex = rows[["apex_x_profile", "apex_y_profile"]].mean(axis=1)[i]
            yield Number(f"apex, {where}", found["apex"][i], apex, "mm", 1e-3, SOURCE_ABAQUS)
        for axis in "xy":
            ours, theirs = found[f"du_{axis}"][high], rows[f"du_{axis}_max"][high]
            what = f"largest u_{axis}, {where}"
            yield Number(what, ours, theirs, "mm", DIGITISED, SOURCE_ABAQUS, absolute=True)


def cases() -> Iterator[tuple[tuple[int, str], pd.DataFrame]]:
    """Yield test and model with the rows of the published table."""
    table = pd.read_csv(TABLE, comment="#")
    for test, model in table[["test", "model"]].drop_duplicates().itertuples(index=False):
        rows = table[(table["test"] == test) & (table["model"] == model)]
        yield (int(str(test)), str(model)), rows.reset_index(drop=True)


def shapes(rows: pd.DataFrame, elements: int, solver: Solver) -> pd.DataFrame:
    """Return apex and the largest in-plane displacements du_x, du_y (mm) at the rows' pressures."""
    warp, fill, shear = 1e3 * rows[["E1", "E2", "G12"]].iloc[0].to_numpy(float)
    law = HypoelasticLaw.linear(warp, fill, shear, 0.24, "incompressible")
    pressures = (0.1 * rows["p_bar"]).tolist()
    mesh = disk_mesh(100.0, elements, "quarter")
    steps = sorted({0.25 * pressures[0], 0.5 * pressures[0], *pressures})
    u = solver.run(BubbleModel(mesh, 0.81, pressures, steps), law).displacement
    apex, (du_x, du_y, _) = u[:, mesh.node_sets["apex"][0], 2], u.max(axis=1).T
    return pd.DataFrame({"apex": apex, "du_x": du_x, "du_y": du_y})


TABLE_MARC_BUBBLE = PUBLISHED / "marc_bubble_profiles.csv"
SOURCE_MARC_BUBBLE = "MSC Marc; Jekel et al., preprint of SMO (2016)"
#: Table 4.2, "solution", GPa.
SOLUTION = (
    -7.96788e-3, 7.10747e-1, -1.56912e-1, 2.00439e-2,
    -1.06241e1, 1.37830e1, -9.31830e-1, 1.39437e-1, -4.79622e2, 2.12650e2, -2.02028e1, 8.06350e-1,
)  # fmt: skip
STRAIN_RANGE = (0.13, 0.13, 0.13)
PRESSURES = (0.022, 0.059, 0.097, 0.132, 0.186, 0.251, 0.3)
#: Two figures of the paper disagree by 5 %, and the load stepping is not known.
ALLOWED = 0.06
ELEMENTS_MARC_BUBBLE = 800


def known_law(nu12: float = 0.24) -> HypoelasticLaw:
    """Return the law of Table 4.2."""
    return HypoelasticLaw(1e3 * np.array(SOLUTION), nu12, np.array(STRAIN_RANGE))


def known_bubble() -> BubbleModel:
    """Return a quarter of the thesis' bubble: radius 100 mm, thickness 0.81 mm, seven pressures."""
    mesh = disk_mesh(100.0, ELEMENTS_MARC_BUBBLE, "quarter")
    return BubbleModel(mesh, 0.81, PRESSURES, default_increments(PRESSURES))


def marc_bubble() -> Iterator[Number]:
    """Compare the height of the apex at the seven pressures."""
    table = pd.read_csv(TABLE_MARC_BUBBLE, comment="#")
    model = known_bubble()
    history = MembraneSolver().run(model, known_law())
    apex = history.displacement[:, model.mesh.node_sets["apex"][0], 2]
    for pressure, ours in zip(1e3 * np.array(PRESSURES), apex, strict=True):
        theirs = table[np.isclose(table["p_kPa"], pressure)]["z_mm"].max()
        what = f"apex of Table 4.2, {pressure:g} kPa"
        yield Number(what, float(ours), float(theirs), "mm", ALLOWED, SOURCE_MARC_BUBBLE)


#: Over the mean of the five, by nu12, read off the figure to three decimals.
FIGURE = {0.05: 1.029, 0.15: 1.016, 0.25: 1.0015, 0.35: 0.985, 0.45: 0.967}
#: Marc's pressure did not follow the surface (docs/validation/published-bubble.md): with dead
#: pressure ours are within 0.0005, with pressure that follows as a gas does at most 0.0070 off.
ALLOWED_POISSON = 0.0075
SOURCE_POISSON = "thesis Fig. 4.2"


def poisson_ratios() -> Iterator[Number]:
    """Compare the largest displacements, relative to the mean of the five."""
    model, largest = known_bubble(), []
    for nu12 in FIGURE:
        history = MembraneSolver().run(model, known_law(nu12))
        largest.append(float(np.linalg.norm(history.displacement[-1], axis=1).max()))
    mean = float(np.mean(largest))
    for (nu12, theirs), ours in zip(FIGURE.items(), largest, strict=True):
        what = f"largest displacement over the mean, nu12 {nu12:g}"
        yield Number(what, ours / mean, theirs, "", ALLOWED_POISSON, SOURCE_POISSON, absolute=True)


THICKNESS = 0.81
#: Table 3.1: gauge length at rest and at the end, mm; engineering strain; R^2 of the polynomial.
TABLE_3_1 = {
    "warp": (20.022, 23.329, 0.165, 0.998),
    "fill": (22.780, 28.721, 0.261, 0.959),
    "bias": (19.767, 30.734, 0.555, 0.987),
}
#: Half a unit of the last digit printed.
PRINTED = 5e-4
#: One of the fill points is not among those that were digitised: R^2 0.9576 without it.
DIGITISED_STRIPS = 2e-3
FILE = "valmex7318_load_gauge.csv"


def strips() -> Iterator[Number]:
    """Compare strains of the gauge, and end loads with the integral of the modulus."""
    for direction, (first, last, strain, _) in TABLE_3_1.items():
        model = bias_strip(first, last, THICKNESS)
        if direction != "bias":
            yarn: Literal["warp", "fill"] = "warp" if direction == "warp" else "fill"
            model = straight_strip(yarn, first, last, THICKNESS)
        history = MembraneSolver(1e-10).run(model, known_law())
        lower, upper = (model.mesh.points + history.displacement[-1])[model.mesh.node_sets["gauge"]]
        ours = float(np.linalg.norm(upper - lower)) / first - 1
        what = f"engineering strain of the gauge, {direction} strip"
        yield Number(what, ours, strain, "", PRINTED, "thesis Table 3.1", absolute=True)
        if direction != "bias":
            theirs = end_load(direction, float(np.log(last / first)))
            what = f"end load, {direction} strip of Table 4.2"
            yield Number(what, float(history.load[-1]), theirs, "N", 1e-6, "integral of E")


def measured_strips(folder: Path) -> Iterator[Number]:
    """Compare R^2 of the fourth-order polynomials through measured points; raises InputError."""
    for curve in read_load_curves(folder / FILE):
        ours = fit_load_polynomial(curve.elongation, curve.load).r_squared
        theirs = TABLE_3_1[str(curve.direction)][3]
        what = f"R^2 of the {curve.direction} polynomial"
        yield Number(what, ours, theirs, "", DIGITISED_STRIPS, "thesis Table 3.1", absolute=True)


def end_load(direction: str, strain: float) -> float:
    """Return the load (N) of a homogeneous strip of Table 4.2's law at a log strain.
    Across, d eps1 = -nu21 d eps2 with nu21 = nu12 E2/E1, and d eps2 = -nu12 d eps1. In the fill
    test E1 is held at its value at zero strain, because the warp gets shorter. A modulus is held
    beyond its strain range."""
    law = known_law()
    modulus, end = (law.E1, 0) if direction == "warp" else (law.E2, 1)
    knots = [0.0, min(strain, float(law.strain_range[end])), strain]
    stress = 0.0
    for a, b in pairwise(knots):
        x, weight = np.polynomial.legendre.leggauss(4)
        stress += 0.5 * (b - a) * float(weight @ modulus(0.5 * (a + b) + 0.5 * (b - a) * x))
    across = -law.nu12 * (strain if direction == "warp" else stress / float(law.E1(0.0)))
    return stress * WIDTH * THICKNESS * float(np.exp(across))


#: Test and model of Abaqus' bubble. Shells of 432 quads a disk are 0.3 % off at most.
CASE, ELEMENTS_CALCULIX, ALLOWED_CALCULIX = (2, "e"), 432, 3e-3


def with_calculix() -> Iterator[Number]:
    """Compare CalculiX' bars with Marc's, a bubble with Abaqus'; nothing without a usable ccx."""
    usable = next((one for one in diagnose() if one.usable), None)
    if usable is None or usable.stresses is None or usable.path is None:
        return
    yield from marc_bars(usable.stresses, "CalculiX: ")
    rows = dict(cases())[CASE]
    found = shapes(rows, ELEMENTS_CALCULIX, CalculixSolver(usable.path))
    for i in (len(rows) // 2, len(rows) - 1):
        what = f"CalculiX: apex, test {CASE[0]} {CASE[1]}, {100 * rows['p_bar'][i]:.0f} kPa"
        theirs = rows[["apex_x_profile", "apex_y_profile"]].mean(axis=1)[i]
        yield Number(what, found["apex"][i], theirs, "mm", ALLOWED_CALCULIX, SOURCE_ABAQUS)


SUBJECTS: Mapping[str, Callable[[], Iterable[Number]]] = {
    "bars": marc_bars, "hencky": hencky_membranes, "abaqus": abaqus_bubbles,
    "marc bubble": marc_bubble, "strips": strips, "thin walls": thin_walls, "bent tube": bent_tubes,
    "loaded tubes": loaded_tubes, "nu12": poisson_ratios, "calculix": with_calculix,
}  # fmt: skip


@dataclass(frozen=True, eq=False)
class Verification:
    """Numbers beside published ones by subject, none where the program for it is not here."""

    subjects: Mapping[str, Sequence[Number]]

    @property
    def missed(self) -> list[Number]:
        return [one for several in self.subjects.values() for one in several if not one.met]

    @property
    def result(self) -> dict[str, Any]:
        """Return all numbers as plain values, as the command prints them with --json."""
        rows = [
            {"subject": s, **one.row} for s, several in self.subjects.items() for one in several
        ]
        return {"ok": not self.missed, "numbers": rows}

    def table(self) -> pd.DataFrame:
        return pd.DataFrame(self.result["numbers"])


@checked
def verify(
    subjects: Sequence[str] | None = None, *, data: Path | str | None = None,
    progress: Listener = None,
    saw: Callable[[str, Sequence[Number]], None] = lambda subject, found: None,
) -> Verification:  # fmt: skip
    """Compare this installation with published numbers and closed forms; takes a few minutes.
    subjects : by name, all unless given. data : folder of the measured strips, compared at last.
    progress : receives subjects done, all, and the one that begins. saw : receives the numbers of
    each subject as it ends. InputError : no such subject."""
    chosen = list(SUBJECTS if subjects is None else subjects)
    for subject in chosen:
        check_one_of(subject, SUBJECTS, "--subject")
    every: dict[str, Callable[[], Iterable[Number]]] = {name: SUBJECTS[name] for name in chosen}
    if data is not None:
        every["measured strips"] = functools.partial(measured_strips, Path(data))
    tell, found = listener(progress), dict[str, Sequence[Number]]()
    for done, (subject, compare) in enumerate(every.items()):
        tell(done, len(every), subject)
        found[subject] = list(compare())
        saw(subject, found[subject])
    tell(len(every), len(every), "")
    return Verification(found)
