"""solvers/marc/job.py: subroutine, environment and modules of a run."""

import pytest
from bubblefit.errors import SolverFailure
from bubblefit.materials.law import HypoelasticLaw
from bubblefit.meshes.bubble_model import BubbleModel
from bubblefit.meshes.disk import disk_mesh
from bubblefit.solvers.marc.solver import MarcSolver

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
