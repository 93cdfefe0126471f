"""The loader of plug-ins, for all groups: names without imports, faults in one line each."""

import json
import os
import re
import shutil
import sys

import bubblefit
import numpy as np
import pandas as pd
import pytest
from bubblefit.errors import PlugInFailure, SolverFailure
from bubblefit.materials.forms.base import LawForm, form_named, pieces_of
from bubblefit.materials.law import HypoelasticLaw
from bubblefit.meshes.strip_models import bias_strip, straight_strip
from bubblefit.plugins import names_with_plug_ins, plug_in_named
from bubblefit.project.project import read_project
from bubblefit.readers.curves import read_load_curves
from bubblefit.readers.registry import format_names, format_of
from bubblefit.runs.compare import candidates
from bubblefit.solvers.membrane.solver import MembraneSolver
from bubblefit.solvers.registry import solver_named

from .builders.plug_ins import install_by_pip, install_plug_in
from .builders.projects import constant_strips
from .support.commands import output_of
from .support.paths import ROOT
from .support.refusals import complaint

GROUPS = ("bubblefit.laws", "bubblefit.tests", "bubblefit.readers", "bubblefit.solvers")


@pytest.mark.parametrize("group", GROUPS)
def test_plug_in_is_listed_without_import_and_imported_on_use(packages, group):
    before = names_with_plug_ins(group, ["ours"])
    install_plug_in(packages, "saturating", "THING = {'a': 1}", group=group)
    names = names_with_plug_ins(group, ["ours"])
    assert names == (*before[:1], *sorted({*before[1:], "saturating"}))
    assert "acme_saturating" not in sys.modules
    plug_in = plug_in_named(group, "saturating")
    assert plug_in.distribution == "acme-things 2.5"
    assert plug_in.load("table", ("keys", "values")) == {"a": 1}
    assert all(plug_in_named(other, "saturating") is None for other in GROUPS if other != group)


BROKEN = {
    "missing": ("", "cannot be imported (ModuleNotFoundError: No module named 'acme_missing')"),
    "failing": ("raise RuntimeError('no licence file\\nand more')",
                "cannot be imported (RuntimeError: no licence file)"),
    "leaving": ("import sys\nsys.exit(1)", "cannot be imported (SystemExit: 1)"),
    "nothing": ("x = 1", "cannot be imported (AttributeError"),
    "number": ("THING = 3", "is no form: acme_number:THING has no pieces, labels"),
}  # fmt: skip


def test_broken_plug_in_is_one_line_with_its_distribution(packages):
    for name, (text, words) in BROKEN.items():
        install_plug_in(packages, name, text)
        with pytest.raises(PlugInFailure) as failure:
            plug_in_named("bubblefit.laws", name).load("form", ("real", "pieces", "labels"))
        message = str(failure.value)
        assert message.startswith(f"the plug-in {name!r} of acme-things 2.5 {words}")
        assert message.endswith("; repair or uninstall it") and "\n" not in message
    # They are still listed, and nothing else breaks.
    assert BROKEN.keys() <= set(names_with_plug_ins("bubblefit.laws", ()))


def test_two_plug_ins_of_one_name_are_refused(packages, tmp_path, monkeypatch):
    install_plug_in(packages, "acme", "THING = 1")
    shutil.copytree(packages, tmp_path / "again")
    monkeypatch.syspath_prepend(str(tmp_path / "again"))
    assert plug_in_named("bubblefit.laws", "acme").load() == 1
    install_plug_in(packages, "acme", "THING = 2", "other-things", "acme_other")
    with pytest.raises(PlugInFailure, match=r"acme: .* acme-things 2\.5 and other-things 2\.5"):
        plug_in_named("bubblefit.laws", "acme")
    assert names_with_plug_ins("bubblefit.laws", ()).count("acme") == 1
    # A name of ours is ours.
    install_plug_in(packages, "cubic", "raise RuntimeError")
    assert names_with_plug_ins("bubblefit.laws", ["linear", "cubic"])[:2] == ("linear", "cubic")
    assert names_with_plug_ins("bubblefit.laws", ["linear", "cubic"]).count("cubic") == 1


def test_example_registers_every_name():
    assert set(bubblefit.__all__) <= set(dir(bubblefit))
    for name in bubblefit.__all__:
        thing = getattr(bubblefit, name)
        assert thing.__name__ == name and thing.__doc__
    with pytest.raises(AttributeError, match="no attribute 'nothing'"):
        _ = bubblefit.nothing


TEXT = (ROOT / "docs" / "adding.md").read_text()


PLUG_IN = ROOT / "examples" / "plug-in"


EXTRAS = PLUG_IN / "bubblefit_extras"


OPTIMISER = ROOT / "inference" / "nlopt_search.py"


ADAPTER = ROOT / "examples" / "solver-adapter"


GUIDE = (ROOT / "docs" / "how-to" / "writing-a-solver-adapter.md").read_text()


OURS = [*EXTRAS.glob("*.py"), EXTRAS.parent / "pyproject.toml", OPTIMISER]


@pytest.mark.parametrize(
    ("text", "paths"),
    [(TEXT.partition("\n## A form of the moduli")[2], OURS), (GUIDE, [*ADAPTER.glob("*.*")])],
)
def test_code_of_the_documents_is_that_of_the_example(text, paths):
    blocks = re.findall(r"```(?:toml|python)\n(.*?)```", text, re.DOTALL)
    sources = [plain(path.read_text()) for path in paths]
    assert len(blocks) > 4
    for block in blocks:
        assert any(plain(block) in source for source in sources), block
    said = {name: int(lines) for name, lines in re.findall(r"(\w+\.py), (\d+) \|", TEXT)}
    counted = {path.name: len(path.read_text().splitlines()) for path in EXTRAS.glob("[!_]*.py")}
    assert said == counted


def plain(text):
    """Lines without their indent, and without empty ones: formatters of documents change both."""
    return "\n".join(line.strip() for line in text.splitlines() if line.strip())


#: What the example's files were computed from: G12, E2 and E1, at rest and far away, MPa.
BETA = np.array([20.0, 5.0, 300.0, 150.0, 900.0, 400.0])


SCALE = {"warp": 0.03, "fill": 0.06, "shear": 0.15}


ENDS = (0.25, 0.25, 0.8)


@pytest.fixture(scope="session")
def plug_in(tmp_path_factory):
    return install_by_pip(PLUG_IN, tmp_path_factory.mktemp("plug-in"))


@pytest.fixture
def here(plug_in, monkeypatch):
    monkeypatch.syspath_prepend(str(plug_in))
    yield
    for name in [name for name in sys.modules if name.startswith("bubblefit_extras")]:
        del sys.modules[name]


def run(plug_in, *command):
    cwd = plug_in.parent / "source"
    path = os.pathsep.join([str(plug_in), *filter(None, [os.environ.get("PYTHONPATH")])])
    environment = {**os.environ, "PYTHONPATH": path}
    return output_of(sys.executable, *map(str, command), cwd=cwd, timeout=300, env=environment)


@pytest.mark.slow
def test_project_with_every_plug_in_is_fitted(plug_in, tmp_path):
    run(plug_in, "-m", "bubblefit.cli", "fit", "project.toml", "--starts", 1, "--out", tmp_path)
    assert json.loads((tmp_path / "result.json").read_text())["objective"] < 1e-3
    card = (tmp_path / "material.toml").read_text()
    assert 'form = "saturating"' in card and "[scale]" in card
    assert set(pd.read_csv(tmp_path / "residuals.csv").test) == {"strips", "supplier"}
    # The card in both kinds of test, by the plug-in's solver.
    simulated = tmp_path / "simulated"
    out = run(plug_in, "-m", "bubblefit.cli", "simulate", "test", "project.toml", "--card",
              tmp_path / "material.toml", "--solver", "bar", "--out", simulated)  # fmt: skip
    assert "bias: takes strips along warp or fill only" in out
    assert "611.4 N, stated 611.4 N" in out
    tests = json.loads((simulated / "result.json").read_text())["tests"]
    ((_, strips),) = tests["strips"]["cards"].items()
    assert strips["directions"]["fill"]["rms_N"] < 2.0  # of 720: the polynomial is 0.3 off itself
    # Python reads the card back and fits by its solver; the doctor pulls bars with it.
    out = run(plug_in, "-c", f"""if True:
        import numpy as np
        import bubblefit as bf
        from bubblefit.cli.main import main
        card = bf.read_card({str(tmp_path / "material.toml")!r})
        print(card.law.form.name, *np.round(card.law.beta, 1).tolist())
        project = bf.read_project("project.toml").with_fit(solver="bar")
        fit = bf.fit(project, tests="datasheet", starts=1, jobs=1)
        (row,) = fit.residuals().itertuples()
        print(fit.objective, row.quantity, row.measured, row.modelled)
        made = bf.Project.of(**project.objects)
        again = bf.read_project(made.to_toml("again.toml")).with_fit(solver="bar")
        for other in (made, again):
            assert bf.fit(other, tests="datasheet", starts=1, jobs=1).objective == fit.objective
        main(["doctor"], standalone_mode=False)
        """)  # fmt: skip
    name, *beta = out.splitlines()[0].split()
    assert name == "saturating"
    np.testing.assert_allclose(np.array(beta, dtype=float), BETA, rtol=0.02)
    objective, quantity, measured, modelled = out.splitlines()[1].split()
    assert float(objective) < 1e-6 and quantity == "load"
    assert float(measured) == pytest.approx(611.4)
    assert float(modelled) == pytest.approx(611.4, rel=1e-6)
    assert "bar         ok  version 1.0  plug-in of bubblefit-extras 1.0  bars within 0.0" in out


def law(thickness_change="constant"):
    form = form_named("saturating", {"scale": SCALE}, ENDS)
    return HypoelasticLaw(BETA, 0.24, np.array(ENDS), thickness_change, form)


def test_law_of_example_is_close_to_its_exponential(here):
    form = law().form
    assert isinstance(form, LawForm) and hash(form) == hash(law().form)
    assert pieces_of(form, BETA, ENDS).shape == (3, 9, 5)
    for name, scale, (rest, far) in (
        ("G12", 0.15, (20.0, 5.0)), ("E2", 0.06, (300.0, 150.0)), ("E1", 0.03, (900.0, 400.0)),
    ):  # fmt: skip
        x = np.linspace(0.0, 0.25, 200)
        exact = far + (rest - far) * np.exp(-x / scale)
        np.testing.assert_allclose(law().modulus(name, x), exact, atol=3e-3 * (rest - far))
    # Values at rest and at the end of the range make beta again.
    values = [m for n, e in zip(("G12", "E2", "E1"), ENDS[::-1], strict=True)
              for m in law().modulus(n, np.array([0.0, e]))]  # fmt: skip
    np.testing.assert_allclose(form.from_values(ENDS) @ values, BETA, rtol=3e-3)


def test_settings_of_law_are_checked(here):
    assert complaint(form_named, "saturating", {}, ENDS).startswith("scale: ")
    wrong = {"scale": {**SCALE, "fill": -1.0}}
    assert "scale.fill: " in complaint(form_named, "saturating", wrong, ENDS)


def test_form_without_its_settings_is_left_out_of_a_comparison(here, tmp_path):
    project = read_project(constant_strips(tmp_path))
    forms = candidates(project)
    assert {"trilinear", "spline:6"} <= forms.keys() and "saturating" not in forms
    assert "saturating" in candidates(project.with_law("saturating", {"scale": SCALE}))


@pytest.mark.parametrize("direction", ["warp", "fill"])
@pytest.mark.parametrize("thickness_change", ["constant", "incompressible"])
def test_solver_of_example_agrees_with_membrane(here, direction, thickness_change):
    model = straight_strip(direction, 20.0, 22.0, 0.81, increments=7)
    theirs, ours = (
        s.run(model, law(thickness_change)) for s in (solver_named("bar"), MembraneSolver())
    )
    np.testing.assert_allclose(theirs.load, ours.load, rtol=1e-8)
    np.testing.assert_allclose(theirs.displacement, ours.displacement, atol=1e-7)
    np.testing.assert_allclose(theirs.strain_max, ours.strain_max, atol=1e-9)
    for name, force in theirs.reactions.items():
        np.testing.assert_allclose(force, ours.reactions[name], atol=1e-5)
    with pytest.raises(SolverFailure, match="bar: takes strips along warp or fill only"):
        solver_named("bar").run(bias_strip(20.0, 25.0, 0.81), law())


def test_reader_of_example_is_found_by_content(here, tmp_path):
    for direction, final in (("warp", 23.0), ("fill", 24.0)):
        path = PLUG_IN / f"{direction}.rig"
        assert format_of("machine table", path).name == "riglog"
        (curve,) = read_load_curves(path, direction=direction)
        model = straight_strip(direction, 20.0, final, 0.81, increments=60)
        load = solver_named("bar").run(model, law()).load
        np.testing.assert_allclose(curve.load[1:], load[2::3], atol=2e-3)
        assert curve.elongation[-1] == final - 20.0
    assert "riglog" in format_names("machine table")
    broken = tmp_path / "broken.rig"
    broken.write_text("RIGLOG 1\nchannel Extension mm\nchannel Force kN\n0 0\n1\n")
    message = complaint(read_load_curves, broken, direction="warp")
    assert message.startswith(f"{broken}: line 5: ")
    broken.write_text("RIGLOG 1\n0 0\n")
    message = complaint(read_load_curves, broken, direction="warp", format="riglog")
    assert "expected lines 'channel NAME UNIT'" in message
