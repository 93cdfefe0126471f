"""runs/fit.py: fits as a whole, and a loaded reference picture beside a sheet at rest."""

import re
from types import SimpleNamespace

import bubblefit as bf
import numpy as np
import pandas as pd
import pytest
from bubblefit.experiments.base import Alternative
from bubblefit.experiments.bubble.frame_doubts import LOADED_REFERENCE
from bubblefit.inference.noise import Misfit
from bubblefit.materials.card import read_card
from bubblefit.meshes.bubble_model import BubbleModel
from bubblefit.meshes.disk import disk_mesh
from bubblefit.reports.content import read_page_data
from bubblefit.reports.maps import Maps, Solid
from bubblefit.runs.fit import NOT_BETTER, AlternativeFit, AlternativeFits
from bubblefit.runs.starts import EvaluationRecord, StartRecord
from bubblefit.solvers.membrane.solver import MembraneSolver

from ..builders.bubbles import DOUBTED_LAW, THICKNESS
from ..builders.projects import constant_strips, known_bubble
from ..builders.unknowns import FIT
from ..builders.unknowns import project as project_with_unknowns
from ..support.commands import in_process, result_in

SECOND = """
[[bubble]]
name = "softer reading"
radius = 80.0
pressures = [40, 120]
elements = 48
symmetry = "quarter"
nuisance = { displacement_offset = true }
[bubble.data.known_solution]
beta = [
    -7.96788e-3, 7.10747e-1, -1.56912e-1, 2.00439e-2,
    -1.06241e1,  1.37830e1,  -9.31830e-1, 1.39437e-1,
    -4.79622e2,  2.12650e2,  -2.02028e1,  8.06350e-1,
]

[fit]"""


def test_objective_is_the_same_in_result_card_page_and_events(fitted, bubble):
    said = result_in(bubble.out)
    assert said["objective"] == fitted.objective == fitted.best.point.value
    assert min(s["objective"] for s in said["starts"]) == fitted.objective
    assert f"objective {fitted.objective:.4g}" in fitted.card.source
    assert f"{fitted.objective:.3g}" in bubble.page
    assert fitted.starts()["objective"].min() == fitted.objective
    starts = [r for r in bubble.heard if isinstance(r, StartRecord)]
    analyses = sum(isinstance(r, EvaluationRecord) for r in bubble.heard)
    assert analyses == sum(s.analyses for s in starts) == fitted.result["analyses"]


def maps_and_surface_say_what_the_table_says(fit, folder):
    """Of the first bubble: every value of the page beside residuals.csv and the history."""
    parts = list(read_page_data(folder).parts)
    (maps,) = [p for p in parts if isinstance(p, Maps) and p.name == "bubble 1 maps"]
    (solid,) = [p for p in parts if isinstance(p, Solid) and p.name == "bubble 1 bubble"]
    table = fit.residuals().query("test == 'bubble 1'")
    assert len(maps.panels) == 9 and sum(maps.counts) == len(table) // 3
    for panel in maps.panels:
        quantity, what = panel.name.split(", ")
        column = "difference" if "−" in what else {"known": "measured"}.get(what, what)
        own = table[table["quantity"] == quantity][column].to_numpy()
        np.testing.assert_allclose(panel.values.values, own, atol=0.51 * panel.values.step + 1e-9)
    history = fit.tests["bubble 1"].histories[0]
    heights = [float(u[:, 2].max()) for u in history.displacement]
    assert solid.points.values[..., 2].max(axis=1) == pytest.approx(heights, rel=1e-4)
    strain = {shade.name: shade.values.values for shade in solid.shades}
    most = 100 * history.strain_max[0]
    assert strain["strain along the warp ε1"].max() == pytest.approx(most, rel=0.1)
    # Pulled everywhere, and by no more than the law's stiffest tangent.
    stress, e1 = strain["stress along the warp σ1"], fit.law.modulus("E1", np.linspace(0, 0.1, 50))
    assert 0 < stress.min() and stress[-1].max() < 1.3 * e1.max() * history.strain_max.max()


def test_two_bubbles_with_separate_offsets_are_fitted_together(tmp_path):
    fit = bf.fit(bf.read_project(known_bubble(tmp_path, ("[fit]", SECOND))), starts=1, jobs=1)
    assert list(fit.findings) == ["bubble 1", "softer reading"]
    assert fit.objective < 1e-5
    assert fit.tests["bubble 1"].nuisance == {}
    offset = fit.result["tests"]["softer reading"]["nuisance"]["displacement_offset_mm"]
    assert offset == pytest.approx([0.0, 0.0, 0.0], abs=1e-4)
    assert set(fit.result["mean_relative_error"]) == {"bubble 1", "softer reading"}
    assert set(fit.residuals()["test"]) == {"bubble 1", "softer reading"}
    sure, pinned = fit.best.certainty, fit.result["pinned"]["all together"]
    for name, sigma in sure.sigma.items():
        assert pinned[name]["largest"] == pytest.approx(float(sigma.max()))
    page = fit.report(tmp_path / "out").read_text()
    for name in ("bubble-1-profiles.png", "softer-reading-heights.png", "pinned.png"):
        assert name in page and (tmp_path / "out" / name).exists()
    maps_and_surface_say_what_the_table_says(fit, tmp_path / "out")


def test_fit_with_unknown_thickness_adds_its_prior_to_sigma(strips_fit, tmp_path):
    unknown = "[fit.unknowns]\nthickness = { bounds = [0.5, 1.1], prior = 0.04 }\n"
    fixed = strips_fit.result
    constant_strips(tmp_path, (FIT, FIT + unknown))
    done = in_process("uniaxial", "project.toml", "--starts", 1, "--jobs", 1, "--out", "free",
                      cwd=tmp_path)  # fmt: skip
    free = result_in(tmp_path / "free")
    said = free["unknowns"]["thickness"]
    assert said["value"] == pytest.approx(0.8, abs=1e-3)
    assert said["sigma"] == pytest.approx(0.04, rel=0.01) and not said["determined"]
    assert "unknowns" not in fixed
    assert f"thickness: {said['verdict']}" in " ".join(done.output.split())
    page = (tmp_path / "free" / "report.html").read_text()
    assert said["verdict"] in page and "thickness (fitted)" in page and "nu12 (fixed)" in page
    kinds = [n["kind"] for n in free["notes"] if n["note"].startswith("thickness is")]
    assert kinds == ["uncertain"]
    for name in ("E1", "E2"):
        own, without = (r["uncertainty"]["median_relative_sigma"][name] for r in (free, fixed))
        assert own == pytest.approx(np.hypot(without, 0.05), rel=0.02)
    assert read_card(tmp_path / "free" / "material.toml").thickness == pytest.approx(said["value"])
    assert "thickness" in pd.read_csv(tmp_path / "free" / "history.csv").columns


def test_unknown_keeps_its_prior_beside_scattering_specimens_and_other_priors(tmp_path):
    for unknowns in ("nu12 = { prior = 0.05 }", "nu12.prior = 0.05\nthickness.prior = 0.04"):
        project = project_with_unknowns(tmp_path, unknowns, ("nu12 = 0.0", "nu12 = 0.3"))
        fit = bf.fit(project, starts=1, jobs=1)
        assert fit.verdicts[0].sigma == pytest.approx(0.05, rel=0.02)


PRESSURES = (0.003, 0.02, 0.06, 0.15)


def fit_with_slack(*, tension=0.0, is_loaded=False):
    """Fit a slack to a sheet whose reference picture was taken under 3 kPa, or under tension."""
    model = BubbleModel(disk_mesh(100.0, 60), THICKNESS, PRESSURES, tension=(tension, tension))
    reference, *frames = MembraneSolver().run(model, DOUBTED_LAW).displacement
    points = np.array(model.mesh.points)
    if is_loaded:
        points += reference
        frames = [frame - reference for frame in frames]
    random = np.random.default_rng(1)
    bubble = bf.Bubble(
        points,
        [frame + 0.02 * random.standard_normal(points.shape) for frame in frames],
        PRESSURES[1:],
        radius=100.0,
        elements=60,
        objective="mm",
        sheet={"slack": True, "surface": "measured", "degree": 4},
    )
    return bf.fit(
        bubble,
        bf.Law("constant"),
        fabric=bf.Fabric("made", THICKNESS),
        starts=1,
        jobs=1,
        mesh_error="told",
        trust=["loaded-reference"],
    )


@pytest.mark.parametrize(
    ("rms", "kind", "words"),
    [
        (0.97, LOADED_REFERENCE, "the former explains the data better"),
        (0.99, NOT_BETTER, "the data do not tell the two apart"),
        (1.01, NOT_BETTER, "the data do not tell the two apart"),
        (1.03, NOT_BETTER, "the latter explains the data better"),
    ],
)
def test_misfits_within_two_percent_do_not_tell_alternatives_apart(rms, kind, words):
    alternative = Alternative("under {:.3g} kPa", "at rest", 3.0, 9.0, None, LOADED_REFERENCE)
    setup = SimpleNamespace(tests=[SimpleNamespace(test=SimpleNamespace(name="bubble"))])
    fits = AlternativeFits(setup, 0, alternative, None)
    assert fits.notes(Misfit(0.02, 0.01, "given", "mm")) == ()
    fits.best = AlternativeFit(3.0, None, Misfit(0.02 * rms, 0.01, "given", "mm"))
    (note,) = fits.notes(Misfit(0.02, 0.01, "given", "mm"))
    assert (note.kind, note.of) == (kind, "bubble")
    assert note == f"under 3 kPa leaves {0.02 * rms:.3g} mm RMS, at rest 0.02 mm: {words}"


def test_reference_picture_under_pressure_is_tried_and_its_misfit_told():
    fit = fit_with_slack(is_loaded=True)
    (note,) = fit.best.notes
    assert note.kind is LOADED_REFERENCE
    pressure = re.search(r"a reference picture under (\S+) kPa", note)[1]
    assert float(pressure) == pytest.approx(3.0, rel=0.05)
    loaded, assumed = (float(words.split()[-1]) for words in note.split(" mm")[:2])
    assert loaded == pytest.approx(0.02, rel=0.1) and assumed > 1.15 * loaded
    assert fit.verdict.state == "not to be used"
    assert "a reference picture under pressure explains the data better" in fit.verdict.reasons


def test_sheet_clamped_under_tension_is_explained_better_at_rest():
    fit = fit_with_slack(tension=4.0)
    (note,) = fit.best.notes
    assert note.kind is NOT_BETTER and "the latter explains the data better" in note
