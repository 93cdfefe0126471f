"""Check what a fit or a forward analysis gives: meshes, strains, laws, drawings."""

from dataclasses import replace

import bubblefit as bf
import meshio
import numpy as np
import pytest
from bubblefit.errors import InputError, OutputError
from bubblefit.inference.comparison import Comparison, Nuisance
from bubblefit.materials.card import write_card
from bubblefit.materials.forms.base import COMPONENTS
from bubblefit.materials.law import HypoelasticLaw
from bubblefit.meshes.bubble_model import BubbleModel, default_increments
from bubblefit.meshes.cylinder_model import inflated_cylinder
from bubblefit.meshes.disk import disk_mesh
from bubblefit.meshes.strip_models import PatchModel, bias_strip, straight_strip
from bubblefit.reports import fit_page
from bubblefit.runs.verification import known_law
from bubblefit.runs.verification.closed_forms import (
    ISOTROPIC,
    RADIUS_THIN_WALLS,
    THICKNESS_THIN_WALLS,
    capped_strain,
    sphere_model,
    tube_model,
)
from bubblefit.solvers.base import History
from bubblefit.solvers.membrane.solver import MembraneSolver
from bubblefit.solvers.run_cache import from_bytes, to_bytes

from ..commands import in_process
from ..places import EXAMPLES

LAW = known_law()
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
    off = np.abs(history.strain() - strain.mean(axis=2)).max()
    assert off < 0.05 * np.abs(strain).max()


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
    expected = 0.03 * radius / (2 * THICKNESS_THIN_WALLS), np.log(radius / RADIUS_THIN_WALLS)
    assert history.stress()[-1, :, :2].mean() == pytest.approx(expected[0], rel=0.02)
    assert history.strain()[-1, :, :2].mean() == pytest.approx(expected[1], rel=0.02)
    model = tube_model(32, 8, 200.0, list(pressures))
    history, _ = ran(model, ISOTROPIC)
    near = history.mesh.points[history.mesh.quads][..., 2].min(axis=1) < 1e-6
    axial, hoop, _ = history.strain()[-1, near].mean(axis=0)
    wanted = capped_strain(ISOTROPIC, 0.03, RADIUS_THIN_WALLS, THICKNESS_THIN_WALLS)
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
    pressed = replace(history, relaxed=False).stress("points")
    assert pressed[..., :2].min() < -0.05 * most


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
        with pytest.raises(InputError, match="model: is not"):
            call()
    known = replace(bare, model=PatchModel([[1.0, 1.0]], 1.0))
    with pytest.raises(InputError, match="law: is not"):
        known.stress()
    with pytest.raises(InputError, match="at: expected 'elements' or 'points', got 'nodes'"):
        known.strain("nodes")


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
    with pytest.raises(InputError, match="draw_laws"):
        unknown.draw_laws()


def test_the_analyses_of_a_fit(together, bubble):
    found = together.history()
    assert list(found) == [c.name for c in together.problem.comparisons]
    one = found["one: warp"]
    np.testing.assert_array_equal(one.load, together.best.point.histories[0].load)
    area = 25.0 * together.thickness * np.exp(one.strain()[:, 0, 1])
    np.testing.assert_allclose(one.stress()[:, 0, 0] * area, one.load, rtol=1e-8)
    sheet = bubble.fit.history()["bubble"]
    assert sheet.stress()[-1].min(axis=0)[:2].min() > 0


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
    with pytest.raises(InputError, match="png"):
        drawing.save(tmp_path / "one.txt")


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
    kind = fit_page.report_of("strips").CHARTS["loads"]
    assert loads == kind(strips, together.tests["two"])
    for call, words in (
        (together.plot_heights, "heights"), (lambda: together.plot_loads("three"), "one, two"),
        (lambda: together.plot_residuals("three"), "one, two"),
        (lambda: together.plot_history("three"), "one: warp"),
        (lambda: together.plot_history(quantity="load"), "quantity"),
        (lambda: together.plot_history(component=3), "component"),
        (lambda: together.plot_history(frame=10**6), "frame"),
    ):  # fmt: skip
        with pytest.raises(InputError, match=words):
            call()


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
    with pytest.raises(OutputError, match="already there"):
        card.export(name, tmp_path / "python")
    assert card.export(name, tmp_path / "python", overwrite=True) == files
    with pytest.raises(InputError, match=r"abaqus-umat, .*gsa.*'nope'"):
        card.export("nope")


def test_specimens_that_differ_by_a_factor_are_fitted():
    u = np.linspace(0.1, 2.0, 20)
    loads = 20 * (700 * np.log1p(u / 20) - 750 * np.log1p(u / 20) ** 2)
    curves = {way: [(u, f * loads) for f in (0.95, 1.0, 1.02, 1.04)] for way in ("warp", "fill")}
    strips = bf.Strips(curves, gauge=20.0, match="points", increments=5)
    law = bf.Law("linear", strain_range=[0.1, 0.1, 0.1])
    fit = bf.fit([strips], law, fabric=bf.Fabric("made", 0.8), starts=1, jobs=1)
    assert np.isfinite(fit.bands()["upper_MPa"]).all() and fit.findings
