"""solvers/calculix/solver.py: what can go wrong in a run, with a real and a fake program."""

import re
import time

import pytest
from bubblefit.errors import InputError, SolverFailure
from bubblefit.solvers.calculix import solver as module
from bubblefit.solvers.calculix.library import law_number
from bubblefit.solvers.calculix.solver import CalculixSolver

from ...builders.projects import CONSTANT_BUBBLE
from ...support.commands import alive, interrupted, wait_for
from ...support.refusals import raised
from .cases import GIVE, LINEAR_LAW, STA, STRIP_LAW, TOLD, failure_of, small_bubble, strip_model_of


def test_program_of_another_machine_is_bad_input(tmp_path, monkeypatch):
    monkeypatch.setattr(module, "material_library", lambda: tmp_path / "libBUBBLEFIT.so")
    (tmp_path / "ccx").write_bytes(b"\x00\x01\x02 of another machine")
    (tmp_path / "ccx").chmod(0o755)
    with pytest.raises(InputError, match=r"ccx.*cannot be started: Exec format error"):
        CalculixSolver(ccx=tmp_path / "ccx", scratch=tmp_path / "s").run(small_bubble(), LINEAR_LAW)
    assert not list((tmp_path / "s").iterdir())


def test_reason_of_a_failure_is_the_programs_error_message(fake_ccx):
    text = " *ERROR reading *STEP: something is\\n        wrong here\\n"
    found = failure_of(
        fake_ccx(f"printf '{text}'; for i in $(seq 30); do echo line $i; done; exit 201")
    )
    assert found.reason == "reading *STEP: something is wrong here (at once)"
    assert found.exit_number == 201
    assert len(found.log_tail.splitlines()) == 25 and "line 30" in str(found)


def test_exit_code_counts_whatever_the_program_prints(fake_ccx):
    script = f"cat > job.sta <<'.'\n{STA}.\necho ' Job finished'; touch job.frd; exit 3"
    found = failure_of(fake_ccx(script))
    assert found.reason == "ended badly after step 1, increment 2"
    assert found.exit_number == 3


@pytest.mark.parametrize(
    ("script", "exit_code", "reason"),
    [
        ('echo "usage: convert IN OUT"; exit 0', 0, "is this CalculiX?"),
        (f"{TOLD}echo ' *ERROR in nonlingeo: max. # of increments reached'; exit 201", 201,
         "did not converge at step 1, increment 3: the increments became too small or too many"),
        (GIVE, 0, "job.frd: cannot be read"),
        (f"head -c 5000 /dev/urandom > job.frd; {GIVE}", 0, "not a CalculiX result file"),
    ],
)  # fmt: skip
def test_bad_end_has_its_reason(fake_ccx, script, exit_code, reason):
    found = failure_of(fake_ccx(script))
    assert reason in found.reason and found.exit_number in (exit_code, None)


@pytest.mark.parametrize(("end", "timeout"), [("wait", 1.0), ("exit 1", 60.0)])
def test_children_of_a_stopped_program_are_stopped(fake_ccx, tmp_path, end, timeout):
    pids = tmp_path / "pids"
    found = failure_of(fake_ccx(f"sleep 1000 & echo $! $$ > {pids}; {end}", timeout=timeout))
    assert (found.reason == "did not end within 1 s: killed at once") == (end == "wait")
    wait_for(lambda: not any(map(alive, pids.read_text().split())), 5)


def test_complete_result_is_taken_and_partial_results_are_not(fake_ccx, ccx_results):
    assert (
        fake_ccx(f"cp {ccx_results}/job.frd . ; {GIVE}")
        .run(small_bubble(), LINEAR_LAW)
        .displacement.shape[0]
        == 2
    )
    whole = (ccx_results / "job.frd").read_bytes()
    for part in (len(whole) // 3, len(whole) // 2, len(whole) - 3):
        cut = f"head -c {part} {ccx_results}/job.frd > job.frd; {GIVE}"
        assert "truncated" in failure_of(fake_ccx(cut)).reason
    # A file that ends well, one step early.
    places = [found.start() for found in re.finditer(b"    1PSTEP", whole)]
    assert len(places) == 4  # displacement and force, two steps
    (ccx_results / "early.frd").write_bytes(whole[: places[2]] + b" 9999\n")
    early = f"cp {ccx_results}/early.frd job.frd; {GIVE}"
    assert "step 2 of 2" in failure_of(fake_ccx(early)).reason


def test_results_of_an_earlier_run_are_not_read(fake_ccx, ccx_results, tmp_path):
    kept = fake_ccx(f"cp {ccx_results}/job.frd . ; echo Job finished", keep=True)
    kept.run(small_bubble(), LINEAR_LAW)
    first = {p.name for p in (tmp_path / "scratch").iterdir()}
    assert len(first) == 1
    second = failure_of(fake_ccx("ls > seen; echo Job finished"))
    assert second.scratch.name not in first
    assert set((second.scratch / "seen").read_text().split()) == {
        "job.inp", "job.log", "mesh.inp", "seen", f"bubblefit-{law_number(LINEAR_LAW)}.law",
    }  # fmt: skip


def test_scratch_is_removed_after_success_and_interruption(fake_ccx, ccx_results, tmp_path):
    fake_ccx(f"cp {ccx_results}/job.frd . ; echo Job finished").run(small_bubble(), LINEAR_LAW)

    def stop(_):
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        fake_ccx(f"cat > job.sta <<'.'\n{STA}.\nsleep 1000", progress=stop).run(
            small_bubble(), LINEAR_LAW
        )
    assert not list((tmp_path / "scratch").iterdir())


PROJECT = f"""{CONSTANT_BUBBLE}
[fit]
tolerance = 1e-4
solver = "calculix"
[solver.calculix]
element = "S4"
scratch = "scratch"
ccx = "./ccx"
"""


def study(folder, script):
    (folder / "project.toml").write_text(PROJECT)
    (folder / "ccx").write_text(f'#!/bin/sh\n[ "$1" = -v ] && exec true\n{script}\n')
    (folder / "ccx").chmod(0o755)
    return ["bubble", "project.toml", "--out", "out"]


@pytest.mark.parametrize("jobs", [1, 2])
def test_interruption_ends_calculix(ccx, tmp_path, jobs):
    script = (
        f"echo $$ >> {tmp_path}/pids; [ $(wc -l < {tmp_path}/pids) -gt 2 ] && exec sleep 1000\n"
    )
    arguments = [*study(tmp_path, f'{script}exec {ccx.path} "$@"'), "--starts", "2", "--jobs", jobs]
    pids = tmp_path / "pids"

    def all_run():
        if not pids.exists() or len(pids.read_text().split()) < 3:
            return False
        time.sleep(0.3)
        return True

    ended = interrupted(*arguments, cwd=tmp_path, when=all_run)
    assert ended.returncode == 130 and "--resume" in ended.stderr
    wait_for(lambda: not any(map(alive, pids.read_text().split())), 5)
    assert not list((tmp_path / "scratch").iterdir())


def test_run_beyond_its_time_limit_is_a_failure(ccx, tmp_path):
    solver = CalculixSolver(scratch=tmp_path)
    raised(
        SolverFailure,
        r"did not end within 0\.5 s",
        solver.run,
        strip_model_of("bias"),
        STRIP_LAW,
        timeout=0.5,
    )
    assert len(list(tmp_path.iterdir())) == 1  # no second try
