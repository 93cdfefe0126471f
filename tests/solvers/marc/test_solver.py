"""solvers/marc/solver.py: runs of Marc with a small program in its place, and their ends."""

import re

import numpy as np
import pytest
from bubblefit.errors import InputError, SolverFailure
from bubblefit.materials.law import HypoelasticLaw
from bubblefit.meshes.bubble_model import BubbleModel
from bubblefit.meshes.closed_surfaces import enclosed_volume
from bubblefit.meshes.disk import disk_mesh
from bubblefit.meshes.strip_models import straight_strip
from bubblefit.solvers.bars import BARS, TOLERANCE
from bubblefit.solvers.marc import solver as proof
from bubblefit.solvers.marc.analyses import touching
from bubblefit.solvers.marc.settings import MarcSettings
from bubblefit.solvers.marc.solver import (
    MarcSolver,
    exit_number,
    increments,
    repeated,
    run_command,
)
from bubblefit.solvers.membrane.solver import MembraneSolver
from bubblefit.solvers.registry import diagnose
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from ...marc_stand_in.files import bending_marc, sts_text
from ...support.refusals import raised
from .cases import LINEAR_LAW, marc_failure_of, write_run_files

ROUNDING = 5.1e-6


def frames_of(model, grown, name="Contact Normal Force", last=3):
    """Inflated, then squeezed by the collar: forces and times as Marc would report them."""
    filled, points = len(model.inflation), model.mesh.points
    zero = np.zeros_like(points)
    frames = [(0.0, {"Displacement": zero, name: zero})]
    for i in range(filled):
        frames.append((i + 1.0, {"Displacement": grown * (i + 1) / filled, name: zero}))
    frames.append((filled + 1.0, {"Displacement": grown, name: zero}))
    touch, loads = touching(model), []
    for i in range(last):
        forces = zero.copy()
        forces[touch["collar"][:3], 1] = -(i + 1.0)
        forces[touch["supports"][:2], 1] = 1.5 * (i + 1.0)
        forces[touch["collar"][0], 0] = 7.0
        u = grown - 0.01 * (i + 1) * points * [1, 1, 0]
        frames.append((filled + 2.0 + i, {"Displacement": u, name: forces}))
        loads.append(4 * 3 * (i + 1.0))
    return frames, loads


@pytest.fixture
def marc_that_returns(tmp_path, monkeypatch, tube_model):
    monkeypatch.delenv("BUBBLEFIT_MARC", raising=False)
    scratch = str(tmp_path / "scratch")
    return lambda frames, number=3004: MarcSolver(
        marc=bending_marc(tmp_path, tube_model, frames, number), scratch=scratch
    )


@pytest.mark.parametrize("name", ["Contact Normal Force", "Reaction Force"])
def test_forces_volume_and_pressure_of_a_bending_are_read(
    marc_that_returns, tube_model, inflated_points, name
):
    frames, loads = frames_of(tube_model, inflated_points, name)
    history = marc_that_returns(frames).run(tube_model, LINEAR_LAW)
    np.testing.assert_allclose(history.load, [0, *loads], rtol=ROUNDING)
    np.testing.assert_allclose(history.reactions["supports"][:, 1], [0, *loads], rtol=ROUNDING)
    assert (history.reactions["collar"][:, [0, 2]] == 0).all()
    kept = [fields["Displacement"] for time, fields in frames if time in (10.0, 12.0, 13.0, 14.0)]
    np.testing.assert_allclose(history.displacement, kept, rtol=2 * ROUNDING, atol=1e-9)
    volume = [4 * enclosed_volume(tube_model.mesh.points + u, tube_model.mesh.quads) for u in kept]
    np.testing.assert_allclose(history.cavity_volume, volume, rtol=1e-5)
    absolute = history.cavity_pressure + 0.101
    np.testing.assert_allclose(absolute * history.cavity_volume, 0.201 * volume[0], rtol=1e-5)
    assert history.cavity_pressure[0] == pytest.approx(0.1)
    assert not any("balance" in words for words in history.remarks)


@pytest.mark.parametrize("what", ["collapse", "missing", "forces"])
def test_incomplete_results_of_a_bending_are_failures(
    marc_that_returns, tube_model, inflated_points, what
):
    name = "Something Else" if what == "forces" else "Contact Normal Force"
    frames, _ = frames_of(tube_model, inflated_points, name, last=0 if what == "collapse" else 3)
    if what == "missing":
        del frames[-2]
    number = 3015 if what == "collapse" else 3004
    said = {"collapse": "time step could not get smaller", "missing": "holds 3 of 4 frames",
            "forces": "Reaction Force"}  # fmt: skip
    found = raised(
        SolverFailure, said[what], marc_that_returns(frames, number).run, tube_model, LINEAR_LAW
    )
    assert found.exit_number == number


LAW = HypoelasticLaw.linear(800.0, 400.0, 60.0)
#: Six digits of the .t19: half a unit in the last of them.
FAKE_ROUNDING = 5.1e-6


def model():
    return BubbleModel(disk_mesh(100.0, 32, "quarter"), 0.81, (0.01, 0.03))


def test_bubble_comes_back_to_six_digits(fake_marc, complete_run):
    folder, expected = complete_run
    # It begins in an empty folder; talk of licences in a good run is no failure.
    solver = fake_marc(f'[ "$(ls)" = "job.dat\nscreen.txt" ] && echo "$@" > {folder}/words; '
                  f"echo 'license error, retried'; cp {folder}/job.* .; exit 1")  # fmt: skip
    for _ in range(2):
        history = solver.run(model(), LAW)
        np.testing.assert_allclose(history.load, expected.load)
        np.testing.assert_allclose(history.displacement, expected.displacement, rtol=FAKE_ROUNDING)
        np.testing.assert_allclose(history.strain_max, expected.strain_max, rtol=1e-4, atol=1e-8)
        assert history.iterations == 6 and set(history.reactions) >= {"rim"}
        words = (folder / "words").read_text().split()
        assert words == ["-j", "job", "-v", "no", "-b", "no", "-nte", "1", "-nts", "1"]
        (folder / "words").unlink()
    assert not list((folder.parent / "scratch").iterdir()), "a good run left something"
    # Increments that were repeated are remarked, and an older Marc says its number elsewhere.
    text = sts_text([1.0, 1.5, 2.0], increments=[1, 2, 2]).replace("exit number", "number")
    (folder / "job.sts").write_text(text)
    script = f"cp {folder}/job.* .; echo 'Exit number 3004' > job.log"
    found = fake_marc(script, keep=True).run(model(), LAW)
    assert any("1 increments were repeated" in words for words in found.remarks)
    (kept,) = (folder.parent / "scratch").iterdir()
    assert (kept / "job.dat").exists() and (kept / "job.t19").exists()


@pytest.mark.parametrize(
    ("damage", "match"),
    [
        ("rm job.t19", "cannot be read"),
        ("head -c 3000 {0}/job.t19 > job.t19", "truncated"),
        ("echo garbage > job.t19", "not a formatted post file"),
        ("sed 's/^Displacement/Velocity    /' {0}/job.t19 > job.t19", "time 1 of 2: holds no Disp"),
        ("sed 's/ 0.200000E+01/ 0.150000E+01/' {0}/job.t19 > job.t19", "time 2 of 2"),
    ],
)
def test_unusable_results_are_failures(fake_marc, complete_run, damage, match):
    folder, _ = complete_run
    error = marc_failure_of(fake_marc(f"cp {folder}/job.* .; {damage.format(folder)}"))
    assert "no usable results" in error.reason
    assert re.search(match, error.reason)


def test_results_of_another_job_are_refused(fake_machine, fake_marc):
    other = BubbleModel(disk_mesh(120.0, 32, "quarter"), 0.81, (0.01, 0.03))
    folder = write_run_files(fake_machine / "other", other, MembraneSolver().run(other, LAW))
    assert "of another job" in marc_failure_of(fake_marc(f"cp {folder}/job.* .")).reason
    finer = BubbleModel(disk_mesh(100.0, 108, "quarter"), 0.81, (0.01, 0.03))
    folder = write_run_files(fake_machine / "finer", finer, MembraneSolver().run(finer, LAW))
    assert "are not the deck's" in marc_failure_of(fake_marc(f"cp {folder}/job.* .")).reason


def test_strip_without_forces_is_a_failure(fake_machine, fake_marc):
    given = straight_strip("warp", 50, 60, 0.81, increments=5)
    folder = write_run_files(fake_machine / "good", given, MembraneSolver().run(given, LAW))
    error = marc_failure_of(fake_marc(f"sed 's/^Reaction/Anything/' {folder}/job.t19 > job.t19; "
                         f"cp {folder}/job.sts ."), given)  # fmt: skip
    assert "Reaction Force" in error.reason and "post" in error.reason


def test_marc_that_cannot_be_started_is_bad_input(fake_machine):
    raised(SolverFailure, "no run_marc on the PATH", MarcSolver().run, model(), LAW)
    found = MarcSolver().check()
    assert not found.available and "bubblefit docs marc" in found.advice
    for words in ("no such file", "not executable"):
        raised(InputError, words, MarcSolver(marc=fake_machine / "marc").run, model(), LAW)
        (fake_machine / "marc").write_text("#!/bin/sh\n")


class Embedded(MarcSolver):
    """The membrane in Marc's place, to the digits of a .t19."""

    def run(self, model, law, scratch=None, timeout=None):
        return MembraneSolver().run(model, law)


def test_doctor_bars_pass_with_the_right_law_only(fake_machine, monkeypatch):
    stresses = proof.prove(Embedded())
    np.testing.assert_allclose(stresses, [bar.stress for bar in BARS], rtol=TOLERANCE)
    monkeypatch.setattr(proof, "bar_law", lambda _: LAW)
    raised(SolverFailure, "does not carry the law", proof.prove, Embedded())


def test_doctor_reports_a_named_marc(fake_marc, complete_run, tmp_path, monkeypatch):
    folder, _ = complete_run
    fake_marc(f"cp {folder}/job.* .")
    monkeypatch.setenv("PATH", "/usr/bin:/bin")
    monkeypatch.setenv("BUBBLEFIT_CACHE", str(tmp_path))  # without a ccx, which takes seconds
    assert [one.name for one in diagnose()][-1] != "marc"
    # It is there, but does not answer the bars.
    site = tmp_path / "site.toml"
    site.write_text('executable = "./run_marc"\nscratch = "scratch"\nversion = "2023.1"\n')
    (found,) = [one for one in diagnose(marc=site) if one.name == "marc"]
    assert found.expected and not found.usable and "ended at time 2 of 100" in found.advice
    assert found.version == "2023.1"
    (found,) = [one for one in diagnose(marc=tmp_path / "none") if one.name == "marc"]
    assert not found.usable and "no such file" in found.advice
    monkeypatch.setenv("BUBBLEFIT_MARC", str(site))
    (found,) = [one for one in diagnose() if one.name == "marc"]
    assert found.origin == "BUBBLEFIT_MARC" and found.path == tmp_path / "run_marc"


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


def test_program_of_a_relative_path_is_started_from_the_folder_of_a_run(monkeypatch, tmp_path):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("HOME", str(tmp_path / "home"))
    for executable, program in (
        ("bin/run_marc", tmp_path / "bin/run_marc"),
        ("~/run_marc", tmp_path / "home/run_marc"),
        ("run_marc", "run_marc"),
    ):
        command = run_command(MarcSettings(executable=executable), "job", None)
        assert command[0] == str(program)
