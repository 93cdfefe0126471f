"""Studies of an isotropic law say E, in the terminal and on their pages, where fits say so."""

import re

import pytest
from bubblefit.materials.card import MaterialCard
from bubblefit.materials.forms.base import form_named
from bubblefit.materials.forms.symmetry import symmetric
from bubblefit.materials.law import HypoelasticLaw
from bubblefit.project.project import read_project
from bubblefit.reports.study_pages import bootstrap_charts, plan_charts, weights_charts
from bubblefit.runs.bootstrap import bootstrap
from bubblefit.runs.plan import plan
from bubblefit.runs.profile import profile
from bubblefit.runs.weight_study import weights

from ..builders.projects import constant_strips
from .test_plan import few  # noqa: F401

FORM = symmetric(form_named("constant", {}, [1.0] * 3), "isotropic", 0.0)
CARD = MaterialCard(HypoelasticLaw([250.0], 0.0, [1.0] * 3, form=FORM), 0.8, "near")
CHANGES = (
    ('form = "constant"', 'form = "constant"\nsymmetry = "isotropic"'),
    ("E2 = [0.03, 1.0]\nG12 = [0.005, 0.2]\n", ""),
)
OTHER_NAMES = re.compile(r"\b(E1|E2|G12)\b")


@pytest.fixture(scope="module")
def isotropic(tmp_path_factory):
    folder = tmp_path_factory.mktemp("isotropic")
    return read_project(constant_strips(folder, *CHANGES))


def words_of(study, charts):
    titles = [chart.title for figure in charts for chart in figure.charts]
    series = [s.name for figure in charts for chart in figure.charts for s in chart.series]
    return [*study.result_lines(), str(study.verdict), *titles, *series]


def check(words):
    text = "\n".join(words)
    assert re.search(r"\bE\b", text) and not OTHER_NAMES.search(text), text


def test_study_of_weights_says_e(isotropic):
    study = weights(isotropic, "two", starts=1, counts=(0.5, 1.0, 2.0))
    check(words_of(study, weights_charts(study)))


def test_bootstrap_says_e(isotropic):
    study = bootstrap(isotropic, "specimens", 3, CARD, "one")
    assert [*study.sigma] == ["E"]
    check(words_of(study, [bootstrap_charts(study, "")]))


def test_profile_says_e(isotropic):
    study = profile(isotropic, None, CARD, "one")
    (of_modulus,) = study.profiles
    assert of_modulus.target.label == "E"
    check(study.result_lines())


def test_plan_says_e_and_ranks_by_it(isotropic, few):  # noqa: F811
    study = plan(isotropic, CARD, strain=(0.1, 0.1, 0.05), rank="E")
    assert "sigma_E" in study.table()
    assert "sigma_E1" not in study.table()
    check(words_of(study, [plan_charts(study, "")]))
