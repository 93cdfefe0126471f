"""Estimates by virtual work: first-order equilibrium, moduli and bands under noise, real tests."""

import json
from dataclasses import replace

import bubblefit as bf
import numpy as np
import pytest
from bubblefit.errors import InputError
from bubblefit.files import json_text
from bubblefit.inference.virtual_work import disk_fields
from bubblefit.materials.forms.base import COMPONENTS
from bubblefit.materials.law import HypoelasticLaw
from bubblefit.meshes.bubble_model import BubbleModel, MeasuredShape
from bubblefit.meshes.disk import disk_mesh, disk_modes
from bubblefit.runs.estimate import GAP, estimate_of, with_start
from bubblefit.runs.fit import agreement, check
from bubblefit.runs.setup import prepare_fit
from bubblefit.runs.starts import StartRecord
from bubblefit.solvers.membrane import factorisation
from bubblefit.solvers.membrane.solver import MembraneSolver

from ..commands import in_process
from ..places import EXAMPLES, KNOWN
from ..projects import edited, project_file, small

LAW = HypoelasticLaw.linear(400.0, 250.0, 12.0)
PRESSURES = (0.05, 0.1)


@pytest.fixture(scope="module")
def model():
    mesh = disk_mesh(100.0, 60, "quarter")
    modes = disk_modes(mesh.points[:, :2], 100.0, 1)
    return BubbleModel(mesh, 0.8, PRESSURES, modes=modes)


def shape_of(model, moved, fields=None):
    if fields is None:  # everything that is not held
        fields = np.delete(np.eye(model.mesh.points.size), model.fixed, axis=1)
    return MeasuredShape.of(model, moved, fields)


@pytest.mark.parametrize("band", [factorisation.LARGEST_BAND, 0])
def test_the_step_to_equilibrium_is_that_of_newton(model, band, monkeypatch):
    monkeypatch.setattr(factorisation, "LARGEST_BAND", band)
    here, slope = MembraneSolver(1e-12).run_with_sensitivity(model, LAW)
    solver, shape = MembraneSolver(), shape_of(model, here.displacement)
    history, by = solver.run_with_sensitivity(shape, LAW)
    assert np.abs(history.displacement).max() < 1e-7
    # At the equilibrium of the first frame the derivatives are those of the solution; later ones
    # have in the solution what the law remembers, which is nothing where moduli are constant.
    np.testing.assert_allclose(by[0], slope[0], atol=1e-6 * np.abs(slope[0]).max())
    np.testing.assert_allclose(by[1], slope[1], atol=2e-3 * np.abs(slope[1]).max())
    softer = replace(LAW, beta=LAW.beta * 0.999)
    moved = MembraneSolver(1e-12).run(model, softer).displacement - here.displacement
    step = solver.run(shape, softer).displacement
    np.testing.assert_allclose(step, moved, atol=3e-3 * np.abs(moved).max())


@pytest.mark.parametrize("name, by", [
    ("beta_3", 1e-3), ("beta_11", 0.1), ("nu12", 1e-4), ("pressure_offset", 1e-6), ("z0_1", 1e-3)
])  # fmt: skip
def test_derivatives_of_the_step_follow_differences_at_equilibrium(model, name, by):
    solver = MembraneSolver(1e-12)
    shape = shape_of(model, solver.run(model, LAW).displacement)
    _, slope = solver.run_with_sensitivity(shape, LAW, [name])
    ends = []
    for step in (by, -by):
        law, place = LAW, shape
        if name.startswith("beta"):
            law = replace(LAW, beta=LAW.beta + step * np.eye(12)[int(name[5:])])
        elif name == "nu12":
            law = replace(LAW, nu12=LAW.nu12 + step)
        else:
            place = shape.with_parameters({name: step})
        ends.append(solver.run(place, law).displacement)
    difference = (ends[0] - ends[1]) / (2 * by)
    np.testing.assert_allclose(slope[..., 0], difference, atol=1e-4 * np.abs(difference).max())


def test_fields_vanish_on_the_rim_and_are_symmetric():
    turn = np.linspace(0, 2 * np.pi, 7)
    rim = np.column_stack([np.cos(turn), np.sin(turn)])
    assert all(np.abs(shape).max() < 1e-12 for shape in disk_fields(rim))
    inside = 0.7 * rim + 0.01
    for axis in (0, 1):
        mirror = inside * np.where(np.arange(2) == axis, -1.0, 1.0)
        for k, (own, other) in enumerate(
            zip(disk_fields(inside), disk_fields(mirror), strict=True)
        ):
            np.testing.assert_allclose(own * (-1.0 if k == axis else 1.0), other, atol=1e-12)
    assert [shape.shape[1] for shape in disk_fields(inside)] == [10, 10, 10]


@pytest.fixture(scope="module")
def known():
    project = bf.read_project(KNOWN)
    return prepare_fit(project, project.chosen(None, fitted=True))


def noisy(setup, sigma, seed):
    """The known solution with white noise that the test says."""
    random, (prepared,) = np.random.default_rng(seed), setup.tests
    fields = tuple(
        replace(f, displacement=f.displacement + sigma * random.standard_normal((len(f.points), 3)))
        for f in prepared.fields
    )
    test = replace(prepared.test, noise=sigma)
    return replace(setup, tests=(replace(prepared, fields=fields, test=test),))


def errors(found, truth):
    """Relative errors along the strains reached, by modulus, and whether bands have the truth."""
    off, inside = {}, {}
    for name, component in COMPONENTS.items():
        strain = np.linspace(0.0, found.best.valid[component], 31)
        true, own = truth.modulus(name, strain), found.law.modulus(name, strain)
        low, high = found.best.certainty.ends(name, strain, own)
        off[name] = np.abs(own / true - 1.0)
        inside[name] = np.mean((low <= true) & (true <= high))
    return off, inside


def test_the_known_solution_without_noise(known):
    found = estimate_of(known)
    off, _ = errors(found, known.tests[0].known)
    assert off["E1"].max() < 1e-3 and off["E2"].max() < 2e-3 and np.median(off["G12"]) < 0.01
    assert found.problem.analyses < 20 and found.gaps[0].chi < 0.2


def test_noise_and_bands(known):
    every = [noisy(known, 0.03, seed) for seed in range(12)]
    found = [estimate_of(setup) for setup in every]
    offs, insides = zip(*(errors(f, known.tests[0].known) for f in found), strict=True)
    for name, most in (("E1", 0.006), ("E2", 0.012), ("G12", 0.15)):
        assert np.median([np.median(off[name]) for off in offs]) < most
        assert np.mean([inside[name] for inside in insides]) > 0.8
    assert 0.9 < np.mean([f.gaps[0].chi for f in found]) < 1.1


def test_biaxial_paths_and_strips_are_estimated_from(strips_project):
    path = EXAMPLES / "biaxial-computed" / "project.toml"
    found = bf.estimate(bf.read_project(path))
    off, _ = errors(found, bf.fit(bf.read_project(path), starts=1, jobs=1).law)
    assert np.median(off["E1"]) < 0.05 and np.median(off["E2"]) < 0.02
    fitted = bf.fit(strips_project, starts=1, jobs=1).law
    law = bf.estimate(strips_project).law
    for name in ("E1", "E2"):
        assert law.modulus(name, 0.01) == pytest.approx(fitted.modulus(name, 0.01), rel=0.1)


def test_the_command_and_the_page_of_check(tmp_path):
    path = project_file(tmp_path, KNOWN.read_text(), ("elements = 800", "elements = 240"))
    result = json.loads(in_process("estimate", str(path), "--json", cwd=tmp_path).stdout)
    own = json.loads(json_text(bf.estimate(bf.read_project(path)).result))
    assert {**own, "cpu_s": 0} == {**result, "cpu_s": 0}
    assert {"E1", "E2", "G12"} == set(result["moduli"]) and result["chi"]["bubble"] < 1
    assert "chi" in in_process("estimate", str(path), cwd=tmp_path).stdout
    found = check(bf.read_project(path))
    page = found.report(tmp_path / "out").read_text()
    assert "An estimate by virtual work" in page and (tmp_path / "out/equilibrium.png").exists()
    assert found.result["estimate"]["chi"] == pytest.approx(result["chi"])


def test_no_shape_is_known_under_a_first_pressure(tmp_path):
    project = edited(
        tmp_path, "[bubble.nuisance]", "[bubble.sheet]\nfrom_pressure = 59\n\n[bubble.nuisance]"
    )
    with pytest.raises(InputError, match="from_pressure"):
        bf.estimate(project)
    # Then all starts are random.
    project = project.with_fit(starts_from="estimate")
    setup = prepare_fit(project, project.chosen(None, fitted=True))
    assert with_start(setup) is setup


def test_real_tests_start_a_fit_and_doubt_it(shared_data, tmp_path):
    text = (EXAMPLES / "bubble-valmex7318" / "test1-linear.toml").read_text()
    path = project_file(tmp_path, text)
    found = bf.estimate(bf.read_project(path, shared_data / "bubble"))
    (gap,) = found.gaps
    assert 10 < gap.chi < 500 and 0.3 < np.linalg.norm(gap.field, axis=1).max() < 10
    assert found.problem.analyses < 40 and GAP in [note.kind for note in found.notes]


def test_a_finer_mesh_begins_at_the_equilibrium_of_the_coarse_one(tmp_path):
    sheet = "[bubble.sheet]\nmodes = 1\n\n[bubble.nuisance]"
    project = bf.read_project(small(tmp_path, ("[bubble.nuisance]", sheet)))
    setup = prepare_fit(project, project.chosen(None, fitted=True))
    problem, (prepared,) = setup.problem(), setup.tests
    (own,) = problem.comparisons
    (finer,) = replace(prepared, by_this_model=False).finer(
        setup.make_solver, setup.weightings[0], 2.0
    )
    nuisance = {n.name: 3.0 * (-1) ** k for k, n in enumerate(own.nuisance)}
    law, free = prepared.known, problem.unknowns.free
    beside = own.run(law, free, nuisance, False)
    cold, led = (finer.run(law, free, nuisance, False, one) for one in (None, beside))
    assert np.abs(cold.path - led.path).max() < 1e-6 * np.abs(cold.path).max()


def test_one_start_begins_at_the_estimate_and_all_agree(tmp_path):
    path = project_file(tmp_path, KNOWN.read_text(), ("elements = 800", "elements = 240"))
    found = bf.fit(bf.read_project(path), starts=3, starts_from="estimate", jobs=1)
    first, *others = found.best.records
    assert first.analyses < min(one.analyses for one in others)
    assert "all 3" in found.agreement and "estimate" in found.agreement
    assert found.objective < 1e-6


def record(number, objective, beta):
    return StartRecord(
        number, (1, number), objective, "converged", 9, beta, beta, 1.0, reached=(0.1, 0.1, 0.1)
    )


def test_starts_that_differ_are_said_to_want_more(known):
    problem, project = known.problem(), known.project
    one, other = (tuple(size * np.ones(problem.unknowns.count)) for size in (1.0, 1.2))
    records = [record(0, 0.1, one), record(1, 0.2, other), record(2, 0.2, other)]
    assert "only one of 3" in agreement(problem, records, project)
    assert "2 of 3" in agreement(problem, [*records[1:], record(0, 0.3, one)], project)
    # Moduli that nothing determines may differ.
    assert "all 2" in agreement(problem, [record(0, 0.1, one), record(1, 0.1, other)], project)
    assert agreement(problem, records[:1], project) == ""
