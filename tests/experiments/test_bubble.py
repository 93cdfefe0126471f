"""experiments/bubble/__init__.py: the bubble of a project, its models and quantities."""

from dataclasses import replace

import numpy as np
import pytest
from bubblefit.experiments.bubble import merge_increments, quantities, responses
from bubblefit.materials.law import HypoelasticLaw
from bubblefit.project.project import read_project
from bubblefit.runs.setup import prepare_fit
from bubblefit.solvers import registry
from bubblefit.solvers.calculix import sheets as calculix_sheets
from bubblefit.solvers.marc import analyses as marc_analyses
from bubblefit.solvers.membrane.solver import MembraneSolver

from ..builders.flat_bubbles import MODEL, history
from ..builders.projects import known_bubble
from ..support.paths import KNOWN
from ..support.refusals import complaint, refused
from .bubble.cases import PLACE, bubble_of_project


def test_quantities_and_responses_of_a_bubble():
    assert quantities(MODEL, history()) == pytest.approx(
        {"apex at 22 kPa, mm": 10.0, "apex at 300 kPa, mm": 30.0,
         "largest in-plane displacement at 300 kPa, mm": 1.0}
    )  # fmt: skip
    assert responses(MODEL, history()) == pytest.approx(
        {"22 kPa": 10.0, "300 kPa": np.hypot(30.0, 1.0)}
    )


def test_known_solution_is_table_4_2_in_mpa():
    p = bubble_of_project(read_project(KNOWN))
    assert p.pressures == pytest.approx([0.022, 0.059, 0.097, 0.132, 0.186, 0.251, 0.300])
    assert p.increments == p.data.increments == pytest.approx(sorted([0.006, 0.040, *p.pressures]))
    assert (p.outline.radius, p.elements, p.symmetry) == (100.0, 800, "quarter")
    assert p.data.beta[[0, 3, 7, 11]] == pytest.approx([-7.96788, 20.0439, 139.437, 806.35])
    assert (p.data.elements, p.data.symmetry) == (800, "quarter")
    assert (p.match_by, p.objective, p.name, p.weight) == ("points", "e", "bubble", 1.0)


def test_data_from_another_model_and_default_increments(edited_bubble):
    other = bubble_of_project(
        edited_bubble("# elements = 1800\n# increments", "elements = 1800\nincrements")
    )
    assert other.data.elements == 1800
    assert other.data.increments[0] == pytest.approx(0.004)
    assert set(other.pressures) <= set(other.data.increments)
    assert other.data.increments != other.increments
    reference = bubble_of_project(read_project(KNOWN)).increments
    assert bubble_of_project(edited_bubble("increments = [6, 40]", "")).increments == pytest.approx(
        reference
    )
    assert (
        len(
            bubble_of_project(
                edited_bubble("increments = [6, 40]", "increments = [40, 22, 6]")
            ).increments
        )
        == 9
    )


def test_load_steps_beyond_the_last_are_refused_in_the_unit_of_the_file():
    more = [0.030, 0.010, 0.022 * (1 + 1e-10)]
    steps = merge_increments(PLACE, "increments", more, (0.022, 0.03))
    assert steps == pytest.approx((0.010, 0.022, 0.03)) and len(steps) == 3
    assert len(merge_increments(PLACE, "i", [0.022 * (1 + 1e-8)], (0.022, 0.03))) == 3
    said = complaint(merge_increments, PLACE, "increments", [0.01, 0.030001], (0.03,))
    assert said.startswith("p.toml: bubble[0].increments[1]: ") and "30.001" in said


def test_cord_along_the_sheet_is_in_the_model_of_the_membrane_only(tmp_path):
    """In metres; a quarter takes one along a symmetry line."""
    cord = "[[bubble.cord]]\nstrain = [0, 0.01]\nforce = [0, 300]\n"
    cord += "ends = [[-0.1, 0.0], [0.1, 0.0]]\n[fit]"
    path = known_bubble(tmp_path, ("radius = 100.0", "radius = 0.1"), ("[fit]", cord),
                 ("thickness = 0.81", "thickness = 0.81e-3"), ('"mm"', '"m"'))  # fmt: skip
    project = read_project(path)
    model = bubble_of_project(project).model()
    assert model.cords[0].ends.tolist() == [[-100.0, 0.0], [100.0, 0.0]]
    (prepared,) = prepare_fit(project, list(project.tests.values())).tests
    with_cord = prepared.fields[-1].displacement[:, 2].max()
    plain = MembraneSolver().run(replace(model, cords=()), prepared.known).displacement[-1, :, 2]
    assert with_cord < 0.9 * plain.max()
    law = HypoelasticLaw.linear(400.0, 400.0, 40.0)
    for analyse in (calculix_sheets.analyse_bubble, marc_analyses.analyse_bubble):
        assert refused(analyse, model, law, None, None).field == "cord"


class Other(MembraneSolver):
    name = identity = "other"


@pytest.mark.parametrize(
    ("said", "crime"),
    [('solver = "membrane"\nelements = 48\nsymmetry = "full"\n', True), ("elements = 108\n", False),
     ('solver = "other"\n', False), ("increments = [6, 41]\n", False)],
)  # fmt: skip
def test_data_computed_by_the_fitted_model_are_noted(tmp_path, monkeypatch, said, crime):
    monkeypatch.setitem(registry.SOLVERS, "other", Other)
    known = "[bubble.data.known_solution]\n"
    project = read_project(known_bubble(tmp_path, (known, known + said)))
    (prepared,) = prepare_fit(project, list(project.tests.values())).tests
    assert prepared.by_this_model is crime
