"""Meshes, strains, laws and drawings of a fit or a forward analysis; estimates before it."""

import json
from dataclasses import replace

import bubblefit as bf
import meshio
import numpy as np
import pytest
from bubblefit.errors import InputError, OutputError
from bubblefit.inference.comparison import Comparison
from bubblefit.inference.nuisance import Nuisance
from bubblefit.inference.virtual_work import disk_fields
from bubblefit.materials.card import write_card
from bubblefit.materials.forms.base import COMPONENTS
from bubblefit.materials.law import HypoelasticLaw
from bubblefit.meshes.bubble_model import BubbleModel, MeasuredShape, default_increments
from bubblefit.meshes.cylinder_model import inflated_cylinder
from bubblefit.meshes.disk import disk_mesh
from bubblefit.meshes.disk_modes import disk_modes
from bubblefit.meshes.strip_models import PatchModel, bias_strip, straight_strip
from bubblefit.reports.presenter import page_presenter_of
from bubblefit.runs.check import check
from bubblefit.runs.estimate import GAP, estimate_of, with_start
from bubblefit.runs.multistart import agreement
from bubblefit.runs.starts import StartRecord
from bubblefit.runs.verification.thesis_bubble import table_4_2_law
from bubblefit.runs.verification.thin_walls import (
    ISOTROPIC,
    RADIUS,
    THICKNESS,
    capped_strain,
    sphere_model,
    tube_model,
)
from bubblefit.solvers.base import History
from bubblefit.solvers.membrane import factorisation
from bubblefit.solvers.membrane.solver import MembraneSolver
from bubblefit.solvers.run_cache import from_bytes, to_bytes
from bubblefit.storage.plain_values import json_text

from ..builders.projects import edited_project, fit_setup, known_bubble, project_file
from ..support.commands import in_process
from ..support.paths import EXAMPLES, KNOWN
from ..support.refusals import raised

LAW = table_4_2_law()
PRESSURES = (0.022, 0.1, 0.3)
MODELS = {
    "bubble": BubbleModel(
        replace(m := disk_mesh(100.0, 48, "quarter"), points=m.points + np.array([0, 0, 0.5])),
        0.81, PRESSURES, default_increments(PRESSURES), slack=(0.002, 0.001),
    ),
    "fill": straight_strip("fill", 20.0, 23.3, 0.81, increments=20),
    "bias": bias_strip(20.0, 26.0, 0.81, increments=10, across=4, along=9),
    "tube": tube_model(16, 2, 40.0, [0.005, 0.01], caps=False),
}  # fmt: skip


def ran(model, law, solver=None):
    solver = solver or MembraneSolver(1e-9)
    return replace(solver.run(model, law), model=model, law=law), solver._prepared[1]


@pytest.mark.parametrize("name", MODELS)
def test_strain_and_stress_are_those_of_the_solver(name):
    law = ISOTROPIC if name == "tube" else LAW
    history, membrane = ran(MODELS[name], law)
    strain, stress = history.strain("points"), history.stress("points")
    np.testing.assert_allclose(strain[-1], membrane.strain_old, atol=1e-13)
    np.testing.assert_allclose(stress[-1], membrane.stress_old, atol=1e-9)
    whole = history if history.path is None else replace(history, displacement=history.path)
    flat = whole.strain("points").reshape(-1, 3)
    np.testing.assert_allclose(flat.max(axis=0).clip(min=0), history.strain_max, atol=1e-13)
    np.testing.assert_allclose(flat.min(axis=0).clip(max=0), history.strain_min, atol=1e-13)
    frames, quads = len(history.load), len(history.mesh.quads)
    assert history.strain().shape == history.stress().shape == (frames, quads, 3)
    assert strain.shape == stress.shape == (frames, quads, 4, 3)
    # Between the Gauss points, to what their mean differs from the middle by.
    assert np.abs(history.strain() - strain.mean(axis=2)).max() < 0.05 * np.abs(strain).max()


def test_a_bar_in_closed_form():
    model = straight_strip("warp", 20.0, 22.4, 0.81, increments=3)
    history, _ = ran(model, LAW)
    strain = np.log1p(np.array(model.elongations) / 20.0)
    across = -LAW.nu12 * (LAW.E2(0.0) / LAW.E1(0.0))  # the fill is pressed: E2 is that at rest
    np.testing.assert_allclose(history.strain()[:, :, 0], strain[:, None] + np.zeros(40), atol=1e-9)
    x, weight = np.polynomial.legendre.leggauss(8)
    pull = [0.5 * e * float(weight @ LAW.E1(0.5 * e * (1 + x))) for e in strain]
    stress = history.stress()
    np.testing.assert_allclose(stress[..., 0], np.array(pull)[:, None] + np.zeros(40), rtol=1e-9)
    assert np.abs(stress[..., 1:]).max() < 1e-8 and across < 0
    area = 25.0 * 0.81 * np.exp(history.strain()[:, 0, 1])
    np.testing.assert_allclose(history.load, stress[:, 0, 0] * area, rtol=1e-9)


def test_a_patch_carries_its_loads():
    loads = np.array([[5.0, 2.0], [12.0, 4.0]])
    history, _ = ran(PatchModel(loads, 0.8), LAW)
    stretch = np.exp(history.strain()[:, 0, 1::-1])  # of the width that each load crosses
    np.testing.assert_allclose(history.stress()[:, 0, :2] * 0.8 * stretch, loads, rtol=2e-3)


def test_a_sphere_and_a_capped_tube_in_closed_form():
    pressures = np.linspace(0.01, 0.03, 3)
    history, _ = ran(sphere_model(6, list(pressures)), ISOTROPIC)
    radius = np.linalg.norm(history.mesh.points + history.displacement[-1], axis=1).mean()
    expected = 0.03 * radius / (2 * THICKNESS), np.log(radius / RADIUS)
    assert history.stress()[-1, :, :2].mean() == pytest.approx(expected[0], rel=0.02)
    assert history.strain()[-1, :, :2].mean() == pytest.approx(expected[1], rel=0.02)
    history, _ = ran(tube_model(32, 8, 200.0, list(pressures)), ISOTROPIC)
    near = history.mesh.points[history.mesh.quads][..., 2].min(axis=1) < 1e-6
    axial, hoop, _ = history.strain()[-1, near].mean(axis=0)
    wanted = capped_strain(ISOTROPIC, 0.03, RADIUS, THICKNESS)
    assert (axial, hoop) == pytest.approx(tuple(wanted), rel=0.02)


def test_a_wrinkled_beam_carries_no_compression():
    way = np.arange(10.0, 61.0, 10.0)
    model = inflated_cylinder(150.0, 0.09, 0.81, 60.0, deflections=way)
    history, membrane = ran(model, LAW, MembraneSolver(1e-9, wall="tension field"))
    assert history.relaxed and history.wrinkled[-1] > 0
    again = from_bytes(to_bytes(history, "key", 1.0), "key")
    assert again.relaxed and again.model is None
    stress = history.stress("points")
    mean, half = stress[..., :2].mean(axis=-1), 0.5 * (stress[..., 0] - stress[..., 1])
    least = mean - np.hypot(half, stress[..., 2])
    most = np.abs(stress).max()
    assert least.min() > -1e-9 * most
    # The first frame is reached in one step: the increments of the inflation are not kept.
    np.testing.assert_allclose(stress[0], membrane.stress_old, atol=3e-3 * most)
    assert replace(history, relaxed=False).stress("points")[..., :2].min() < -0.05 * most


def test_a_mesh_goes_to_a_file_and_back(tmp_path):
    project = bf.read_project(EXAMPLES / "batch" / "project.toml")
    law = HypoelasticLaw.linear(800.0, 400.0, 80.0)
    histories = bf.simulate(project.tests["bubble"], bf.MaterialCard(law, 0.81))
    assert list(histories) == ["bubble"] and isinstance(histories, dict)
    history = histories["bubble"]
    for frame in (0, -1):
        history.to_meshio(frame).write(tmp_path / "sheet.vtu")
        grid = meshio.read(tmp_path / "sheet.vtu")
        u = history.displacement[frame]
        np.testing.assert_allclose(grid.points - grid.point_data["displacement"],
                                   history.mesh.points, atol=1e-12)  # fmt: skip
        np.testing.assert_array_equal(grid.point_data["displacement"], u)
        np.testing.assert_array_equal(grid.cells_dict["quad"], history.mesh.quads)
        (strain,), (stress,) = grid.cell_data.values()
        np.testing.assert_array_equal(strain, history.strain()[frame])
        np.testing.assert_array_equal(stress, history.stress()[frame])


def test_what_a_history_cannot_say():
    bare = History(np.ones(1), np.zeros((1, 4, 3)), np.zeros(3), np.zeros(3))
    for call in (bare.strain, bare.stress, bare.to_meshio):
        raised(InputError, "model: is not", call)
    known = replace(bare, model=PatchModel([[1.0, 1.0]], 1.0))
    raised(InputError, "law: is not", known.stress)
    raised(InputError, "at: expected 'elements' or 'points', got 'nodes'", known.strain, "nodes")


def test_a_fitted_thickness_is_not_added_twice():
    one = Nuisance("thickness", 0.5, 1.0, "mm", "thickness", start=0.81, shared=True)
    comparison = Comparison("one", MODELS["fill"], MembraneSolver(), None, (one,))
    assert comparison.model_at({"thickness": 0.9}).thickness == pytest.approx(0.9)


def test_laws_drawn_agree_with_the_band(together):
    laws = together.draw_laws(1500, seed=1)
    first, again, other = (together.draw_laws(3, seed=s)[0].beta for s in (1, 1, 2))
    np.testing.assert_array_equal(first, again)
    assert np.abs(first - other).max() > 0 and len(laws) == 1500
    for name, own in together.bands().groupby("modulus"):
        row = own.iloc[len(own) // 2]
        moduli = np.array([float(law.modulus(name, row["strain"])) for law in laws])
        inside = np.mean((moduli >= row["lower_MPa"]) & (moduli <= row["upper_MPa"]))
        assert inside == pytest.approx(0.95, abs=0.02), name
        ends = np.quantile(moduli, [0.025, 0.975])
        wide = row["upper_MPa"] - row["lower_MPa"]
        assert np.abs(ends - row[["lower_MPa", "upper_MPa"]].to_numpy(float)).max() < 0.1 * wide
    unknown = replace(together, best=replace(together.best, certainty=None))
    raised(InputError, "draw_laws", unknown.draw_laws)


def test_the_analyses_of_a_fit(together, bubble):
    found = together.history()
    assert list(found) == [c.name for c in together.problem.comparisons]
    one = found["one: warp"]
    np.testing.assert_array_equal(one.load, together.best.point.histories[0].load)
    area = 25.0 * together.thickness * np.exp(one.strain()[:, 0, 1])
    np.testing.assert_allclose(one.stress()[:, 0, 0] * area, one.load, rtol=1e-8)
    assert bubble.fit.history()["bubble"].stress()[-1].min(axis=0)[:2].min() > 0


DRAWN = ("moduli", "starts", "residuals", "heights", "history")


@pytest.mark.parametrize("what", DRAWN)
def test_drawings_are_those_of_the_page(bubble, tmp_path, what):
    drawing = getattr(bubble.fit, f"plot_{what}")()
    bundle = drawing._repr_mimebundle_()
    assert bundle["application/vnd.vega.v6+json"] == drawing.spec
    assert drawing.spec["$schema"].endswith("v6.json") and bundle["image/svg+xml"].startswith(
        "<svg"
    )
    assert drawing.save(tmp_path / "one.svg").read_text().startswith("<svg")
    of_page = [charts.charts for charts in bubble.drawn]
    if what in ("moduli", "starts", "heights"):
        assert drawing.charts.charts in of_page
    raised(InputError, "png", drawing.save, tmp_path / "one.txt")


def test_drawings_of_loads_and_of_one_test(together):
    table = together.residuals()
    for test in (None, "two"):
        (chart,) = together.plot_residuals(test).charts.charts
        own = table if test is None else table[table["test"] == test]
        assert sum(len(s.x) for s in chart.series) == len(own)
        (_, first), *_ = own.groupby(["test", "part"], sort=False)
        assert chart.series[0].y == pytest.approx(first["difference"].tolist(), rel=1e-4)
    strips = together.setup.tests[1]
    loads = together.plot_loads("two").charts
    kind = page_presenter_of("strips").charts["loads"]
    assert loads == kind(strips, together.tests["two"])
    for call, words in (
        (together.plot_heights, "heights"), (lambda: together.plot_loads("three"), "one, two"),
        (lambda: together.plot_residuals("three"), "one, two"),
        (lambda: together.plot_history("three"), "one: warp"),
        (lambda: together.plot_history(quantity="load"), "quantity"),
        (lambda: together.plot_history(component=3), "component"),
        (lambda: together.plot_history(frame=10**6), "frame"),
    ):  # fmt: skip
        raised(InputError, words, call)


def test_tables_in_notebooks_are_escaped(together, strips_project):
    evil = replace(strips_project.fabric, name="<script>&")
    setup = replace(together.setup, project=replace(strips_project, fabric=evil))
    fit = replace(together, setup=setup)
    for thing in (fit, fit.card, fit.law, bf.check(setup.project)):
        text = thing._repr_html_()
        assert "<script" not in text and text.startswith("<table>") and text.endswith("</table>")
        assert ("&lt;script&gt;&amp;" in text) == (thing is not fit.law)
    answers = {
        row["modulus"]: row for _, row in fit.moduli().groupby("modulus").nth([-1]).iterrows()
    }
    for name in COMPONENTS:
        assert f"<td>{answers[name]['MPa']:.4g}</td>" in fit._repr_html_()
        assert f"<td>{answers[name]['MPa']:.4g}</td>" in fit.card._repr_html_()


def test_a_card_exports_as_the_command(together, tmp_path):
    name = "csv"
    write_card(together.card, tmp_path / "material.toml")
    in_process("export", "material.toml", "--format", name, cwd=tmp_path)
    card = bf.read_card(tmp_path / "material.toml")
    files = card.export(name, tmp_path / "python")
    assert files and {f.parent for f in files} == {tmp_path / "python"}
    for file in files:
        assert file.read_bytes() == (tmp_path / file.name).read_bytes()
    raised(OutputError, "already there", card.export, name, tmp_path / "python")
    assert card.export(name, tmp_path / "python", overwrite=True) == files
    raised(InputError, r"abaqus-umat, .*gsa.*'nope'", card.export, "nope")


def test_specimens_that_differ_by_a_factor_are_fitted():
    u = np.linspace(0.1, 2.0, 20)
    loads = 20 * (700 * np.log1p(u / 20) - 750 * np.log1p(u / 20) ** 2)
    curves = {way: [(u, f * loads) for f in (0.95, 1.0, 1.02, 1.04)] for way in ("warp", "fill")}
    strips = bf.Strips(curves, gauge=20.0, match="points", increments=5)
    law = bf.Law("linear", strain_range=[0.1, 0.1, 0.1])
    fit = bf.fit([strips], law, fabric=bf.Fabric("made", 0.8), starts=1, jobs=1)
    assert np.isfinite(fit.bands()["upper_MPa"]).all() and fit.findings


KNOWN_LAW = HypoelasticLaw.linear(400.0, 250.0, 12.0)
RISING = (0.05, 0.1)


@pytest.fixture(scope="module")
def model():
    mesh = disk_mesh(100.0, 60, "quarter")
    return BubbleModel(mesh, 0.8, RISING, modes=disk_modes(mesh.points[:, :2], 100.0, 1))


def shape_of(model, moved, fields=None):
    if fields is None:  # everything that is not held
        fields = np.delete(np.eye(model.mesh.points.size), model.fixed, axis=1)
    return MeasuredShape.of(model, moved, fields)


@pytest.mark.parametrize("band", [factorisation.LARGEST_BAND, 0])
def test_the_step_to_equilibrium_is_that_of_newton(model, band, monkeypatch):
    monkeypatch.setattr(factorisation, "LARGEST_BAND", band)
    here, slope = MembraneSolver(1e-12).run_with_sensitivity(model, KNOWN_LAW)
    solver, shape = MembraneSolver(), shape_of(model, here.displacement)
    history, by = solver.run_with_sensitivity(shape, KNOWN_LAW)
    assert np.abs(history.displacement).max() < 1e-7
    # At the equilibrium of the first frame the derivatives are those of the solution; later ones
    # have in the solution what the law remembers, which is nothing where moduli are constant.
    np.testing.assert_allclose(by[0], slope[0], atol=1e-6 * np.abs(slope[0]).max())
    np.testing.assert_allclose(by[1], slope[1], atol=2e-3 * np.abs(slope[1]).max())
    softer = replace(KNOWN_LAW, beta=KNOWN_LAW.beta * 0.999)
    moved = MembraneSolver(1e-12).run(model, softer).displacement - here.displacement
    step = solver.run(shape, softer).displacement
    np.testing.assert_allclose(step, moved, atol=3e-3 * np.abs(moved).max())


@pytest.mark.parametrize("name, by", [
    ("beta_3", 1e-3), ("beta_11", 0.1), ("nu12", 1e-4), ("pressure_offset", 1e-6), ("z0_1", 1e-3)
])  # fmt: skip
def test_derivatives_of_the_step_follow_differences_at_equilibrium(model, name, by):
    solver = MembraneSolver(1e-12)
    shape = shape_of(model, solver.run(model, KNOWN_LAW).displacement)
    _, slope = solver.run_with_sensitivity(shape, KNOWN_LAW, [name])
    ends = []
    for step in (by, -by):
        law, place = KNOWN_LAW, shape
        if name.startswith("beta"):
            law = replace(KNOWN_LAW, beta=KNOWN_LAW.beta + step * np.eye(12)[int(name[5:])])
        elif name == "nu12":
            law = replace(KNOWN_LAW, nu12=KNOWN_LAW.nu12 + step)
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
    return fit_setup(KNOWN)


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
        low, high = found.best.certainty.at(found.law, name, strain).band
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
    project = edited_project(
        tmp_path, "[bubble.nuisance]", "[bubble.sheet]\nfrom_pressure = 59\n\n[bubble.nuisance]"
    )
    raised(InputError, "from_pressure", bf.estimate, project)
    # Then all starts are random.
    project = project.with_fit(starts_from="estimate")
    setup = fit_setup(project)
    assert with_start(setup) is setup


def test_real_tests_start_a_fit_and_doubt_it(shared_data, tmp_path):
    text = (EXAMPLES / "bubble-valmex7318" / "test1-linear.toml").read_text()
    found = bf.estimate(bf.read_project(project_file(tmp_path, text), shared_data / "bubble"))
    (gap,) = found.gaps
    assert 10 < gap.chi < 500 and 0.3 < np.linalg.norm(gap.displacement, axis=1).max() < 10
    assert found.problem.analyses < 40 and GAP in [note.kind for note in found.notes]


def test_a_finer_mesh_begins_at_the_equilibrium_of_the_coarse_one(tmp_path):
    sheet = "[bubble.sheet]\nmodes = 1\n\n[bubble.nuisance]"
    setup = fit_setup(known_bubble(tmp_path, ("[bubble.nuisance]", sheet)))
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
    shared = [*records, replace(records[1], number=3, same_as=1)]
    shared[0] = record(0, 0.3, one)
    said = "3 of 4 starts end in the best of 2 distinct optima; 1 of all 4 are compared"
    assert agreement(problem, shared, project).startswith(said)
