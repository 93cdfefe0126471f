"""Every way in which the stand-in fails as Marc fails, and what the user is told of it."""

import os
import re

import numpy as np
import pytest
from bubblefit.errors import SolverFailure
from bubblefit.materials.law import HypoelasticLaw
from bubblefit.meshes.bubble_model import BubbleModel
from bubblefit.meshes.disk import disk_mesh
from bubblefit.solvers.membrane.solver import MembraneSolver

from ...marc_stand_in_runs import marc
from ...solvers.calculix.test_calculix_faults import gone

__all__ = ["marc"]

LAW = HypoelasticLaw.linear(800.0, 400.0, 60.0)
MODEL = BubbleModel(disk_mesh(100.0, 32, "quarter"), 0.81, (0.01, 0.02, 0.03, 0.04))


def failure(marc, fault, timeout=None, **settings):
    marc.told(fault)
    with pytest.raises(SolverFailure) as found:
        marc.solver(**settings).run(MODEL, LAW, timeout=timeout)
    assert found.value.scratch.is_dir() and (found.value.scratch / "job.dat").exists()
    return found.value


@pytest.mark.parametrize(
    ("fault", "number", "words"),
    [
        ("3015", 3015, "the time step could not get smaller.*after increment 2"),
        ("code0", 3015, "the time step could not get smaller"),
        ("licence", None, "no licence: .*license server is down"),
        ("killed", None, "killed by SIGKILL"),
        ("truncated", 3004, "no usable results.*truncated"),
        ("inside out", 3004, r"an element was turned inside out.*\(element 1\)"),
        ("early", 3004, "ended at time 2 of 4"),
        ("disk full", None, "disk full after increment 2: .*No space left on device"),
        ("silent", None, r"wrote no job\.sts"),
        ("not compiled", 3, "compile or link"),
    ],
)
def test_a_failure_says_what_happened(marc, fault, number, words):
    error = failure(marc, fault, **({"law": "hypela2"} if fault == "not compiled" else {}))
    assert error.exit_number == number and re.search(words, error.reason)
    if number == 3015:
        assert error.log_tail == "*** error - unable to reduce time step below minimum"


def test_the_input_error_of_a_spoiled_deck_is_told(marc, tmp_path):
    block = tmp_path / "nlelast.dat"
    block.write_text("nlelast\n\n         1         2         0         0         0fabric\n")
    error = failure(marc, "none", include={"nlelast": str(block)})
    assert error.exit_number == 13 and error.log_tail.startswith("*** error - ")
    lines = (error.scratch / "job.dat").read_text().splitlines()
    number = int(error.log_tail.split("in line ")[1].split()[0])
    assert "nlelast" in lines[number - 8 : number]  # the block that the site gave


def test_a_law_that_finds_no_equilibrium_ends_with_3015(marc):
    high = BubbleModel(MODEL.mesh, 0.81, (0.01, 20.0))
    with pytest.raises(SolverFailure) as found:
        marc.solver().run(high, HypoelasticLaw.linear(800.0, 400.0, 1e-3))
    assert found.value.exit_number == 3015


def test_neither_return_code_nor_repeated_increments_spoil_a_good_run(marc):
    expected = MembraneSolver().run(MODEL, LAW)
    for fault in ("code1", "repeated"):
        marc.told(fault)
        found = marc.solver().run(MODEL, LAW)
        np.testing.assert_allclose(found.displacement, expected.displacement, rtol=1e-5, atol=1e-9)
        assert any("repeated" in words for words in found.remarks) == (fault == "repeated")


def test_a_job_that_hangs_is_ended_with_its_children(marc):
    told = []
    marc.told("hanging")
    # Long enough for a busy machine to get there.
    solver = marc.solver(timeout=8.0)
    solver.progress = told.append
    with pytest.raises(SolverFailure, match="did not end within 8 s: killed after increment 2"):
        solver.run(MODEL, LAW)
    assert [i.increment for i in told] == [1, 2]
    (pid,) = [int(line) for line in (marc.folder / "pids").read_text().split()]
    assert gone(pid)


def test_files_of_an_earlier_job_are_not_its_results(marc):
    """The very same model with another law: only what says when it was written is different."""
    marc.told("none")
    marc.solver(keep=True).run(MODEL, HypoelasticLaw.linear(500.0, 300.0, 40.0))
    (kept,) = (marc.folder / "scratch").iterdir()
    (marc.folder / "stale").mkdir()
    for name in ("job.sts", "job.out", "job.log", "job.t19"):
        os.rename(kept / name, marc.folder / "stale" / name)
    error = failure(marc, "stale")
    assert error.exit_number is None and "no licence" in error.reason
