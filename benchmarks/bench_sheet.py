"""Fit computed tests of sheets that were neither flat nor taut, or on coarser quads than those."""

import functools
import json
import tempfile
import time
import warnings
from dataclasses import dataclass, replace
from pathlib import Path
from unittest.mock import patch

import numpy as np
from bubblefit.experiments.bubble.prepared import PreparedBubble
from bubblefit.experiments.bubble.targets import sample_on_mesh
from bubblefit.materials.law import HypoelasticLaw
from bubblefit.meshes.bubble_model import BubbleModel, default_increments
from bubblefit.meshes.disk import disk_mesh, disk_modes
from bubblefit.meshes.sampling import SmoothReading, sampling_matrix
from bubblefit.project.project import read_project
from bubblefit.runs.fit import fit
from bubblefit.solvers.membrane.solver import MembraneSolver
from common import THICKNESS, start_on
from scipy.spatial.transform import Rotation

PRESSURES = (0.02, 0.05, 0.09, 0.14, 0.19, 0.24)
RIM, MODES, SURFACE = 'rim = "measured"', "modes = 10\nmisfit = 0.05", 'surface = "measured"'
WAYS = {
    "flat and taut": "",
    "measured rim only": RIM,
    "modes, no rim": MODES,
    "modes, measured rim": f"{MODES}\n{RIM}",
    "measured surface, no rim": SURFACE,
    "measured surface and rim": f"{SURFACE}\n{RIM}",
    "and slack": f"{SURFACE}\n{RIM}\nslack = true",
    "modes, rim, slack": f"{MODES}\n{RIM}\nslack = true",
    "modes, rim, metric": f"{MODES}\n{RIM}\nmetric = 6",
}
#: MPa at rest and at a strain of 0.06: G12 stays, E2 falls, E1 falls more.
MODULI, STEP = np.array([12.0, 12.0, 220.0, 196.0, 300.0, 228.0]), 0.01


def surfaces(elements=112, *ways, data=0, seen=1.0):
    """Fit a computed uneven test on ELEMENTS quads in each of WAYS of [bubble.sheet].

    Six points at each node of the fit's mesh, or about as many at the nodes of another, --data.
    """
    repeats = max(1, round(6 * elements / data)) if data else 6
    with tempfile.TemporaryDirectory() as place:
        folder = Path(place)
        truth = write_test(folder, Uneven(repeats=repeats, seen=seen), PRESSURES, data or elements)
        z = truth.mesh.points[:, 2]
        print(f"z0 from {z.min():.2f} to {z.max():.2f} mm; errors of the moduli between a fifth of "
              "the strain reached and all of it")  # fmt: skip
        for name in ways or WAYS:
            path = folder / "project.toml"
            path.write_text(project_text(PRESSURES, elements, WAYS[name]))
            begun = time.perf_counter()
            # Several points at each node, the centre too, are no points without correlation.
            result = fit(read_project(path), trust=["zero-points"])
            off = errors(result.law, result.best.reached)
            numbers = result.findings["uneven"].numbers
            sheet, slack = numbers["sheet"]["surface_mm"], numbers["sheet"]["slack_percent"]
            words = "" if slack is None else f", slack {slack[0]:.3f} and {slack[1]:.3f} %"
            print(f"{name:26s} E1 {100 * off['E1']:6.1f} %  E2 {100 * off['E2']:6.1f} %  residual "
                  f"{numbers['mean_abs_mm']:.3f} mm, z0 {sheet['least']:.2f} to "
                  f"{sheet['largest']:.2f} mm{words}; G12 at rest "
                  f"{float(result.law.modulus('G12', 0.0)):.1f} MPa, {result.result['analyses']} "
                  f"analyses, {time.perf_counter() - begun:.0f} s", flush=True)  # fmt: skip


#: What [bubble.sheet] and the files of a coverage run have, by what is measured beside the field.
COVERED = {
    "flat": "",
    "surface": f"{SURFACE}",
    "rim": f"{SURFACE}\n{RIM}",
    "registration": "",
    "from_pressure": "from_pressure = 50\nmodes = 1\nprior = 0.05\nmisfit = 0.05",
}
COVERAGE_PRESSURES = (0.05, 0.12, 0.24)
#: Shares of the strain reached at which bands are looked at.
COVERED_STRAINS = (0.2, 0.5, 0.8)
FINE_QUADS = 1728


def coverage(count=20, *kinds, first=0, elements=112, noise=0.02, points=1500, to=""):
    """Fit COUNT noisy tests of each of KINDS: how often bands hold the moduli at three strains.

    Kinds: flat, surface, rim, registration, from_pressure (a reference picture taken under 50 kPa).
    Points lie at random up to 0.96 of the radius, as those of a camera do; the sheet is nearly
    flat. Data are of FINE_QUADS quads, and what the fit's mesh leaves out is taken out of them
    where they are matched. A line a field is added to the file TO, `summary` reads it.
    """
    kinds = kinds or tuple(COVERED)
    path = Path(to or tempfile.mkstemp(suffix=".jsonl")[1])
    for seed in range(first, first + count):
        for kind in kinds:
            field_record = {"kind": kind, "seed": seed}
            field_record |= deviations_of_field(kind, seed, elements, noise, points)
            with path.open("a") as file:
                file.write(json.dumps(field_record) + "\n")
    summary(path)


def summary(*paths):
    """Print what `coverage` has written to PATHS: coverage, scatter over reported sigma, bias."""
    records = [json.loads(line) for path in paths for line in Path(path).read_text().splitlines()]
    for kind in COVERED:
        of_kind = [record for record in records if record["kind"] == kind]
        for name in of_kind[0]["moduli"] if of_kind else ():
            values = np.array([record["moduli"][name] for record in of_kind])
            error, sigma, is_held = np.moveaxis(values, 1, 0)
            scatter = error.std(axis=0, ddof=1)
            root_mean = np.sqrt((sigma**2).mean(axis=0))
            shares = is_held.mean(axis=0)
            print(f"{kind:13s} {name:3s} {len(of_kind):4d} fields: held", *_percent(100 * shares),
                  "%, scatter over sigma", *_percent(scatter / root_mean, 2), ", bias over sigma",
                  *_percent(error.mean(axis=0) / root_mean, 2), ", sigma",
                  *_percent(100 * root_mean, 2), "%")  # fmt: skip


def _percent(values, digits=1):
    return [f"{value:.{digits}f}" for value in values]


RUNS = "bubblefit.runs.certainty"


@dataclass(frozen=True)
class WithoutMeshError:
    """Matches points as a fit does, less the difference of fine data and the fit's mesh."""

    sheet: "Uneven"
    elements: int

    def __call__(self, prepared):
        targets = MATCHED_POINTS.func(prepared)
        key = self.sheet.height, self.sheet.slack, self.sheet.rim, COVERAGE_PRESSURES
        fine, fine_fields = computed(*key, FINE_QUADS)
        _, coarse_fields = computed(*key, self.elements)
        reading = SmoothReading.of(fine.mesh)
        corrected = []
        for number, target in enumerate(targets):
            on_fine_mesh = replace(target, sample=sample_on_mesh(reading, target.positions))
            of_fine = on_fine_mesh.modelled_displacement(fine_fields, number)
            of_coarse = target.modelled_displacement(coarse_fields, number)
            displacement = target.displacement - (of_fine - of_coarse)
            corrected.append(replace(target, displacement=displacement))
        return corrected


MATCHED_POINTS = vars(PreparedBubble)["targets"]


def deviations_of_field(kind, seed, elements, noise, points):
    """Return relative errors, sigmas and whether bands hold the moduli of a fit, by modulus."""
    is_flat = kind in ("flat", "registration", "from_pressure")
    sheet = Uneven(
        height=0.0 if is_flat else 0.3,
        slack=0.0,
        rim=2.0 if kind == "rim" else 0.0,
        noise=noise,
        points=points,
        seed=seed,
        reach=0.96,
        in_camera=kind == "registration",
        loaded_reference=kind == "from_pressure",
    )
    with tempfile.TemporaryDirectory() as place:
        folder = Path(place)
        write_test(folder, sheet, COVERAGE_PRESSURES, FINE_QUADS)
        text = project_text(COVERAGE_PRESSURES, elements, COVERED[kind])
        # Near the truth already, the search takes less time.
        text = text.replace("30.0, 2000.0", "100.0, 600.0").replace("30.0, 1500.0", "80.0, 500.0")
        # Without it, that of a usual camera would be the least.
        text = text.replace('objective = "mm"', f'objective = "mm"\nnoise = {noise}', 1)
        if kind == "registration":
            text = text.replace("[bubble.sheet]", "[bubble.data.points.registration]", 1)
        if is_flat and kind != "registration":
            text = text.replace('columns = { z = "z" }\n', "")
        path = folder / "project.toml"
        path.write_text(text)
        has_no_mesh_error = patch(f"{RUNS}.limit_of_meshes", return_value=None)
        matching = functools.cached_property(WithoutMeshError(sheet, elements))
        matching.__set_name__(PreparedBubble, "targets")
        matched = patch.object(PreparedBubble, "targets", matching)
        with warnings.catch_warnings(), has_no_mesh_error, matched:
            warnings.simplefilter("ignore")
            result = fit(read_project(path), trust=["loaded-reference"])
    certainty = result.best.certainty
    assert certainty is not None
    moduli = {}
    for name, strain in certainty.strain.items():
        strains = strain[-1] * np.array(COVERED_STRAINS)
        true = law().modulus(name, strains)
        error = result.law.modulus(name, strains) / true - 1
        band = certainty.moduli[name]
        lower = np.interp(strains, band.strain, band.lower)
        upper = np.interp(strains, band.strain, band.upper)
        is_held = (lower <= true) & (true <= upper)
        sigma = np.interp(strains, strain, certainty.linear_sigma[name])
        moduli[name] = [error.tolist(), sigma.tolist(), is_held.astype(int).tolist()]
    noise_of_fit = certainty.noise
    return {
        "moduli": moduli,
        "level": [*noise_of_fit.level.values()],
        "correlated": [*noise_of_fit.correlated_count.values()],
    }


def law(moduli=MODULI):
    """Return the law, linear in strain and incompressible; the known one unless told."""
    beta = np.zeros(12)
    for block, (rest, end) in enumerate(moduli.reshape(3, 2)):
        beta[4 * block + 2 : 4 * block + 4] = (end - rest) / 0.06, rest
    return HypoelasticLaw(beta, 0.24, np.full(3, 0.13), "incompressible")


def field(sheet, moduli):
    return np.asarray(MembraneSolver(1e-9).run(sheet, law(moduli)).displacement)


def facets(*quads):
    """Estimate what moduli lose on QUADS quads where the measured sheet had 3,072; no noise."""
    sheet = Uneven(slack=0.0, rim=0.0, noise=0.0)
    fine = model(sheet, PRESSURES, 3072)
    height = float(fine.mesh.points[fine.mesh.node_sets["apex"][0], 2])
    seen, places = field(fine, MODULI), fine.mesh.points[:, :2]
    chosen = np.flatnonzero(np.hypot(*places.T) < 98)[::2]
    for count in map(int, quads or (112, 240, 432, 1000)):
        own = model(sheet, PRESSURES, count)
        points = np.array(own.mesh.points)  # its largest height depends on the mesh
        points[:, 2] *= height / points[own.mesh.node_sets["apex"][0], 2]
        own = replace(own, mesh=replace(own.mesh, points=points))
        here = field(own, MODULI)
        slopes = [(field(own, MODULI * (1 + STEP * one)) - here) / STEP for one in np.eye(6)]
        for name, (sample, inside) in (
            ("flat quads", sampling_matrix(own.mesh, places[chosen])),
            ("smooth", SmoothReading.of(own.mesh).matrix(places[chosen])),
        ):

            def at(values, sample=sample):
                return np.concatenate([(sample @ frame).ravel() for frame in values])

            off = at(here) - seen[:, chosen[inside]].ravel()
            found = np.linalg.lstsq(np.stack([at(s) for s in slopes], axis=1), -off)[0]
            e2, e1 = 100 * found[2:4], 100 * found[4:6]
            print(f"{len(own.mesh.quads):5d} quads, {name:10s}: misfit "
                  f"{np.sqrt(np.mean(off**2)):.3f} mm RMS; E1 {e1[0]:+6.2f} % at rest, "
                  f"{e1[1]:+6.2f} % at 0.06, E2 {e2[0]:+6.2f} %, {e2[1]:+6.2f} %",
                  flush=True)  # fmt: skip


RADIUS = 100.0


@dataclass(frozen=True)
class Uneven:
    """Faults of the sheet and of the measurement.

    height, rim : mm, scale of the surface, largest motion of the rim. slack : share of the length.
    noise : mm, of every number. repeats : points at a node. seen : of the heights, in the picture.
    seed : of the noise. reach : of the points, in radii.
    in_camera : coordinates are those of a camera that looks at the sheet askew.
    loaded_reference : the reference picture is the first frame.
    points : number of points at random places; 0 for some at each node.
    """

    height: float = 4.0
    slack: float = 0.001
    rim: float = 2.0
    noise: float = 0.05
    repeats: int = 1
    seen: float = 1.0
    seed: int = 7
    reach: float = 1.0
    in_camera: bool = False
    loaded_reference: bool = False
    points: int = 0


def model(what, pressures, elements):
    mesh = disk_mesh(RADIUS, elements)
    x, y = mesh.points[:, 0] / RADIUS, mesh.points[:, 1] / RADIUS
    modes = disk_modes(mesh.points / RADIUS, 10)
    shape = 0.8 * modes["z0_1"] - 0.9 * modes["z0_x"] + 0.7 * modes["z0_xy"] - 0.8 * modes["z0_yy"]
    # What ten modes cannot follow: a wave along the warp.
    shape += 0.12 * (1 - x**2 - y**2) * np.sin(5.0 * x + 1.0)
    shape *= what.height / np.abs(shape).max()
    points = np.column_stack([mesh.points[:, :2], shape])
    rim = mesh.points[mesh.node_sets["rim"]]
    angle = np.arctan2(rim[:, 1], rim[:, 0])
    # Slips inwards more along the warp, rises with the clamp, more on one side.
    inwards = -(0.35 + 0.25 * np.cos(2 * angle)) * what.rim
    motion = np.column_stack(
        [inwards * np.cos(angle), inwards * np.sin(angle), what.rim * (0.7 + 0.15 * np.cos(angle))]
    )
    steps = default_increments(pressures)
    share = (np.array(steps) / pressures[-1])[:, None, None]
    return BubbleModel(
        replace(mesh, points=points), THICKNESS, pressures, steps,
        slack=(what.slack, what.slack), rim_motion=share * motion,
    )  # fmt: skip


def write_test(folder, what, pressures, elements):
    truth, fields = computed(what.height, what.slack, what.rim, tuple(pressures), elements)
    random, nodes = np.random.default_rng(what.seed), truth.mesh.points
    if what.points:
        nodes, fields = between_nodes(truth.mesh, fields, what, random)

    def with_noise(values):
        return values + what.noise * random.standard_normal(values.shape)

    heights = 612.0 + with_noise(np.repeat(what.seen * nodes[:, 2:], what.repeats, axis=0))
    hidden = np.outer((1.0 - what.seen) * nodes[:, 2], [0.0, 0.0, 1.0])
    places = np.repeat(nodes[:, :2], what.repeats, axis=0)
    is_seen = np.hypot(*places.T) <= what.reach * RADIUS
    frames = [
        with_noise(np.repeat(displacement + hidden, what.repeats, axis=0))
        for displacement in fields
    ]
    positions = np.hstack([places, heights])
    if what.loaded_reference:
        reference = frames[0]
        positions = positions + np.repeat(fields[0], what.repeats, axis=0)
        frames = [frame - reference for frame in frames]
    axes = np.eye(3)
    if what.in_camera:
        axes = Rotation.from_euler("xyz", [4.0, -3.0, 25.0], degrees=True).as_matrix()
    for k, frame in enumerate(frames):
        table = np.hstack([positions @ axes.T, frame @ axes.T])[is_seen]
        path = folder / f"t_{k:02d}.csv"
        np.savetxt(path, table, "%.7f", ",", header="x,y,z,dx,dy,dz", comments="")
    return truth


@functools.lru_cache
def computed(height, slack, rim, pressures, elements):
    """Return the model of a sheet and its displacements with the known law."""
    truth = model(Uneven(height=height, slack=slack, rim=rim), pressures, elements)
    return truth, MembraneSolver().run(truth, law()).displacement


def between_nodes(mesh, fields, what, random):
    """Return random places of the sheet and their displacements; none is twice."""
    count = what.points
    angle = 2 * np.pi * random.random(count)
    radii = what.reach * RADIUS * np.sqrt(random.random(count))
    places = np.column_stack([radii * np.cos(angle), radii * np.sin(angle)])
    sample, inside = SmoothReading.of(mesh).matrix(places)
    heights = sample[inside] @ mesh.points[:, 2]
    return np.column_stack([places[inside], heights]), [(sample @ f)[inside] for f in fields]


UNEVEN = """\
fabric = {{ name = "computed", thickness = {thickness}, thickness_change = "incompressible" }}
units = {{ modulus = "MPa" }}
fit = {{ starts = 1, seed = 3, jobs = 1, max_analyses = 60, mesh_error = "told" }}

[law]
form = "linear"
strain_range = [0.13, 0.13, 0.13]
bounds = {{ E1 = [30.0, 2000.0], E2 = [30.0, 1500.0], G12 = [2.0, 100.0] }}

[[bubble]]
name = "uneven"
radius = {radius}
pressures = {pressures}
elements = {elements}
objective = "mm"

[bubble.data.points]
pattern = "t_{{index:02d}}.csv"
indices = {indices}
columns = {{ z = "z" }}

[bubble.sheet]
{sheet}
"""


def project_text(pressures, elements, sheet):
    kpa, indices = [round(1e3 * p, 6) for p in pressures], list(range(len(pressures)))
    return UNEVEN.format(thickness=THICKNESS, radius=RADIUS, pressures=kpa, indices=indices,
                          elements=elements, sheet=sheet)  # fmt: skip


def errors(fitted, ends):
    """Return the largest relative errors of E1 and E2 from a fifth of the strains reached on."""
    known, found = law(), {}
    for name, end in zip(("E1", "E2"), ends, strict=False):
        strain = np.linspace(0.2 * end, end, 41)
        ratio = fitted.modulus(name, strain) / known.modulus(name, strain)
        found[name] = float(np.abs(ratio - 1).max())
    return found


if __name__ == "__main__":
    start_on(surfaces, facets, coverage, summary)
