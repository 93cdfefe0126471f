"""Forms, objectives and tests of one's own, given as objects: equal to built-in ones, and alone."""

import sys
from dataclasses import replace
from types import SimpleNamespace

import bubblefit as bf
import numpy as np
import pytest
from bubblefit.errors import BubblefitError, InputError
from bubblefit.experiments.base import Weighting
from bubblefit.experiments.bubble.field_shape import mirrored
from bubblefit.experiments.own import OwnTest, ValuesObjective
from bubblefit.inference.nuisance_fit import fit_nuisance
from bubblefit.inference.objective import FunctionObjective
from bubblefit.materials.card import MaterialCard, read_card
from bubblefit.materials.forms.base import COMPONENTS, ORDER
from bubblefit.materials.forms.polynomial import CUBIC
from bubblefit.materials.forms.spline import Form, Spline, TriLinear
from bubblefit.materials.law import HypoelasticLaw
from bubblefit.project.project import read_project
from bubblefit.reports.content import read_page_data
from bubblefit.runs.setup import fingerprints
from bubblefit.runs.starts import EvaluationRecord, Stage, StartRecord

from ..builders.projects import constant_strips, fit_setup, known_bubble, known_bubble_of_form
from ..support.commands import output_of
from ..support.paths import EXAMPLES, ROOT
from ..support.refusals import raised, refused

RANGE = (0.13, 0.12, 0.1)


class Line(Form):
    """The spline of two knots: a line between the values at both ends."""

    def __init__(self, ends=(0.13, 0.13, 0.13)):
        self.ends = ends
        self.labels = {name: [f"{name} at rest", f"{name} at the end"] for name in ORDER}

    def functions(self, modulus, strain):
        share = strain / self.ends[COMPONENTS[modulus]]
        return [1.0 - share, share]


class Cubic(Form):
    def functions(self, modulus, strain):
        return [strain**3, strain**2, strain, 1.0]


class Regions(Form):
    breaks = (0.02, 0.05)

    def functions(self, modulus, strain):
        first, second = self.breaks
        return [strain <= first, (first < strain) & (strain <= second), strain > second]


class Decaying(Form):
    def functions(self, modulus, strain):
        share = np.exp(-strain / 0.02)
        return [1.0] if modulus == "G12" else [share, 1.0 - share]


class Torsion(OwnTest):
    """A thin tube, its yarns along and around the axis: the torque at given shear strains."""

    name, unit, radius = "torsion", "N mm", 40.0

    def __init__(self, shear, torque):
        self.shear, self.measured = np.asarray(shear), torque
        self.strain, self.places = (None, None, max(shear)), {"shear strain": shear}

    def modelled(self, law):
        path = np.linspace(0.0, self.shear, 41)
        stress = np.trapezoid(law.G12(path), path, axis=0)
        return 2 * np.pi * self.radius**2 * self.thickness * stress


class Pull(OwnTest):
    """A yarn pulled while the other one is held: the modulus is E1 / (1 - nu12^2 E2 / E1)."""

    name, unit, strain = "pull", "N/mm", (0.06, None, None)
    measured = np.linspace(5.0, 20.0, 9)

    def modelled(self, law):
        path = np.linspace(0.0, np.linspace(0.01, 0.06, 9), 61)
        modulus = law.E1(path) / (1.0 - law.nu12**2 * law.E2(0.0) / law.E1(path))
        return self.thickness * np.trapezoid(modulus, path, axis=0) / np.exp(path[-1])


def whole(modelled, measured):
    """The built-in objective in mm: e adds up the RMS of every direction in every frame."""
    off = modelled - measured
    return [off[k, :, i] for k in range(len(off)) for i in range(3)]


def easy(folder, form='form = "cubic"', objective="e", starts=2):
    path = known_bubble_of_form(folder, form)
    path.write_text(path.read_text().replace('objective = "e"', f'objective = "{objective}"'))
    return read_project(path).with_fit(starts=starts, jobs=1)


def at_known(setup, times=1.05):
    problem = setup.problem()
    moduli = {name: times * setup.tests[0].known.modulus(name, 0.03) for name in ORDER}
    values = [moduli[name] for name in problem.unknowns.form.modulus_of]
    return problem, problem.unknowns.at(problem.unknowns.from_values @ np.array(values))


def differences(problem, y, step=1e-5):
    columns = [
        (problem.evaluate(y + step * one, False).residual
         - problem.evaluate(y - step * one, False).residual) / (2 * step)
        for one in np.eye(len(y))
    ]  # fmt: skip
    return np.column_stack(columns)


@pytest.mark.parametrize(
    ("own", "ours"),
    [(Cubic(), CUBIC), (Line(RANGE), Spline.at([[0.0, end] for end in RANGE])),
     (Regions(), TriLinear.at([Regions.breaks] * 3))],
)  # fmt: skip
def test_form_of_functions_equals_built_in_form(own, ours):
    form = own.pieces(RANGE)
    values = np.random.default_rng(3).uniform(50.0, 200.0, len(form.free))
    given = np.zeros(ours.size)
    order = values.reshape(3, -1)
    given[list(ours.free)] = (order[:, ::-1] if isinstance(own, Regions) else order).ravel()
    strain = np.linspace(0.0, 0.13, 500)
    one, other = (HypoelasticLaw(b, 0.2, RANGE, form=f) for b, f in ((values, form), (given, ours)))
    for name in ORDER:
        np.testing.assert_allclose(one.modulus(name, strain), other.modulus(name, strain), 1e-12)
    assert one.jumps == other.jumps == isinstance(own, Regions)
    to_values = np.linalg.inv(form.from_values(RANGE))
    rising = to_values @ np.tile(np.arange(1.0, 1 + len(to_values) // 3), 3)
    assert np.linalg.cond(to_values) < 1e5
    assert (np.diff(rising.reshape(3, -1)) > 0).all()  # the first is at rest


def test_form_of_other_functions_becomes_close_cubics():
    form = Decaying().pieces(RANGE)
    law = HypoelasticLaw(np.array([10.0, 300.0, 100.0, 400.0, 150.0]), 0.2, RANGE, form=form)
    strain = np.linspace(0.0, 0.13, 2001)
    share = np.exp(-strain / 0.02)
    np.testing.assert_allclose(law.E1(strain), 400.0 * share + 150.0 * (1 - share), 2e-5)
    np.testing.assert_allclose(law.G12(strain), 10.0, 1e-12)
    assert not law.jumps and form.labels[0] == "G12 1" and form.modulus_of.count("E2") == 2


def test_card_of_own_form_is_read_without_its_class(tmp_path):
    law = HypoelasticLaw(
        np.array([9.0, 300, 90, 400, 99]), 0.2, RANGE, form=Decaying().pieces(RANGE)
    )
    card, path = MaterialCard(law, 0.8, "own"), tmp_path / "card.toml"
    card.write(path, "MPa")
    again = read_card(path)
    assert again.law.form == law.form and hash(again.law.form) == hash(law.form)
    np.testing.assert_array_equal(again.law.pieces, law.pieces)
    code = f"import bubblefit as bf; print(bf.read_card({str(path)!r}).law.E1(0.013).item())"
    assert float(output_of(sys.executable, "-c", code)) == law.E1(0.013)
    text = path.read_text()
    for key, first in (("labels", "1"), ("modulus_of", "1"), ("uppers", "[1]"), ("map", "[1]")):
        assert f"{key} = [" in text
        path.write_text(text.replace(f"{key} = [", f"{key} = [{first}, ", 1))
        error = refused(read_card, path)
        assert error.field == "pieces" and error.path == path


@pytest.mark.parametrize(
    "functions",
    [lambda *_: [1.0, 2.0], lambda *_: [np.ones(2)], lambda *_: [], lambda *_: ["soft"],
     lambda _, strain: [np.log(strain)]],
)  # fmt: skip
def test_functions_that_make_no_form_are_refused(tmp_path, functions):
    made = type("Wrong", (Form,), {"functions": lambda self, *given: functions(*given)})
    with np.errstate(divide="ignore"), pytest.raises(InputError) as error:
        fit_setup(easy(tmp_path).with_form(made))
    assert error.value.field == "law.form"
    refused(easy(tmp_path).with_form, "cubic")


SCRIPT = """
import multiprocessing
import numpy as np
import bubblefit as bf
from bubblefit.materials.forms.spline import Form

class Soft(Form):
    scale = 0.02
    def functions(self, modulus, strain):
        share = np.exp(-strain / self.scale)
        return [1.0] if modulus == "G12" else [share, 1.0 - share]

def residuals(modelled, measured):
    off = modelled - measured
    return [off[k, :, i] for k in range(len(off)) for i in range(3)]

if __name__ == "__main__":
    multiprocessing.set_start_method(METHOD)
    project = bf.read_project(FILE).with_form(Soft).with_objective("bubble", residuals)
    print(repr(bf.fit(project, starts=2, jobs=2).objective))
"""


def test_worker_processes_need_no_module_of_the_script(tmp_path):
    easy(tmp_path)
    said = []
    for method in ("fork", "spawn"):
        text = SCRIPT.replace("METHOD", repr(method)).replace("FILE", repr("project.toml"))
        (tmp_path / "script.py").write_text(text)
        said.append(float(output_of(sys.executable, "script.py", cwd=tmp_path)))
    assert said[0] == said[1] > 0


def test_fit_is_resumed_only_with_the_same_functions(tmp_path):
    class Changed(Decaying):
        def functions(self, modulus, strain):
            return [1.001 * own for own in super().functions(modulus, strain)]

    project, out = easy(tmp_path, starts=1).with_form(Decaying), tmp_path / "out"
    first = bf.fit(project, out=out)
    assert bf.fit(project, out=out, resume=True).objective == first.objective
    error = raised(BubblefitError, "", bf.fit, project.with_form(Changed), out=out, resume=True)
    assert "law" in str(error)
    marks = []
    for function in (
        whole,
        lambda modelled, measured: [1.1 * one for one in whole(modelled, measured)],
    ):
        setup = fit_setup(project.with_objective("bubble", function))
        marks.append(fingerprints(setup, setup.problem())["data"])
    assert marks[0] != marks[1]


def test_residual_function_equals_built_in_objective(tmp_path):
    built_in = easy(tmp_path, objective="mm", starts=1)
    own = built_in.with_objective("bubble", whole)
    (ours, y), (theirs, _) = (at_known(fit_setup(p)) for p in (built_in, own))
    one, other = ours.evaluate(y, True), theirs.evaluate(y, True)
    np.testing.assert_allclose(other.residual, one.residual, rtol=1e-9, atol=1e-12)
    np.testing.assert_allclose(other.jacobian, one.jacobian, rtol=1e-7, atol=1e-9)
    np.testing.assert_allclose(theirs.scale, ours.scale, 1e-9)
    first, second = bf.fit(built_in), bf.fit(own)
    assert second.objective == pytest.approx(first.objective, abs=1e-9)
    assert np.abs(second.law.E1(0.02) / first.law.E1(0.02) - 1) < 1e-6
    names = ["modulus", "strain", "noise_relative"]
    np.testing.assert_allclose(second.moduli()[names[2]], first.moduli()[names[2]], rtol=1e-4)
    assert "function" in second.result["objective_is"] and second.report(tmp_path / "out").exists()


class Height:
    """Relative error of the mean height of every frame: one vector, not linear, with its slope."""

    def __call__(self, modelled, measured):
        return np.log(modelled[:, :, 2].mean(axis=1) / measured[:, :, 2].mean(axis=1) + 1e-3)

    def derivative(self, modelled, measured, change):
        mean, known = modelled[:, :, 2].mean(axis=1), measured[:, :, 2].mean(axis=1)
        return change[:, :, 2].mean(axis=1) / (mean + 1e-3 * known)


@pytest.mark.parametrize("function", [Height(), Height().__call__, whole])
def test_derivative_of_residual_function_follows_differences(tmp_path, function):
    problem, y = at_known(fit_setup(easy(tmp_path).with_objective("bubble", function)))
    point = problem.evaluate(y, True)
    size = np.abs(point.jacobian).max()
    np.testing.assert_allclose(point.jacobian, differences(problem, y), atol=1e-5 * size)
    (objective,) = (c.objective for c in problem.comparisons)
    (history,) = point.histories
    softer = fit_nuisance(problem, 0.9 * y)[0].histories[0]
    np.testing.assert_allclose(
        objective.shifted(history, softer).residual(softer, {}), objective.residual(history, {}),
        rtol=1e-9, atol=1e-12,
    )  # fmt: skip


def test_residual_function_weighs_as_built_in_objective_among_tests(tmp_path):
    project = read_project(constant_strips(tmp_path)).with_fit(jobs=1)
    own = project.with_objective("one", np.subtract)
    one, other = (fit_setup(p).problem() for p in (project, own))
    y = one.unknowns.at(np.array([20.0, 190.0, 320.0]))
    first, second = one.evaluate(y, True), other.evaluate(y, True)
    np.testing.assert_allclose(second.residual, first.residual, rtol=1e-9, atol=1e-12)
    np.testing.assert_allclose(second.jacobian, first.jacobian, atol=1e-8)
    assert [type(c.objective) is FunctionObjective for c in other.comparisons] == [
        True,
        True,
        False,
    ]
    twice = fit_setup(project.with_objective("one", lambda m, d: [m - d, d - m])).problem()
    assert twice.evaluate(y, False).value == pytest.approx(first.value, rel=1e-12)
    refused(project.with_objective, "three", np.subtract)
    changing = project.with_objective("one", lambda m, d: np.resize(m - d, 3 if m.any() else 4))
    assert refused(fit_setup(changing).problem).field == "objective"
    cruciform = read_project(EXAMPLES / "biaxial-computed" / "project.toml")
    with pytest.raises(InputError, match="biaxial tests have an objective of their own"):
        fit_setup(cruciform.with_objective("biaxial", np.subtract)).problem()


def test_script_of_the_documents_runs(tmp_path):
    text = (ROOT / "docs" / "adding.md").read_text().partition("## In a script")[2]
    code = text[text.index("```python\n") + 10 :].partition("```")[0]
    known = fit_setup(read_project(known_bubble(tmp_path)))
    fields = [mirrored(field) for field in known.tests[0].fields[1::2]]
    law, fabric, heard = known.tests[0].known, known.project.fabric, []
    path = np.linspace(0.0, SHEAR, 41)
    torque = 2 * np.pi * 40.0**2 * fabric.thickness * np.trapezoid(law.G12(path), path, axis=0)
    space = {
        "bf": bf, "np": np, "heard": heard, "fabric": fabric, "shear": SHEAR, "torque": torque,
        "points": np.column_stack([fields[0].points, np.zeros(len(fields[0].points))]),
        "displacements": np.array([field.displacement for field in fields]),
        "pressures": [field.pressure for field in fields],
    }  # fmt: skip
    exec(code, space)  # noqa: S102 - our own document
    fit, project = space["fit"], space["fit"].project
    assert fit.law.form.title == "Decaying" and list(fit.tests) == ["bubble", "torsion"]
    assert any(isinstance(r, Stage) for r in heard)
    assert isinstance(fit.problem.comparisons[0].objective, FunctionObjective)
    assert abs(fit.law.G12(0.0) / law.G12(SHEAR).mean() - 1) < 0.3
    assert project.own_parts == ["law.form", "objective of 'bubble'", "test 'torsion'"]
    error = refused(project.to_toml, tmp_path / "again.toml")
    assert error.field == "law.form" and not (tmp_path / "again.toml").exists()
    again = bf.Project.of(**project.objects).with_weights({"torsion": 2.0, "bubble": 1.0})
    assert again.own_parts == project.own_parts and again.tests["torsion"].weight == 2.0
    assert project.tests["torsion"].weight == 1.0 and again.form is project.form


SHEAR = np.linspace(0.01, 0.12, 12)


UNKNOWN = "[fit.unknowns]\nnu12 = {}\nthickness = { prior = 0.02 }\n\n[[bubble]]"


def with_torsion(project, times=1.0):
    (known,) = (t.known for t in fit_setup(project).tests)
    tube = Torsion(SHEAR, np.zeros(12))
    tube.thickness = project.fabric.thickness
    noise = 1 + 0.01 * np.random.default_rng(1).standard_normal(12)
    return project.with_tests(Torsion(SHEAR, times * noise * tube.modelled(known)))


def test_own_test_is_fitted_beside_a_bubble(tmp_path):
    heard = []
    fit = bf.fit(with_torsion(easy(tmp_path, starts=1)), jobs=1, progress=heard.append)
    g12, known = (law.G12(SHEAR) for law in (fit.law, fit.setup.tests[0].known))
    assert np.abs(g12[2:] / known[2:] - 1).max() < 0.06
    sure = {name: own["G12"].sigma.max() for name, own in fit.pinned.items()}
    assert sure["torsion"] < sure["bubble"]
    # Of E1 a tube says no more than the bounds of the fit.
    of_e1 = {name: np.median(own["E1"].sigma) for name, own in fit.pinned.items()}
    assert of_e1["torsion"] > 10 * of_e1["bubble"] and of_e1["torsion"] > 0.3
    table = fit.residuals().query("test == 'torsion'")
    assert list(table["shear strain"]) == list(SHEAR) and set(table["unit"]) == {"N mm"}
    np.testing.assert_allclose(table["difference"], table["modelled"] - table["measured"])
    assert fit.problem.solver.name == "membrane" and fit.best.certainty.mesh is not None
    page = read_page_data(fit.report(tmp_path / "out").parent)
    charts = [p for s in page.sections for p in s.parts if getattr(p, "part", "") == "charts"]
    assert any(chart.name.endswith("values") for chart in charts)
    assert read_card(tmp_path / "out" / "material.toml").law.form == CUBIC
    assert bf.simulate(fit.project.tests["torsion"], fit.card) is not None
    seen = [r for r in heard if r is not None]
    analyses = [r.analysis for r in seen if isinstance(r, EvaluationRecord)]
    (end,) = [r for r in seen if isinstance(r, StartRecord)]
    assert analyses == list(range(1, end.analyses + 1)) and seen[-1] is end


@pytest.mark.parametrize(
    ("weighting", "unit"), [(Weighting(), 1.0), (Weighting(relative=True, weight=0.5), 40.0)]
)
def test_values_weigh_by_the_largest_of_them_among_tests(weighting, unit):
    objective = ValuesObjective(Pull(), weighting)
    np.testing.assert_allclose(objective.scale, np.full(9, 3.0 * unit))
    assert objective.least_noise == pytest.approx(0.2) and objective.noise_is == "assumed"


def test_derivative_of_own_closed_form_follows_differences(tmp_path):
    path = known_bubble_of_form(tmp_path, 'form = "cubic"')
    path.write_text(path.read_text().replace("[[bubble]]", UNKNOWN, 1))
    project = read_project(path).with_tests(Pull())
    problem, y = at_known(fit_setup(project))
    assert problem.unknowns.nuisance.names == ("nu12", "thickness")
    rows, point = problem.rows(1), problem.evaluate(y, True)
    found = differences(problem, y)[rows]
    assert np.abs(found[:, 4:]).max(axis=0).min() > 0 and not found[:, :4].any()
    modelled = point.residual[rows] + Pull.measured / problem.scale[rows]
    np.testing.assert_allclose(found[:, -1], modelled / project.fabric.thickness, rtol=1e-6)
    np.testing.assert_allclose(point.jacobian[rows], found, atol=1e-6 * np.abs(found).max())


def test_own_test_is_fitted_alone_and_by_another_solver(tmp_path):
    project = easy(tmp_path, 'form = "constant"')
    torsion = with_torsion(project).tests["torsion"]
    alone = replace(project, tests={}).with_tests(torsion).with_form(ConstantShear)
    fit = bf.fit(alone, starts=1, jobs=1)
    slope = 2 * np.pi * 40.0**2 * project.fabric.thickness * SHEAR
    best = (slope @ torsion.measured) / (slope @ slope)
    assert fit.law.G12(0.0) == pytest.approx(best, rel=1e-6) and fit.command == "own"
    assert fit.result["objective_is"].endswith("N mm")
    setup = fit_setup(with_torsion(easy(tmp_path)))
    bubble, tube = setup.problem().comparisons
    assert tube.objective.shifted(None, None) is tube.objective
    plain = SimpleNamespace(name="plain", identity="plain", external=False, progress=None)
    led = setup.problem_of([replace(bubble, solver=plain), tube]).surrogate
    assert [c.solver.name for c in led.comparisons] == ["membrane", "closed form"]


class ConstantShear(Form):
    of_strain = False

    def functions(self, modulus, strain):
        return [1.0]


@pytest.mark.parametrize("values", [np.ones(3), 1.0, ["soft"] * 9, None])
def test_own_values_must_be_as_many_as_measured(tmp_path, values):
    wrong = type("Wrong", (Pull,), {"modelled": lambda self, law: values})
    error = refused(fit_setup, easy(tmp_path).with_tests(wrong()))
    assert error.field == "pull.modelled"
    error = refused(easy(tmp_path).with_tests, Pull(), Pull())
    assert error.field == "tests"
