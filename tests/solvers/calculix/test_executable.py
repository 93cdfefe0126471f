"""solvers/calculix/executable.py: which ccx is taken, and its progress."""

import shutil

import pytest
from bubblefit.errors import InputError, SolverFailure
from bubblefit.solvers.calculix.executable import carries_external, every_ccx, find_ccx, increments

from ...support.refusals import complaint, raised
from .cases import GIVE, LINEAR_LAW, STA, TOLD, fake_ccx_program, small_bubble


def test_progress_is_reported_during_the_run(fake_ccx, ccx_results, tmp_path):
    told = []
    script = f"{TOLD}sleep 0.4; cp {ccx_results}/job.frd . ; {GIVE}"
    fake_ccx(script, progress=told.append).run(small_bubble(), LINEAR_LAW)
    seen = [(i.step, i.increment, i.iterations, i.time) for i in told]
    assert seen == [(1, 1, 10, 0.003), (1, 2, 5, 0.006)]
    # Half a line waits.
    (tmp_path / "job.sta").write_text(STA[:-40])
    assert [i.increment for i in increments(tmp_path / "job.sta")] == [1]
    assert increments(tmp_path / "none.sta") == []


def test_ccx_programs_are_listed_by_preference(no_ccx, monkeypatch):
    raised(SolverFailure, r"no ccx.*make calculix", find_ccx)
    named, chosen = (
        fake_ccx_program(no_ccx / "mine" / "ccx"),
        fake_ccx_program(no_ccx / "other" / "ccx-2"),
    )
    built = fake_ccx_program(no_ccx / "cache" / "calculix" / "ccx-2.99-external" / "ccx")
    system = fake_ccx_program(no_ccx / "bin" / "ccx_2.99")
    fake_ccx_program(no_ccx / "bin" / "ccx2paraview")
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


def test_ccx_without_material_libraries_is_passed_over_or_refused(no_ccx):
    plain = no_ccx / "bin" / "ccx"
    shutil.copy("/bin/true", plain)
    assert carries_external(plain) is False
    raised(SolverFailure, f"{plain} cannot.*make calculix", find_ccx)
    raised(SolverFailure, "cannot load material libraries", find_ccx, plain)
    better = fake_ccx_program(no_ccx / "bin" / "ccx_3")
    assert find_ccx().path == better


@pytest.mark.parametrize("by", ["argument", "variable"])
def test_named_ccx_that_is_missing_is_bad_input(no_ccx, monkeypatch, by):
    missing = no_ccx / "nowhere" / "ccx"
    fake_ccx_program(no_ccx / "bin" / "ccx")
    if by == "variable":
        monkeypatch.setenv("BUBBLEFIT_CCX", str(missing))
    with pytest.raises(InputError, match=r"nowhere/ccx: .*no such file"):
        find_ccx(missing if by == "argument" else None)
    missing.parent.mkdir()
    missing.write_text("")
    assert "not executable" in complaint(find_ccx, missing)
