"""Runs of Marc, each with a small program in its place: what ends well, and all that does not."""

import re

import numpy as np
import pytest
from bubblefit.errors import InputError, SolverFailure
from bubblefit.materials.law import HypoelasticLaw
from bubblefit.meshes.bubble_model import BubbleModel
from bubblefit.meshes.disk import disk_mesh
from bubblefit.meshes.strip_models import straight_strip
from bubblefit.solvers.bars import BARS, TOLERANCE
from bubblefit.solvers.marc import solver as proof
from bubblefit.solvers.marc.settings import BLOCKS, MarcSettings, marc_settings
from bubblefit.solvers.marc.solver import MarcSolver
from bubblefit.solvers.membrane.solver import MembraneSolver
from bubblefit.solvers.registry import diagnose, solver_named

from ...marc_stand_in.files import sts_text, t19_text
from ...support.paths import ROOT
from ...support.refusals import complaint, raised

LAW = HypoelasticLaw.linear(800.0, 400.0, 60.0)
#: Six digits of the .t19: half a unit in the last of them.
ROUNDING = 5.1e-6


def model():
    return BubbleModel(disk_mesh(100.0, 32, "quarter"), 0.81, (0.01, 0.03))


@pytest.fixture
def machine(tmp_path, monkeypatch):
    (tmp_path / "bin").mkdir()
    monkeypatch.setenv("PATH", f"{tmp_path / 'bin'}:/usr/bin:/bin")
    return tmp_path


@pytest.fixture
def fake(machine):
    def make(script, **options):
        path = machine / "run_marc"
        path.write_text(f"#!/bin/sh\n{script}\n")
        path.chmod(0o755)
        (machine / "scratch").mkdir(exist_ok=True)
        return solver_named("marc", marc=path, scratch=str(machine / "scratch"), **options)

    return make


def files(folder, given, history, number=3004):
    """What Marc leaves of a run that ended as `history` (of the embedded solver) says."""
    folder.mkdir(exist_ok=True)
    u = history.path
    still = np.zeros_like(u[0])
    frames = [(float(i), {"Displacement": d, "Reaction Force": still})
              for i, d in enumerate([still, *u])]  # fmt: skip
    (folder / "job.t19").write_text(t19_text(given.mesh.points, given.mesh.quads, frames))
    (folder / "job.sts").write_text(sts_text([float(i + 1) for i in range(len(u))], number))
    (folder / "job.out").write_text("marc\n")
    return folder


@pytest.fixture
def good(machine):
    history = MembraneSolver().run(model(), LAW)
    return files(machine / "good", model(), history), history


def failure(solver, given=None, **options):
    found = raised(SolverFailure, "", solver.run, given or model(), LAW, **options)
    assert found.solver == "marc"
    assert (found.scratch / "job.dat").exists()
    return found


def test_a_bubble_comes_back_to_six_digits(fake, good):
    folder, expected = good
    # It begins in an empty folder; talk of licences in a good run is no failure.
    solver = fake(f'[ "$(ls)" = "job.dat\nscreen.txt" ] && echo "$@" > {folder}/words; '
                  f"echo 'license error, retried'; cp {folder}/job.* .; exit 1")  # fmt: skip
    for _ in range(2):
        history = solver.run(model(), LAW)
        np.testing.assert_allclose(history.load, expected.load)
        np.testing.assert_allclose(history.displacement, expected.displacement, rtol=ROUNDING)
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
    found = fake(script, keep=True).run(model(), LAW)
    assert any("1 increments were repeated" in words for words in found.remarks)
    (kept,) = (folder.parent / "scratch").iterdir()
    assert (kept / "job.dat").exists() and (kept / "job.t19").exists()


def test_progress_is_told_once_an_increment(fake, good):
    folder, _ = good
    solver = fake(f"head -7 {folder}/job.sts > job.sts; sleep 0.4; cp {folder}/job.* .; sleep 0.3")
    told = []
    solver.progress = told.append
    solver.run(model(), LAW)
    assert [(i.increment, i.time) for i in told] == [(1, 1.0), (2, 2.0)]


def test_the_subroutine_goes_along(fake, good):
    folder, _ = good
    solver = fake(f'echo "$@" > {folder}/words; cp hypela2.f {folder}; cp {folder}/job.* .',
                  law="hypela2", options="older", processors=2, threads=3,
                  arguments=["-q", "long"], environment={"MARC_X": "1"})  # fmt: skip
    solver.run(model(), LAW)
    assert "subroutine hypela2" in (folder / "hypela2.f").read_text()
    assert (folder / "words").read_text().split() == (
        "-jid job -v no -b no -nprocd 2 -nthread 3 -u hypela2.f -q long".split()
    )


def test_environment_and_modules_come_before_marc(machine, good, monkeypatch):
    folder, _ = good
    # `module` of this machine: it puts a folder on the PATH.
    home = machine / "home"
    home.mkdir()
    (home / ".bash_profile").write_text(
        f'module() {{ [ "$2" = marc/2023 ] && export PATH="{machine}/bin:$PATH"; }}\n'
    )
    (machine / "bin" / "run_marc").write_text(
        f'#!/bin/sh\necho "$SITE $@" > {folder}/words\ncp {folder}/job.* .\n'
    )
    (machine / "bin" / "run_marc").chmod(0o755)
    monkeypatch.setenv("PATH", "/usr/bin:/bin")
    monkeypatch.setenv("HOME", str(home))
    solver = MarcSolver(modules=["marc/2023"], environment={"SITE": "here"})
    assert solver.check().available
    solver.run(model(), LAW)
    with pytest.raises(SolverFailure, match="modules other give no run_marc"):
        MarcSolver(modules=["other"]).run(model(), LAW)
    assert (folder / "words").read_text().startswith("here -j job")


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
def test_a_bad_end_is_told_in_marcs_own_words(fake, script, number, reason, tail):
    error = failure(fake(script, law="hypela2" if number == 3 else "nlelast"))
    assert error.exit_number == number and str(error.scratch) in str(error)
    assert re.search(reason, error.reason) and re.search(tail, error.log_tail)


def test_3004_is_not_enough(machine, fake, good):
    folder, history = good
    (folder / "job.sts").write_text(sts_text([0.5, 1.0]))
    error = failure(fake(f"cp {folder}/job.* ."))
    assert "ended at time 1 of 2" in error.reason and error.exit_number == 3004
    files(folder, model(), history)
    (folder / "job.out").write_text(" *** warning - element inside out at element    17\n")
    assert "inside out (element 17)" in failure(fake(f"cp {folder}/job.* .")).reason


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
def test_results_that_cannot_be_used(fake, good, damage, match):
    folder, _ = good
    error = failure(fake(f"cp {folder}/job.* .; {damage.format(folder)}"))
    assert "no usable results" in error.reason
    assert re.search(match, error.reason)


def test_results_of_another_job_are_not_taken(machine, fake):
    other = BubbleModel(disk_mesh(120.0, 32, "quarter"), 0.81, (0.01, 0.03))
    folder = files(machine / "other", other, MembraneSolver().run(other, LAW))
    assert "of another job" in failure(fake(f"cp {folder}/job.* .")).reason
    finer = BubbleModel(disk_mesh(100.0, 108, "quarter"), 0.81, (0.01, 0.03))
    folder = files(machine / "finer", finer, MembraneSolver().run(finer, LAW))
    assert "are not the deck's" in failure(fake(f"cp {folder}/job.* .")).reason


def test_a_strip_without_forces_is_a_failure(machine, fake):
    given = straight_strip("warp", 50, 60, 0.81, increments=5)
    folder = files(machine / "good", given, MembraneSolver().run(given, LAW))
    error = failure(fake(f"sed 's/^Reaction/Anything/' {folder}/job.t19 > job.t19; "
                         f"cp {folder}/job.sts ."), given)  # fmt: skip
    assert "Reaction Force" in error.reason and "post" in error.reason


def test_a_marc_that_cannot_be_run(machine):
    raised(SolverFailure, "no run_marc on the PATH", MarcSolver().run, model(), LAW)
    found = MarcSolver().check()
    assert not found.available and "bubblefit docs marc" in found.advice
    for words in ("no such file", "not executable"):
        raised(InputError, words, MarcSolver(marc=machine / "marc").run, model(), LAW)
        (machine / "marc").write_text("#!/bin/sh\n")


class Embedded(MarcSolver):
    """The membrane in Marc's place, to the digits of a .t19."""

    def run(self, model, law, scratch=None, timeout=None):
        return MembraneSolver().run(model, law)


def test_bars_that_carry_the_law_pass(machine, monkeypatch):
    stresses = proof.prove(Embedded())
    np.testing.assert_allclose(stresses, [bar.stress for bar in BARS], rtol=TOLERANCE)
    monkeypatch.setattr(proof, "bar_law", lambda _: LAW)
    raised(SolverFailure, "does not carry the law", proof.prove, Embedded())


@pytest.fixture(autouse=True)
def no_site(monkeypatch):
    monkeypatch.delenv("BUBBLEFIT_MARC", raising=False)


def test_a_site_file_is_below_what_is_given(tmp_path, monkeypatch):
    settings = marc_settings({})
    assert (settings.executable, settings.element, settings.law) == ("run_marc", 139, "nlelast")
    assert settings == MarcSettings() and settings.increments == 100
    (tmp_path / "nl.dat").write_text("mine")
    (tmp_path / "bin").mkdir()
    site = tmp_path / "site.toml"
    site.write_text(
        'executable = "bin/run_marc"\nelement = 75\nthreads = 2\nmodules = ["marc/2023"]\n'
        '[include]\nnlelast = "nl.dat"\n[environment]\nA = "1"\nB = "2"\n'
    )
    monkeypatch.setenv("BUBBLEFIT_MARC", str(site))
    settings = marc_settings({"threads": 4, "element": None, "environment": {"B": "3"}})
    assert settings.executable == str(tmp_path / "bin" / "run_marc")
    assert (settings.element, settings.threads) == (75, 4)
    assert settings.include == {"nlelast": str(tmp_path / "nl.dat")}
    assert settings.environment == {"A": "1", "B": "3"}
    # What is named counts more than the environment.
    other = marc_settings({"executable": "from_a_project"}, "/opt/marc/run_marc")
    assert other.executable == "/opt/marc/run_marc" and other.threads == 1
    monkeypatch.setenv("BUBBLEFIT_MARC", "/opt/marc/run_marc")
    assert marc_settings({}).executable == "/opt/marc/run_marc"
    assert marc_settings({"executable": "mine"}).executable == "mine"


@pytest.mark.parametrize(
    ("text", "words"),
    [
        (b"elemint = 75", "elemint: unknown key; did you mean 'element'"),
        (b"element = 22", "element: expected 139, 75 or 18"),
        (b"element = ", "TOML syntax"),
        (b"threads = 0", "threads"),
        (b'modules = ["marc/2023; rm -rf x"]', "modules[0]"),
        (b"[environment]\n\"A B\" = '1'", "environment"),
        (b"\xff\xfe\x00", "UTF-8"),
        (None, "cannot be read"),
    ],
)
def test_mistakes_in_a_site_file_name_it_and_the_key(tmp_path, text, words):
    site = tmp_path / "site.toml"
    if text is not None:
        site.write_bytes(text)
    said = complaint(marc_settings, {}, str(site))
    assert str(site) in said and words in said


@pytest.mark.parametrize(
    ("given", "words"),
    [
        ({"include": {"nlelst": "x"}}, "there is no block 'nlelst'; there are cavity"),
        ({"include": {"nlelast": "/none"}}, "/none: solver.marc.include.nlelast: there is no"),
        ({"templates": "/none"}, "/none: templates: there is no such folder"),
        ({"element": "S4"}, "solver.marc.element: expected 139, 75 or 18, got 'S4'"),
        ({"what": 1}, "solver.marc.what: unknown key"),
    ],
)
def test_mistakes_elsewhere_are_one_line(given, words):
    assert words in complaint(marc_settings, given)
    assert words in complaint(MarcSolver, **given)


def test_doctor_tells_of_a_marc_that_was_named(fake, good, tmp_path, monkeypatch):
    folder, _ = good
    fake(f"cp {folder}/job.* .")
    monkeypatch.setenv("PATH", "/usr/bin:/bin")
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


def test_every_setting_and_block_is_documented_and_there():
    text = (ROOT / "docs" / "how-to" / "marc.md").read_text()
    for name in (*MarcSettings.model_fields, *BLOCKS):
        assert name in text, name
    for name in BLOCKS:
        assert (ROOT / "templates" / "marc" / f"{name}.dat.j2").is_file()
