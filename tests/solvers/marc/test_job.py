"""solvers/marc/job.py: subroutine, environment and modules of a run, its progress and end."""

import re

import pytest
from bubblefit.errors import SolverFailure
from bubblefit.materials.law import HypoelasticLaw
from bubblefit.meshes.bubble_model import BubbleModel
from bubblefit.meshes.disk import disk_mesh
from bubblefit.solvers.marc.job import exit_number, increments, repeated
from bubblefit.solvers.marc.solver import MarcSolver
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from ...marc_stand_in.files import sts_text
from .cases import marc_failure_of, write_run_files

LAW = HypoelasticLaw.linear(800.0, 400.0, 60.0)


def model():
    return BubbleModel(disk_mesh(100.0, 32, "quarter"), 0.81, (0.01, 0.03))


def test_subroutine_is_copied_to_the_run(fake_marc, complete_run):
    folder, _ = complete_run
    solver = fake_marc(f'echo "$@" > {folder}/words; cp hypela2.f {folder}; cp {folder}/job.* .',
                  law="hypela2", options="older", processors=2, threads=3,
                  arguments=["-q", "long"], environment={"MARC_X": "1"})  # fmt: skip
    solver.run(model(), LAW)
    assert "subroutine hypela2" in (folder / "hypela2.f").read_text()
    assert (folder / "words").read_text().split() == (
        "-jid job -v no -b no -nprocd 2 -nthread 3 -u hypela2.f -q long".split()
    )


def test_environment_and_modules_are_loaded_before_marc(fake_machine, complete_run, monkeypatch):
    folder, _ = complete_run
    # `module` of this machine: it puts a folder on the PATH.
    home = fake_machine / "home"
    home.mkdir()
    (home / ".bash_profile").write_text(
        f'module() {{ [ "$2" = marc/2023 ] && export PATH="{fake_machine}/bin:$PATH"; }}\n'
    )
    (fake_machine / "bin" / "run_marc").write_text(
        f'#!/bin/sh\necho "$SITE $@" > {folder}/words\ncp {folder}/job.* .\n'
    )
    (fake_machine / "bin" / "run_marc").chmod(0o755)
    monkeypatch.setenv("PATH", "/usr/bin:/bin")
    monkeypatch.setenv("HOME", str(home))
    solver = MarcSolver(modules=["marc/2023"], environment={"SITE": "here"})
    assert solver.check().available
    solver.run(model(), LAW)
    with pytest.raises(SolverFailure, match="modules other give no run_marc"):
        MarcSolver(modules=["other"]).run(model(), LAW)
    assert (folder / "words").read_text().startswith("here -j job")


def test_progress_is_reported_once_per_increment(fake_marc, complete_run):
    folder, _ = complete_run
    solver = fake_marc(
        f"head -7 {folder}/job.sts > job.sts; sleep 0.4; cp {folder}/job.* .; sleep 0.3"
    )
    told = []
    solver.progress = told.append
    solver.run(model(), LAW)
    assert [(i.increment, i.time) for i in told] == [(1, 1.0), (2, 2.0)]


STS_3015 = """
     1       1     3    0    0      3    0    0    0 1.00000E+00 1.00000E+00 -1.0E-03 2.0E-01
 Job ends with exit number :    3015
"""


@pytest.mark.parametrize(
    ("script", "number", "reason", "tail"),
    [
        (f"cat > job.sts <<'EOF'{STS_3015}EOF\n"
         "echo '  *** error - time step below minimum in   loadcase inflation' > job.out",
         3015, "time step could not get smaller.*after increment 1",
         r"\A\*\*\* error - time step below minimum in loadcase inflation\Z"),
        ("echo ' Job ends with exit number :  13' > job.sts; exit 0", 13, "did not end well", ""),
        ("echo 'License checkout failed: all licenses are in use'", None,
         "no licence: License checkout failed", ""),
        ("kill -9 $$", None, "killed by SIGKILL", ""),
        ("echo hello; exit 7", None, "wrote no job.sts.*returned 7", "hello"),
        ("echo half > job.sts", None, "said no exit number", ""),
        ("echo 'Exit number 3'; exit 3", 3, "compile or link", ""),
    ],
)  # fmt: skip
def test_bad_end_is_reported_in_the_words_of_marc(fake_marc, script, number, reason, tail):
    error = marc_failure_of(fake_marc(script, law="hypela2" if number == 3 else "nlelast"))
    assert error.exit_number == number and str(error.scratch) in str(error)
    assert re.search(reason, error.reason) and re.search(tail, error.log_tail)


def test_exit_number_3004_alone_is_no_success(fake_machine, fake_marc, complete_run):
    folder, history = complete_run
    (folder / "job.sts").write_text(sts_text([0.5, 1.0]))
    error = marc_failure_of(fake_marc(f"cp {folder}/job.* ."))
    assert "ended at time 1 of 2" in error.reason and error.exit_number == 3004
    write_run_files(folder, model(), history)
    (folder / "job.out").write_text(" *** warning - element inside out at element    17\n")
    assert "inside out (element 17)" in marc_failure_of(fake_marc(f"cp {folder}/job.* .")).reason


# .sts


def test_increments_are_counted_as_they_appear(tmp_path):
    text, path = sts_text([0.5, 1.0, 1.5], increments=[1, 2, 2]), tmp_path / "job.sts"
    assert increments(path) == []
    seen = []
    for size in range(0, len(text) + 1, 7):
        path.write_text(text[:size])
        now = increments(path)
        assert now[: len(seen)] == seen, "half a line was taken for one"
        seen = now
    path.write_text(text)
    assert [(i.increment, i.time) for i in increments(path)] == [(1, 0.5), (2, 1.0), (2, 1.5)]
    assert sum(i.iterations for i in increments(path)) == 9 and repeated(increments(path)) == 1


@pytest.mark.parametrize(
    "line",
    [" Job ends with exit number :    3004", "          job ends with exit number     3004",
     "Exit number 3004"],
)  # fmt: skip
def test_exit_numbers_are_found_in_all_spellings(tmp_path, line):
    (tmp_path / "job.sts").write_text(f"exit number 1\n{line}\n")
    assert exit_number(tmp_path / "none", tmp_path / "job.sts") == 3004
    assert exit_number(tmp_path / "none") is None


@given(st.binary(max_size=400))
@settings(deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
def test_garbage_has_no_status(tmp_path, data):
    path = tmp_path / "job.sts"
    path.write_bytes(data)
    increments(path)
    exit_number(path)
