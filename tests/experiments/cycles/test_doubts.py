"""experiments/cycles/doubts.py: slip, drift and scatter of load histories."""

import re
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from bubblefit import cycles
from bubblefit.experiments.cycles.doubts import DRIFT, SLIP, scatter_notes
from bubblefit.experiments.cycles.evaluation import evaluate_history
from bubblefit.readers.histories import LoadHistory, read_history

from ...builders.load_histories import faulty_histories, load_history, write_history


def test_slip_and_drift_are_doubted(tmp_path):
    found = cycles(list(faulty_histories(tmp_path).values()))
    by = {kind: {n.of for n in found.notes if n.kind == kind} for kind in (SLIP, DRIFT)}
    assert by == {SLIP: {"negative.csv", "lost.csv"}, DRIFT: {"drifting.csv"}}
    assert found.histories[1].values[2].loss < 0


def slid_history(lost, seated):
    """Return a history of which the extensometer loses strain, and the grips settle in cycle 2.

    lost : of the strain at the peak of cycle 2, beside cycle 1. seated : share of the strain by the
    travel of cycle 3, to a higher load.
    """
    turns = [(0.0, 0.0), (0.010, 3000.0), (0.004, 50.0), (0.010 * (1 - lost), 3000.0)]
    turns += [(0.0045 - 0.010 * lost, 50.0), (0.016, 6000.0), (0.010, 50.0)]
    strain, load = (
        np.concatenate([np.linspace(a[k], b[k], 40)[1:] for a, b in pairwise(turns)])
        for k in (0, 1)
    )
    travel = 300.0 * strain
    third = slice(4 * 39 - 1, 5 * 39)
    rise = travel[third] - travel[third][0]
    travel[third] = travel[third][0] + rise / (1 - seated)
    travel[third.stop :] += travel[third.stop - 1] - 300.0 * strain[third.stop - 1]
    return evaluate_history(LoadHistory(Path("slid.csv"), load, strain, travel=travel))


@pytest.mark.parametrize(
    ("lost", "seated", "words"),
    [
        (0.0, 0.0, None),
        (0.033, 0.24, None),
        (0.036, 0.0, "at the peak of cycle 2 0.00036 less strain than in cycle 1"),
        (0.0, 0.26, "over the loading of cycle 3 the machine's travel makes"),
    ],
)
def test_slip_is_suspected_beyond_that_of_good_specimens(lost, seated, words):
    notes = [str(note) for note in slid_history(lost, seated).notes if note.kind == SLIP]
    assert len(notes) == (words is not None)
    assert words is None or notes[0].startswith(words)


def test_slip_of_measured_straps_and_cords(shared_data):
    """No second cycle of good files; what a strap loses for certain."""
    files = sorted((shared_data / "webbing").glob("*.csv"))
    notes = [note for one in cycles(files).histories for note in one.notes if note.kind == SLIP]
    assert {(note.of, re.search(r"cycle \d", note).group()) for note in notes} == {
        ("st_1p75in_test2.csv", "cycle 1"),
        ("st_1p75in_test2.csv", "cycle 2"),
        ("st_2in_test1.csv", "cycle 2"),
    }


def test_scatter_between_specimens_is_noted_with_its_figure(tmp_path):
    """Specimens of 100, 90 and 80 N: one differs by 20 / 90 at most from the mean of the others."""
    time, load, strain = load_history()
    for k, share in enumerate((1.0, 0.9, 0.8)):
        write_history(
            tmp_path / f"s{k}.csv", ["time_s,load_N,strain"], (time, share * load, strain)
        )
    several = [read_history(tmp_path / f"s{k}.csv") for k in range(3)]
    histories = [evaluate_history(history, 100.0) for history in several]
    (note,) = scatter_notes({"warp": histories})
    assert "3 specimens of the warp" in note and "differs by 18 %" in note
    assert "standard deviation 11 %" in note and "do not hold it" in note
    (single,) = scatter_notes({"fill": histories[:1]})
    assert "one specimen of the fill" in single and "is not known" in single
