"""solvers/registry.py: solvers by name, plug-ins among them, and what `doctor` says of them."""

import json
import os
import shutil
import sys

import numpy as np
import pandas as pd
import pytest
from bubblefit.cli.main import main
from bubblefit.errors import SolverFailure
from bubblefit.materials.card import MaterialCard, write_card
from bubblefit.materials.law import HypoelasticLaw
from bubblefit.meshes.strip_models import bias_strip, straight_strip
from bubblefit.solvers.bars import BARS, strip_stresses
from bubblefit.solvers.membrane.solver import MembraneSolver
from bubblefit.solvers.registry import checked, solver_named
from click.testing import CliRunner

from ..builders.fortran import BETA, GONE, LAWS
from ..builders.plug_ins import install_by_pip, install_plug_in
from ..support.commands import in_process
from ..support.paths import EXAMPLES, ROOT
from ..support.refusals import raised
from .calculix.cases import fake_ccx_program

ADAPTER = EXAMPLES / "solver-adapter"
STRIPS = EXAMPLES / "uniaxial-valmex7318"
LAW = HypoelasticLaw(BETA, strain_range=np.array([0.16, 0.24, 0.9]))
SIMULATE = ("simulate", "uniaxial", "project.toml", "--card", "material.toml", "--overwrite")
GROUP = "bubblefit.solvers"
DIAGNOSE = "bubblefit.solvers.calculix.solver.diagnose"


@pytest.fixture(scope="session")
def installed_example(tmp_path_factory):
    return install_by_pip(ADAPTER, tmp_path_factory.mktemp("adapter"))


@pytest.fixture
def strips_with_card(tmp_path):
    text = (STRIPS / "project.toml").read_text()
    (tmp_path / "project.toml").write_text(text.replace("increments = 100", "increments = 10"))
    shutil.copy(STRIPS / "curves.csv", tmp_path)
    write_card(MaterialCard(LAW, 0.81, "Valmex"), tmp_path / "material.toml")
    return tmp_path


@pytest.fixture
def example(installed_example, monkeypatch):
    monkeypatch.syspath_prepend(str(installed_example))
    yield
    for name in ("bubblefit_homogeneous", "homogeneous_program"):
        sys.modules.pop(name, None)


@pytest.mark.slow
def test_fit_with_a_plug_in_is_led_by_the_membrane(example, strips_with_card):
    path = strips_with_card / "curves.csv"
    kept = [line for line in path.read_text().splitlines() if not line.startswith("bias")]
    path.write_text("\n".join(kept) + "\n")
    project = strips_with_card / "project.toml"
    text = project.read_text()
    assert "# strain_range = " in text and 'form = "cubic"' in text
    # No bias strip says how far the shear goes.
    text = text.replace("# strain_range = ", "strain_range = ")
    project.write_text(text.replace('form = "cubic"', 'form = "linear"'))
    done = in_process(
        "uniaxial", "project.toml", "--solver", "homogeneous", "--starts", 1, "--jobs", 1, "--out",
        "out", cwd=strips_with_card,
    )  # fmt: skip
    result = json.loads((strips_with_card / "out" / "result.json").read_text())
    assert result["solver"] == "homogeneous" and 0 < result["external_runs"] < 20, done.stdout
    history = pd.read_csv(strips_with_card / "out" / "history.csv")
    assert {"membrane", "homogeneous"} == set(history.solver)


@pytest.mark.parametrize("direction", ["warp", "fill"])
@pytest.mark.parametrize(
    "law",
    [
        HypoelasticLaw(BETA, 0.3, np.array([0.05, 0.05, 0.1])),
        HypoelasticLaw(BETA, 0.3, np.array([0.05, 0.05, 0.1]), "incompressible"),
        *(LAWS[name] for name in ("tri-linear", "spline", "jumps and kinks")),
    ],
)
def test_example_plug_in_agrees_with_the_membrane(example, direction, law):
    model = straight_strip(direction, 20.0, 22.0, 0.81, increments=7)
    theirs, ours = (s.run(model, law) for s in (solver_named("homogeneous"), MembraneSolver()))
    np.testing.assert_allclose(theirs.load, ours.load, rtol=1e-9)
    np.testing.assert_allclose(theirs.displacement, ours.displacement, atol=1e-8)
    np.testing.assert_allclose(theirs.strain_min, ours.strain_min, atol=1e-9)
    np.testing.assert_allclose(theirs.strain_max, ours.strain_max, atol=1e-9)
    for name, force in ours.reactions.items():
        if name in theirs.reactions:
            np.testing.assert_allclose(theirs.reactions[name], force, atol=1e-6)


def test_failures_of_a_plug_in_have_their_reasons(example, tmp_path):
    solver = solver_named("homogeneous")
    assert strip_stresses(solver) == pytest.approx([bar.stress for bar in BARS], rel=1e-4)
    warp, bias = straight_strip("warp", 20.0, 22.0, 0.81), bias_strip(20.0, 25.0, 0.81)
    with pytest.raises(SolverFailure, match="homogeneous: takes strips along warp or fill only"):
        solver.run(bias, LAW)
    words = r"a modulus is not positive \(exit number 3\)"
    found = raised(SolverFailure, words, solver.run, warp, GONE, tmp_path)
    assert (found.scratch / "job.json").is_file()
    broken = tmp_path / "broken.py"
    for text, words in (
        ("print('licence denied'); raise SystemExit(9)", r"exit number 9\).*\nlicence denied"),
        ("open('job.csv', 'w').write('1,1,0\\n')", "job.csv is not complete"),
        ("open('job.csv', 'w').write('garbage')", r"job\.csv: "),
        ("pass", r"job\.csv: "),
        ("import time; time.sleep(60)", "takes too long"),
    ):
        broken.write_text(text)
        with pytest.raises(SolverFailure, match=words):
            solver_named("homogeneous", program=str(broken), timeout=1.0).run(warp, LAW, tmp_path)
    assert not checked("homogeneous", solver_named("homogeneous", program="/nowhere")).available


def test_plug_in_has_options_of_the_project_file(example, strips_with_card, monkeypatch):
    monkeypatch.chdir(strips_with_card)
    path = strips_with_card / "project.toml"
    before = path.read_text()
    unknown = "project.toml: solver.homogenous: no solver of this name is installed"
    for table, code, words in (
        ("[solver.homogeneous]\ntimeout = 30.0", 0, ""),
        ("[solver.homogeneous]\ntimeout = 0.0", 2, "project.toml: solver.homogeneous.timeout: "),
        ("[solver.homogeneous]\ncolour = 1", 2, "project.toml: solver.homogeneous: got an unexp"),
        ("[solver.homogeneous]\nprogram = 'nowhere.py'", 4, "homogeneous: nowhere.py is not"),
        ("[solver.homogenous]\ntimeout = 30.0", 2, unknown),
        ("[solver]\nhomogeneous = 3", 2, "solver.homogeneous"),
    ):
        path.write_text(f"{before}\n{table}\n")
        done = CliRunner().invoke(main, [*SIMULATE, "--solver", "homogeneous"])
        assert done.exit_code == code and words in done.output, (done.output, done.exception)
        assert code == 0 or done.output.count("\n") == 1


WORKING = """
class THING:
    name, external, progress, identity = "acme", True, None, "acme 9"
    def run(self, model, law, scratch=None, timeout=None): {run}
    def check(self):
        from bubblefit.solvers.base import SolverCheck
        {check}
"""
FINE = "return SolverCheck('acme', True, '9', True)"
CHECKS = {
    "raises": ("raise OSError('no such host')", "...", "fails its check (OSError: no such host)"),
    "failure": ("from bubblefit.errors import SolverFailure; raise SolverFailure('no licence')",
                "...", "no licence"),
    "no": ("return SolverCheck('acme', False, '', False, 'install it')", "...", "install it"),
    "silent": ("return SolverCheck('acme', True, '9', False)", "...", "says that it is not usable"),
    "crashes": (FINE, "raise KeyError('u')", "fails on a strip (KeyError: 'u')"),
    "wrong": (FINE, """
        import numpy as np
        from bubblefit.solvers.base import History
        from bubblefit.solvers.membrane.solver import MembraneSolver
        h = MembraneSolver().run(model, law)
        return History(1.01 * h.load, h.displacement, h.strain_min, h.strain_max)""",
              "does not carry the law: 0.01 from Marc's end stress"),
    "short": (FINE, """
        from bubblefit.solvers.base import History
        import numpy as np
        return History(np.ones(3), np.ones((3, 4, 3)), np.zeros(3), np.zeros(3))""",
              "its law was not tried: acme: 3 frames of a strip of 100 elongations"),
    "bubbles": (FINE, """
        from bubblefit.errors import SolverFailure
        raise SolverFailure('takes bubbles only', 'acme')""",
                "its law was not tried: acme: takes bubbles only"),
}  # fmt: skip


@pytest.mark.parametrize("what", CHECKS)
def test_doctor_reports_what_a_plug_in_does(packages, strips_with_card, monkeypatch, what):
    check, run, words = CHECKS[what]
    install_plug_in(packages, "acme", WORKING.format(run=run, check=check), group=GROUP)
    monkeypatch.setattr(DIAGNOSE, lambda named: [])
    done = CliRunner().invoke(main, ["doctor", "--solver", "acme"])
    # One that runs no strips is taken at its word, and the reader told.
    taken = what in ("short", "bubbles")
    assert done.exit_code == (0 if taken else 4), (done.output, done.exception)
    assert words in done.output and "membrane    ok" in done.output
    assert ("NOT USABLE  version 9" in done.output) == (what in ("silent", "crashes", "wrong"))
    if what == "raises":  # it stops a study in one line
        monkeypatch.chdir(strips_with_card)
        done = CliRunner().invoke(main, [*SIMULATE, "--solver", "acme"])
        assert done.exit_code == 4 and words in done.output and done.output.count("\n") == 1


def doctor(*arguments, code=0):
    return in_process("doctor", *arguments, cwd=ROOT, code=code).stdout


def test_doctor_accepts_a_working_ccx(ccx, monkeypatch):
    monkeypatch.setenv("BUBBLEFIT_CCX", str(ccx.path))
    content = json.loads(doctor("--json"))
    assert content["ok"]
    by_path = {one["path"]: one for one in content["solvers"]}
    assert by_path[None]["name"] == "membrane"
    mine = by_path[str(ccx.path)]
    assert mine["usable"] and mine["external_materials"] and mine["difference"] < 1e-4
    assert mine["stresses"] == pytest.approx([bar.stress for bar in BARS], rel=1e-4)
    # The same increments in the embedded law: all seven digits that ccx prints.
    assert mine["stresses"] == pytest.approx(by_path[None]["stresses"], rel=1e-6)


def test_doctor_fails_for_a_named_ccx_that_fails(no_ccx, monkeypatch):
    broken = fake_ccx_program(no_ccx / "mine" / "ccx", then="exit 3")
    cc = shutil.which("cc", path=os.defpath) or shutil.which("gcc", path=os.defpath)
    monkeypatch.setenv("CC", cc or "cc")
    monkeypatch.setenv("PATH", os.defpath)
    text = doctor("--ccx", broken, code=4)
    assert f"{broken} (named)" in text and "cannot be seen" in text
    monkeypatch.setenv("BUBBLEFIT_CCX", str(no_ccx / "nowhere"))
    text = doctor(code=4)
    assert "no such file" in text
