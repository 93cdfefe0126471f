"""solvers/calculix/cylinder.py: the inflated and bent cylinder as solids."""

import os
import subprocess
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from bubblefit.errors import SolverFailure
from bubblefit.materials.law import HypoelasticLaw
from bubblefit.meshes.closed_surfaces import enclosed_volume
from bubblefit.meshes.cylinder_model import Gas, RigidSupports, inflated_cylinder
from bubblefit.solvers.base import History, extremes, log_strain
from bubblefit.solvers.calculix import cylinder
from bubblefit.solvers.calculix.cylinder import (
    ABOVE,
    bending_context,
    bending_history,
    bent_cylinder,
    better_pressure,
    body_nodes,
    compliance,
    cylinder_decks,
    gas_pressure,
    solid_mesh,
    volumes,
)
from bubblefit.solvers.calculix.executable import increments
from bubblefit.solvers.calculix.frd import FrdFile
from bubblefit.solvers.calculix.library import law_files, material_library
from bubblefit.solvers.calculix.sheets import whole_times
from bubblefit.solvers.calculix.solver import CalculixSolver
from scipy.optimize import fsolve

from ...support.refusals import complaint, raised

THICKNESS, PRESSURE, RADIUS = 0.81, 0.14, 75.0
WARP, FILL, SHEAR = 400.0, 150.0, 30.0  # MPa
LINEAR = HypoelasticLaw(np.array([0, 0, 0, SHEAR, 0, 0, 0, FILL, 0, 0, 0, WARP], float))
CALCULIX_TEMPLATE = Path(cylinder.__file__).parents[2] / "templates" / "calculix"
#: What a template of our own asks for beside the results of each step.
FABRIC = "*EL PRINT, ELSET=MEMBRANE, TOTALS=ONLY, FREQUENCY=1\nELSE\n"
ENERGIES = {
    "*NODE OUTPUT, DOUBLE, TIME POINTS=WHOLE": FABRIC.replace("FREQUENCY=1", "TIME POINTS=WHOLE"),
    "*NODE OUTPUT, DOUBLE, FREQUENCY=1": FABRIC + "*CONTACT PRINT, FREQUENCY=1\nCELS\n",
}


def short_cylinder(size=25.0, seam=0.0, length=900.0):
    supports = RigidSupports(length / 1.5)
    return inflated_cylinder(2 * RADIUS, PRESSURE, THICKNESS, size, length, seam, supports=supports)


def closed_form(pressure):
    """Axial and hoop log strain of a long thin-walled tube with closed ends.

    Hoop stress p r / t, axial p r / 2 t, with the radius r as inflated and t as at rest.
    """
    den = 1 - LINEAR.nu12**2 * FILL / WARP
    d11, d22, d12 = WARP / den, FILL / den, LINEAR.nu12 * FILL / den

    def unbalance(strain):
        hoop = pressure * RADIUS * np.exp(strain[1]) / THICKNESS
        return [
            d11 * strain[0] + d12 * strain[1] - 0.5 * hoop,
            d12 * strain[0] + d22 * strain[1] - hoop,
        ]

    return fsolve(unbalance, [0.01, 0.05], xtol=1e-12)


def inflation_history(path, model, solids):
    displacement, _ = whole_times(path, len(model.inflation), len(solids.points))
    middle, pressure = solids.middle(displacement), np.array(model.inflation)
    return History(
        pressure, middle, *extremes(log_strain(model.mesh, middle, model.mesh.warp)),
        cavity_volume=volumes(model, middle),
    )  # fmt: skip


def inflate_in_calculix(ccx, model, folder):
    solids = solid_mesh(model)
    for name, text in (cylinder_decks(model, LINEAR, solids) | law_files(LINEAR)).items():
        (folder / name).write_text(text)
    raised(SolverFailure, "no usable results", inflation_history, folder / "job.frd", model, solids)
    libraries = {"LD_LIBRARY_PATH": str(material_library().parent), "OMP_NUM_THREADS": "1"}
    done = subprocess.run([str(ccx.path), "-i", "job"], cwd=folder, env=os.environ | libraries,
                          capture_output=True, text=True)  # fmt: skip
    assert done.returncode == 0, done.stdout[-2000:]
    return inflation_history(folder / "job.frd", model, solids)


def test_middle_of_an_inflated_tube_has_the_closed_form(ccx, tmp_path):
    model = short_cylinder(50.0)
    history = inflate_in_calculix(ccx, model, tmp_path)
    side = model.mesh.node_sets["side_line"]
    for frame, pressure in enumerate(model.inflation):
        axial, hoop = closed_form(pressure)
        at = model.mesh.points[side] + history.displacement[frame, side]
        # Of the circle with the ring's area. The gas meets the inside, half a thickness (0.5 %) in.
        radius = 0.5 * model.diameter_at(model.mesh.points + history.displacement[frame])
        assert radius == pytest.approx(RADIUS * np.exp(hoop), rel=1e-3)
        grown = np.log((at[2, 2] - at[0, 2]) / model.mesh.points[side[2], 2])
        assert grown == pytest.approx(axial, abs=3e-4)
    assert (np.diff(history.cavity_volume) > 0).all()
    np.testing.assert_array_equal(history.load, model.inflation)
    # No seam: nothing bends it.
    assert np.ptp(history.displacement[-1, model.mesh.node_sets["bottom_line"], 1][:4]) < 0.2


@pytest.fixture(scope="module")
def scratch(tmp_path_factory):
    return tmp_path_factory.mktemp("bending")


def last_run(scratch):
    return max(scratch.rglob("job.frd"), key=os.path.getmtime).parent


@pytest.fixture(scope="module")
def cylinder_bent_cylinder(ccx, scratch):
    """To 8 mm in increments of 1 mm, with energies printed by a template of our own."""
    own = scratch / "own"
    own.mkdir()
    text = (CALCULIX_TEMPLATE / "cylinder.inp.j2").read_text()
    for before, asked in ENERGIES.items():
        assert text.count(before) == 1
        text = text.replace(before, asked + before)
    (own / "cylinder.inp.j2").write_text(text)
    steps = np.arange(1.0, 9.0).tolist()
    model = replace(short_cylinder(75.0, 40.0), deflections=[3.0, 8.0], increments=steps)
    solver = CalculixSolver(ccx=ccx.path, scratch=scratch, keep=True, templates=own)
    return model, solver.run(model, LINEAR)


def energies(dat):
    """Of the fabric and of contact, N mm of the quarter, at every increment of bending."""
    found = {"internal": [], "contact": []}
    name = ""
    for line in dat.read_text().splitlines():
        words = line.split()
        if line.startswith(" contact print energy"):
            found[name := "contact"].append(0.0)
        elif line.startswith(" total internal energy"):
            found[name := "internal"].append(0.0)
        elif words and name:
            found[name][-1] += float(words[-1])
    return np.array(found["internal"]), np.array(found["contact"])


def test_work_of_collar_and_gas_is_energy_of_fabric_and_contact(cylinder_bent_cylinder, scratch):
    model, history = cylinder_bent_cylinder
    solids, folder = solid_mesh(model), last_run(scratch)
    fabric, contact = energies(folder / "job.dat")
    inside = solids.elements[solids.element_sets["inside"], :4]
    collar = body_nodes(len(solids.points))[1]
    way, force, volume, middle = [], [], [], []
    for frame in FrdFile(folder / "job.frd").frames():
        moved = frame.fields["DISP"]
        if frame.step == 2:
            position = solids.points + moved[: len(solids.points)]
            way.append(-moved[collar, 1].mean())
            force.append(-frame.fields["FORC"][collar, 1].sum())
            volume.append(enclosed_volume(position, inside))
            middle.append(4 * enclosed_volume(solids.middle(position), model.mesh.quads))
    closed = model.gas.closed_in(model.pressure, history.cavity_volume[0])
    gauge = np.array([closed.pressure(v) for v in middle])

    def work(force, way):
        return float(np.sum(0.5 * (force[1:] + force[:-1]) * np.diff(way)))

    fabric = fabric[len(model.inflation) :]
    done = work(np.array(force), way)
    gained = fabric[-1] - fabric[0] + contact[-1] - contact[0]
    assert 4 * done > 500  # N mm
    assert contact[-1] < 0.06 * done
    assert gained - work(gauge, volume) == pytest.approx(done, rel=0.005)


def test_forces_gas_and_crown_of_a_bent_cylinder(cylinder_bent_cylinder):
    model, history = cylinder_bent_cylinder
    assert history.load[0] == 0.0 and (np.diff(history.load) > 0).all() and len(history.load) == 3
    total = history.reactions["collar"] + history.reactions["supports"]
    # The tolerance of the run is 5e-3 of the mean force.
    np.testing.assert_allclose(total, 0, atol=1e-3 * history.load[-1])
    # The gas keeps its mass.
    energy = (history.cavity_pressure + model.gas.ambient) * history.cavity_volume
    np.testing.assert_allclose(energy, energy[0], rtol=1e-4)
    assert history.cavity_pressure[-1] > model.pressure
    assert any("gas: pass 2, p V constant within" in remark for remark in history.remarks)
    top = history.displacement[:, model.mesh.node_sets["top_line"][0], 1]
    behind = model.deflections - (top[0] - top[1:])
    # The crown is pressed into the springs of contact, at the few points of an element that touch:
    # 0.09 and 0.13 mm at 5 MPa/mm. A collar that touches 0.05 mm early or late is out of this.
    assert 0.05 < behind[0] < behind[1] < 0.165


def test_run_that_stops_early_keeps_its_frames(cylinder_bent_cylinder, scratch, tmp_path):
    model, history = cylinder_bent_cylinder
    solids, results = solid_mesh(model), last_run(scratch) / "job.frd"
    converged = {(i.step, i.increment) for i in increments(results.with_name("job.sta"))}
    gas = np.array([0.0]), np.array([model.pressure])
    whole = bent_cylinder(model, solids, results, 0)
    np.testing.assert_array_equal(bending_history(model, whole, gas).load, history.load)
    assert whole.deflection[-1] == pytest.approx(8.0)
    # Stopped: no end mark, and a frame of residuals that never converged.
    cut = tmp_path / "job.frd"
    data = results.read_bytes()
    cut.write_bytes(data[: data.rindex(b" 9999")])
    early = bent_cylinder(model, solids, cut, 0, converged - {max(converged)}, "it gave up")
    assert 3.0 < early.deflection[-1] < 8.0
    np.testing.assert_array_equal(early.volume, whole.volume[:-1])
    reported = bending_history(model, early, gas)
    np.testing.assert_array_equal(reported.load, history.load[:2])
    assert "the run stopped early; the last increment is at" in reported.remarks[0]
    assert reported.early == reported.remarks[0] and reported.early.endswith(": it gave up")
    assert bending_history(model, whole, gas).early == ""
    for path, given in ((cut, None), (cut, set()), (tmp_path / "none.frd", None)):
        raised(SolverFailure, "no usable results", bent_cylinder, model, solids, path, 0, given)
    # Cut anywhere it is an early end, too, or none.
    for part in (0.3, 0.9, 0.99):
        cut.write_bytes(data[: int(part * len(data))])
        try:
            found = bent_cylinder(model, solids, cut, 0, converged)
        except SolverFailure:
            continue
        np.testing.assert_array_equal(found.volume, whole.volume[: len(found.volume)])
    with pytest.raises(SolverFailure, match="before the first reported deflection"):
        bending_history(replace(model, deflections=[9.0], increments=()), whole, gas)


def test_gas_settles_in_two_passes_on_a_compliant_volume():
    volume, pressure, slope = 6e7, 0.14, 6e7
    gas = Gas().closed_in(pressure, volume)
    lost = np.array([0.0, 1e5, 4e5])
    given = np.full(3, pressure)
    gaps = []
    for _ in range(2):
        found = volume - lost + slope * (given - pressure) * (1 + 2 * (given - pressure))
        gaps.append(np.abs(gas_pressure(gas, found) - given).max())
        given = better_pressure(gas, found, given, slope)
    assert gaps[0] > 1e-3
    assert gaps[1] < 1e-5
    p, filled = np.array([0.0, 0.1, 0.14]), np.array([1.0, 1.2, 1.28])
    assert compliance(p, filled) == pytest.approx(2.0)
    curved = np.array([0.0, 0.07, 0.14])
    assert compliance(curved, 1 + curved**2) == pytest.approx(0.28)


def test_bending_has_increments_of_its_own():
    model = replace(short_cylinder(30.0, 40.0), deflections=[10.0, 40.0], increments=())
    solids = solid_mesh(model)
    flat = np.zeros_like(solids.points)
    gas = np.array([0.0, 20.0, 40.0]), np.array([0.14, 0.141, 0.142])
    context = bending_context(model, solids, flat, gas)
    deck = cylinder_decks(model, LINEAR, solids, context)["job.inp"]
    step = deck[deck.index("** Step 2") :].splitlines()
    # At rest through the first increment, then 0.5 mm down to the cylinder.
    assert "1, 42, 0.0001, 5" in step
    for line in ("0, 0", "1.5, 0", "42, 40.5", "2, 0.14", "22, 0.141", "42, 0.142"):
        assert line in deck.splitlines()
    assert "*NODE OUTPUT, DOUBLE, FREQUENCY=1" in step
    assert not any("TIME POINTS" in line for line in step if line.startswith("*NODE"))
    fine = replace(model, increments=np.arange(1.0, 41.0).tolist())
    assert bending_context(fine, solids, flat)["longest"] == 1.0


@pytest.mark.parametrize(("diameter", "size"), [(150.0, 60.0), (200.0, 80.0), (250.0, 50.0)])
def test_collar_touches_with_its_flat_faces_at_the_start(diameter, size):
    """Its faces are chords of the ring, lower than that; 0.15 mm are 0.7 % of the load at 20 mm."""
    model = inflated_cylinder(diameter, PRESSURE, THICKNESS, size, deflections=[20.0])
    solids = solid_mesh(model)
    grown = solids.points * [0.05, 0.05, 0.0]
    _, collar = bending_context(model, solids, grown)["bodies"]
    points = np.array(collar["points"])
    faces = points[np.array(collar["elements"])[:, 4:] - 1 - collar["first_node"]]
    # Its section at z = 0, through the faces' corners: straight between them.
    section = faces.reshape(-1, 3)
    section = section[section[:, 2] < 0]
    a, b, c = section[np.argsort(section[:, 0])][[0, len(section) // 2, -1], :2]
    centre = np.linalg.solve(2 * np.array([b - a, c - a]), [b @ b - a @ a, c @ c - a @ a])
    radius = 0.5 * model.collar.inner_diameter
    assert np.hypot(*(section[:, :2] - centre).T) == pytest.approx(radius, abs=1e-9)
    x, first = np.unique(section[:, 0].round(9), return_index=True)
    at = solids.points + grown
    met = at[(at[:, 1] > 0) & (at[:, 2] <= 0.5 * model.collar.length - model.collar.fillet)]
    between = np.interp(met[:, 0], x, section[first, 1]) - met[:, 1]
    assert between.min() == pytest.approx(ABOVE, abs=1e-9)
    # The ring itself would come later by what a chord lies below it, which is little.
    chord = np.hypot(*np.diff(section[first, :2], axis=0).T).max()
    below = radius - np.sqrt(radius**2 - 0.25 * chord**2)
    assert 0 < centre[1] + radius - met[:, 1].max() - ABOVE <= below < 0.05
    whole = inflated_cylinder(diameter, PRESSURE, THICKNESS, size, symmetry="full")
    solids = solid_mesh(whole)
    assert "quarter" in complaint(bending_context, whole, solids, np.zeros_like(solids.points))


# Solids


def jacobians(points, elements):
    spokes = ((0, 1, 3, 4), (1, 2, 0, 5), (2, 3, 1, 6), (3, 0, 2, 7))
    spokes += ((4, 7, 5, 0), (5, 4, 6, 1), (6, 5, 7, 2), (7, 6, 4, 3))
    b, c, d = (points[elements][:, [s[k] for s in spokes]] for k in (1, 2, 3))
    a = points[elements][:, [s[0] for s in spokes]]
    return np.linalg.det(np.stack([b - a, c - a, d - a], axis=-2)).min(axis=1)


@pytest.mark.parametrize("seam", [0.0, 40.0])
def test_solids_have_the_sections_of_the_model(seam):
    model = short_cylinder(12.0, seam)
    mesh, solids = model.mesh, solid_mesh(model)
    assert (jacobians(solids.points, solids.elements) > 0).all()
    np.testing.assert_allclose(solids.middle(solids.points), mesh.points, atol=1e-9)
    assert set(solids.elements.ravel()) == set(range(len(solids.points)))
    owners = np.concatenate([solids.element_sets[n] for n in ("tube", "caps")])
    np.testing.assert_array_equal(np.sort(owners), np.arange(len(solids.elements)))
    # A quad's solids together are as thick as the model says.
    inside = solids.elements[solids.element_sets["inside"], :4]
    outside = solids.elements[solids.element_sets["outside"], 4:]
    through = solids.points[outside].mean(axis=1) - solids.points[inside].mean(axis=1)
    away = np.abs(mesh.points[mesh.quads][:, :, 2]).max(axis=1) < mesh.points[:, 2].max()
    np.testing.assert_allclose(
        np.linalg.norm(through, axis=1)[away], model.thickness[away], rtol=0.01
    )
    # What the gas meets has no step: its pressure is in balance.
    rest = enclosed_volume(solids.points, inside)
    shift = enclosed_volume(solids.points + np.array([0.0, 10.0, 0.0]), inside)
    assert shift == pytest.approx(rest, rel=1e-12)
    for axis, name in ((0, "symmetry_x"), (2, "symmetry_z")):
        on_plane = np.flatnonzero(solids.points[:, axis] == 0)
        np.testing.assert_array_equal(solids.node_sets[name], on_plane)


def test_sections_without_solids_are_refused():
    model = short_cylinder(25.0, 40.0)
    count = len(model.thickness)
    for thickness in (np.linspace(0.8, 0.9, count), np.ones(count)):
        assert "thickness" in complaint(solid_mesh, replace(model, thickness=thickness))
