"""What can go wrong with an external program, each tried with a real or a fake one."""

import os
import re
import signal
import time

import pytest
from bubblefit.errors import InputError, SolverFailure
from bubblefit.materials.law import HypoelasticLaw
from bubblefit.meshes.bubble_model import BubbleModel
from bubblefit.meshes.disk import disk_mesh
from bubblefit.solvers import scratch
from bubblefit.solvers.calculix import solver as module
from bubblefit.solvers.calculix.executable import increments
from bubblefit.solvers.calculix.library import law_number
from bubblefit.solvers.calculix.solver import CalculixSolver

from ...builders.projects import CONSTANT_BUBBLE
from ...support.commands import alive, interrupted, wait_for
from ...support.refusals import raised

LAW = HypoelasticLaw.linear(800.0, 400.0, 60.0)
STA = """SUMMARY OF JOB INFORMATION
  STEP      INC     ATT  ITRS     TOT TIME     STEP TIME      INC TIME
     1          1     1U   12  0.000000E+00  0.000000E+00  0.100000E+01
     1          1     2    10  0.300000E-02  0.300000E-02  0.300000E-02
     1          2     1     5  0.600000E-02  0.600000E-02  0.300000E-02
"""


def model():
    return BubbleModel(disk_mesh(100.0, 32, "quarter"), 0.81, (0.01, 0.03))


@pytest.fixture
def fake(tmp_path, monkeypatch):
    """Makes a solver of a shell script, which runs in the scratch folder with $2 = job."""
    monkeypatch.setattr(module, "material_library", lambda: tmp_path / "libBUBBLEFIT.so")

    def make(script, **options):
        path = tmp_path / "ccx"
        path.write_text(f'#!/bin/sh\n[ "$1" = -v ] && echo "Version 9.9" && exit\n{script}\n')
        path.chmod(0o755)
        (tmp_path / "scratch").mkdir(exist_ok=True)
        return CalculixSolver(ccx=path, element="S4", scratch=tmp_path / "scratch", **options)

    return make


def failure(solver, **options):
    found = raised(SolverFailure, "", solver.run, model(), LAW, **options)
    assert found.scratch.is_dir()
    assert (found.scratch / "job.inp").exists()
    return found


def test_a_program_of_another_machine(tmp_path, monkeypatch):
    monkeypatch.setattr(module, "material_library", lambda: tmp_path / "libBUBBLEFIT.so")
    (tmp_path / "ccx").write_bytes(b"\x00\x01\x02 of another machine")
    (tmp_path / "ccx").chmod(0o755)
    with pytest.raises(InputError, match=r"ccx.*cannot be started: Exec format error"):
        CalculixSolver(ccx=tmp_path / "ccx", scratch=tmp_path / "s").run(model(), LAW)
    assert not list((tmp_path / "s").iterdir())


def test_its_own_error_message_is_the_reason(fake):
    text = " *ERROR reading *STEP: something is\\n        wrong here\\n"
    found = failure(fake(f"printf '{text}'; for i in $(seq 30); do echo line $i; done; exit 201"))
    assert found.reason == "reading *STEP: something is wrong here (at once)"
    assert found.exit_number == 201
    assert len(found.log_tail.splitlines()) == 25 and "line 30" in str(found)


def test_its_exit_code_counts_whatever_it_says(fake):
    script = f"cat > job.sta <<'.'\n{STA}.\necho ' Job finished'; touch job.frd; exit 3"
    found = failure(fake(script))
    assert found.reason == "ended badly after step 1, increment 2"
    assert found.exit_number == 3


GIVE = "echo Job finished"
TOLD = f"cat > job.sta <<'.'\n{STA}.\n"


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
def test_a_bad_end_has_its_reason(fake, script, exit_code, reason):
    found = failure(fake(script))
    assert reason in found.reason and found.exit_number in (exit_code, None)


@pytest.mark.parametrize(("end", "timeout"), [("wait", 1.0), ("exit 1", 60.0)])
def test_no_child_goes_on_writing(fake, tmp_path, end, timeout):
    pids = tmp_path / "pids"
    found = failure(fake(f"sleep 1000 & echo $! $$ > {pids}; {end}", timeout=timeout))
    assert (found.reason == "did not end within 1 s: killed at once") == (end == "wait")
    wait_for(lambda: not any(map(alive, pids.read_text().split())), 5)


@pytest.fixture(scope="module")
def results(ccx, tmp_path_factory):
    folder = tmp_path_factory.mktemp("real")
    CalculixSolver(element="S4", scratch=folder, keep=True).run(model(), LAW)
    (kept,) = folder.iterdir()
    return kept


def test_a_whole_result_is_taken_and_parts_are_not(fake, results):
    assert fake(f"cp {results}/job.frd . ; {GIVE}").run(model(), LAW).displacement.shape[0] == 2
    whole = (results / "job.frd").read_bytes()
    for part in (len(whole) // 3, len(whole) // 2, len(whole) - 3):
        cut = f"head -c {part} {results}/job.frd > job.frd; {GIVE}"
        assert "truncated" in failure(fake(cut)).reason
    # A file that ends well, one step early.
    places = [found.start() for found in re.finditer(b"    1PSTEP", whole)]
    assert len(places) == 4  # displacement and force, two steps
    (results / "early.frd").write_bytes(whole[: places[2]] + b" 9999\n")
    early = f"cp {results}/early.frd job.frd; {GIVE}"
    assert "step 2 of 2" in failure(fake(early)).reason


def test_nothing_stale_is_read(fake, results, tmp_path):
    kept = fake(f"cp {results}/job.frd . ; echo Job finished", keep=True)
    kept.run(model(), LAW)
    first = {p.name for p in (tmp_path / "scratch").iterdir()}
    assert len(first) == 1
    second = failure(fake("ls > seen; echo Job finished"))
    assert second.scratch.name not in first
    assert set((second.scratch / "seen").read_text().split()) == {
        "job.inp", "job.log", "mesh.inp", "seen", f"bubblefit-{law_number(LAW)}.law",
    }  # fmt: skip


def test_scratch_is_removed_after_success_and_interruption(fake, results, tmp_path):
    fake(f"cp {results}/job.frd . ; echo Job finished").run(model(), LAW)

    def stop(_):
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        fake(f"cat > job.sta <<'.'\n{STA}.\nsleep 1000", progress=stop).run(model(), LAW)
    assert not list((tmp_path / "scratch").iterdir())


def test_progress_is_told_while_it_runs(fake, results, tmp_path):
    told = []
    script = f"{TOLD}sleep 0.4; cp {results}/job.frd . ; {GIVE}"
    fake(script, progress=told.append).run(model(), LAW)
    seen = [(i.step, i.increment, i.iterations, i.time) for i in told]
    assert seen == [(1, 1, 10, 0.003), (1, 2, 5, 0.006)]
    # Half a line waits.
    (tmp_path / "job.sta").write_text(STA[:-40])
    assert [i.increment for i in increments(tmp_path / "job.sta")] == [1]
    assert increments(tmp_path / "none.sta") == []


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


@pytest.mark.parametrize("moment", ["mkdtemp", "rmtree"])
def test_no_moment_of_an_interruption_leaves_a_folder(tmp_path, monkeypatch, moment):
    place = scratch.tempfile if moment == "mkdtemp" else scratch.shutil
    really, came = getattr(place, moment), []

    def interrupted(*args, **options):
        done = really(*args, **options) if moment == "mkdtemp" else None
        if not came:
            came.append(1)
            os.kill(os.getpid(), signal.SIGINT)
        return done if moment == "mkdtemp" else really(*args, **options)

    monkeypatch.setattr(place, moment, interrupted)
    with (
        pytest.raises(KeyboardInterrupt),
        scratch.run_folder("ccx", tmp_path, False, "calculix", "job.log") as folder,
    ):
        (folder / "job.inp").write_text("*NODE")
    scratch.remove_interrupted()
    assert came and not list(tmp_path.iterdir())


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
