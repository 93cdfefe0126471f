"""Solvers of other distributions, installed and run or broken; what `doctor` says of solvers."""

import csv
import json
import os
import shutil
import sys

import numpy as np
import pandas as pd
import pytest
from bubblefit.cli.main import main
from bubblefit.errors import InputError, SolverFailure
from bubblefit.materials.card import MaterialCard, write_card
from bubblefit.materials.law import HypoelasticLaw
from bubblefit.meshes.strip_models import bias_strip, straight_strip
from bubblefit.solvers.bars import BARS, strip_stresses
from bubblefit.solvers.calculix.executable import carries_external, every_ccx, find_ccx
from bubblefit.solvers.membrane.solver import MembraneSolver
from bubblefit.solvers.registry import checked, solver_named
from click.testing import CliRunner

from ..builders.fortran import BETA, GONE, LAWS
from ..builders.plug_ins import install_by_pip, install_plug_in
from ..support.commands import in_process, write_program
from ..support.paths import EXAMPLES, PUBLISHED, ROOT
from ..support.refusals import complaint, raised

ADAPTER = EXAMPLES / "solver-adapter"
STRIPS = EXAMPLES / "uniaxial-valmex7318"
LAW = HypoelasticLaw(BETA, strain_range=np.array([0.16, 0.24, 0.9]))
SIMULATE = ("simulate", "uniaxial", "project.toml", "--card", "material.toml", "--overwrite")
GROUP = "bubblefit.solvers"
DIAGNOSE = "bubblefit.solvers.calculix.solver.diagnose"


@pytest.fixture(scope="session")
def site(tmp_path_factory):
    return install_by_pip(ADAPTER, tmp_path_factory.mktemp("adapter"))


@pytest.fixture
def strips(tmp_path):
    text = (STRIPS / "project.toml").read_text()
    (tmp_path / "project.toml").write_text(text.replace("increments = 100", "increments = 10"))
    shutil.copy(STRIPS / "curves.csv", tmp_path)
    write_card(MaterialCard(LAW, 0.81, "Valmex"), tmp_path / "material.toml")
    return tmp_path


@pytest.fixture
def example(site, monkeypatch):
    monkeypatch.syspath_prepend(str(site))
    yield
    for name in ("bubblefit_homogeneous", "homogeneous_program"):
        sys.modules.pop(name, None)


@pytest.mark.slow
def test_a_fit_is_led_by_the_membrane_and_counts_the_examples_runs(example, strips):
    path = strips / "curves.csv"
    kept = [line for line in path.read_text().splitlines() if not line.startswith("bias")]
    path.write_text("\n".join(kept) + "\n")
    project = strips / "project.toml"
    text = project.read_text()
    assert "# strain_range = " in text and 'form = "cubic"' in text
    # No bias strip says how far the shear goes.
    text = text.replace("# strain_range = ", "strain_range = ")
    project.write_text(text.replace('form = "cubic"', 'form = "linear"'))
    done = in_process(
        "uniaxial", "project.toml", "--solver", "homogeneous", "--starts", 1, "--jobs", 1, "--out",
        "out", cwd=strips,
    )  # fmt: skip
    result = json.loads((strips / "out" / "result.json").read_text())
    assert result["solver"] == "homogeneous" and 0 < result["external_runs"] < 20, done.stdout
    history = pd.read_csv(strips / "out" / "history.csv")
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
def test_the_example_agrees_with_the_membrane(example, direction, law):
    model = straight_strip(direction, 20.0, 22.0, 0.81, increments=7)
    theirs, ours = (s.run(model, law) for s in (solver_named("homogeneous"), MembraneSolver()))
    np.testing.assert_allclose(theirs.load, ours.load, rtol=1e-9)
    np.testing.assert_allclose(theirs.displacement, ours.displacement, atol=1e-8)
    np.testing.assert_allclose(theirs.strain_min, ours.strain_min, atol=1e-9)
    np.testing.assert_allclose(theirs.strain_max, ours.strain_max, atol=1e-9)
    for name, force in ours.reactions.items():
        if name in theirs.reactions:
            np.testing.assert_allclose(theirs.reactions[name], force, atol=1e-6)


def test_the_examples_failures_have_their_reasons(example, tmp_path):
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


def test_options_come_from_the_project_file(example, strips, monkeypatch):
    monkeypatch.chdir(strips)
    path = strips / "project.toml"
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
def test_doctor_tells_what_a_plug_in_does(packages, strips, monkeypatch, what):
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
        monkeypatch.chdir(strips)
        done = CliRunner().invoke(main, [*SIMULATE, "--solver", "acme"])
        assert done.exit_code == 4 and words in done.output and done.output.count("\n") == 1


def fake(path, version="2.99", then="exit 0"):
    return write_program(
        path, f'#!/bin/sh\n[ "$1" = -v ] && echo "This is Version {version}"\n{then}\n'
    )


@pytest.fixture
def bare(tmp_path, monkeypatch):
    (tmp_path / "bin").mkdir()
    (tmp_path / "cache").mkdir()
    monkeypatch.setenv("PATH", str(tmp_path / "bin"))
    monkeypatch.setenv("BUBBLEFIT_CACHE", str(tmp_path / "cache"))
    monkeypatch.delenv("BUBBLEFIT_CCX", raising=False)
    return tmp_path


def doctor(*arguments, code=0):
    return in_process("doctor", *arguments, cwd=ROOT, code=code).stdout


def test_the_bars_are_the_published_ones():
    text = (PUBLISHED / "marc_uniaxial_end_stress.csv").read_text()
    rows = csv.DictReader(line for line in text.splitlines() if not line.startswith("#"))
    for row, bar in zip(rows, BARS, strict=True):
        assert (row["model"], row["direction"]) == (bar.model, bar.direction)
        assert [float(row[f"c{i}"]) for i in range(4)] == list(bar.modulus)
        assert float(row["end_strain_engineering"]) == bar.elongation
        assert float(row["marc_end_stress_MPa"]) == bar.stress
    # The integral of the published coefficients itself is up to 6e-5 off the published stress.
    for bar in BARS:
        antiderivative = np.polyint(1e3 * np.array(bar.modulus[::-1]))
        exact = np.polyval(antiderivative, np.log1p(bar.elongation))
        assert abs(exact / bar.stress - 1) < 6e-5


def test_every_ccx_by_preference(bare, monkeypatch):
    raised(SolverFailure, r"no ccx.*make calculix", find_ccx)
    named, chosen = fake(bare / "mine" / "ccx"), fake(bare / "other" / "ccx-2")
    built = fake(bare / "cache" / "calculix" / "ccx-2.99-external" / "ccx")
    system = fake(bare / "bin" / "ccx_2.99")
    fake(bare / "bin" / "ccx2paraview")
    monkeypatch.setenv("BUBBLEFIT_CCX", str(chosen))
    # A script cannot be looked into: external is None.
    assert [(one.path, one.origin, one.version, one.external) for one in every_ccx(named)] == [
        (named, "named", "2.99", None), (chosen, "BUBBLEFIT_CCX", "2.99", None),
        (built, "make calculix", "2.99", None), (system, "PATH", "2.99", None),
    ]  # fmt: skip
    assert [one.path for one in every_ccx(chosen)].count(chosen) == 1
    assert find_ccx(named).path == named and find_ccx().path == chosen
    monkeypatch.delenv("BUBBLEFIT_CCX")
    assert find_ccx().path == built
    built.unlink()
    assert find_ccx().path == find_ccx("ccx_2.99").path == system


def test_a_ccx_without_material_libraries_is_passed_over_or_refused(bare):
    plain = bare / "bin" / "ccx"
    shutil.copy("/bin/true", plain)
    assert carries_external(plain) is False
    raised(SolverFailure, f"{plain} cannot.*make calculix", find_ccx)
    raised(SolverFailure, "cannot load material libraries", find_ccx, plain)
    better = fake(bare / "bin" / "ccx_3")
    assert find_ccx().path == better


@pytest.mark.parametrize("by", ["argument", "variable"])
def test_a_ccx_that_was_named_and_is_not_there_is_bad_input(bare, monkeypatch, by):
    missing = bare / "nowhere" / "ccx"
    fake(bare / "bin" / "ccx")
    if by == "variable":
        monkeypatch.setenv("BUBBLEFIT_CCX", str(missing))
    with pytest.raises(InputError, match=r"nowhere/ccx: .*no such file"):
        find_ccx(missing if by == "argument" else None)
    missing.parent.mkdir()
    missing.write_text("")
    assert "not executable" in complaint(find_ccx, missing)


def test_doctor_accepts_a_good_ccx(ccx, monkeypatch):
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


def test_doctor_fails_for_a_ccx_that_was_named(bare, monkeypatch):
    broken = fake(bare / "mine" / "ccx", then="exit 3")
    cc = shutil.which("cc", path=os.defpath) or shutil.which("gcc", path=os.defpath)
    monkeypatch.setenv("CC", cc or "cc")
    monkeypatch.setenv("PATH", os.defpath)
    text = doctor("--ccx", broken, code=4)
    assert f"{broken} (named)" in text and "cannot be seen" in text
    monkeypatch.setenv("BUBBLEFIT_CCX", str(bare / "nowhere"))
    text = doctor(code=4)
    assert "no such file" in text
