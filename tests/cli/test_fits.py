"""Specify what commands print of a fit: moduli, grave notes first, others counted."""

from itertools import permutations

import bubblefit as bf
import numpy as np
import pytest
from bubblefit.cli.fits import warning_lines
from bubblefit.experiments.bubble.findings import FLAT_SHEET, SURFACES
from bubblefit.experiments.cycles.evaluation import SLIP
from bubblefit.experiments.data_files import READING
from bubblefit.experiments.doubts import DOUBTFUL
from bubblefit.experiments.forward import UNSTABLE
from bubblefit.inference.discrepancy import DISCREPANCY
from bubblefit.inference.noise import ABOVE_NOISE
from bubblefit.inference.reported import BOUND, MARGIN, UNCERTAIN
from bubblefit.notes import GRAVE, SOLVER, Note, gravest_notes
from bubblefit.runs.certainty import MESH, UNKNOWN
from bubblefit.runs.result import ALONE, STARTS
from bubblefit.runs.verdict import NOT_CONVERGED, answers

from ..builders.projects import constant_strips


@pytest.fixture(scope="module")
def fitted(tmp_path_factory):
    project = bf.read_project(constant_strips(tmp_path_factory.mktemp("words")))
    return bf.fit(project, tests=["two"], starts=1, jobs=1)


def test_printed_moduli_have_strains_sigma_and_band_of_table(fitted):
    told, table = answers(fitted.best, fitted.thickness), fitted.moduli()
    for name, component in (("E1", 0), ("E2", 1), ("G12", 2)):
        own = [one for one in told if one.modulus == name]
        end = fitted.best.valid[component]
        assert [one.end for one in own] == [False] * (len(own) - 1) + [True]
        shown = [s for s in (0, 0.01, 0.02, 0.05, 0.1, 0.2, 0.3) if s < 0.95 * end]
        assert [one.strain for one in own] == [*shown, end]
        rows = table[table["modulus"] == name]
        for one in own:
            assert one.value == fitted.law.modulus(name, one.strain)
            assert one.per_width == pytest.approx(one.value * fitted.thickness)
            assert one.band[0] <= one.value <= one.band[1]
            for value, column in zip(
                (one.sigma, *one.band), ("sigma_relative", "lower_MPa", "upper_MPa"), strict=True
            ):
                expected = np.interp(one.strain, rows["strain"], rows[column])
                assert value == pytest.approx(expected, rel=1e-2)


def test_notes_of_wrong_moduli_precede_those_of_uncertain_ones():
    wrong = [NOT_CONVERGED, FLAT_SHEET, BOUND, MARGIN, MESH, DISCREPANCY, ABOVE_NOISE, UNSTABLE]
    wrong += [DOUBTFUL, SURFACES]
    assert all(kind.weight >= GRAVE and kind.objection is not None for kind in wrong)
    weights = [kind.weight for kind in (*wrong, UNCERTAIN, UNKNOWN, STARTS)]
    assert weights == sorted(weights, reverse=True)
    notes = [Note(STARTS, "one"), Note(UNKNOWN, "two"), Note(DISCREPANCY, "three")]
    for order in permutations(notes):
        assert gravest_notes(order) == ["three"]
    assert gravest_notes([Note(SOLVER, "none of these"), Note(ALONE, "it")]) == ["it"]
    assert gravest_notes([Note(UNSTABLE, "3"), Note(MESH, "1"), Note(MESH, "2")]) == ["1", "2", "3"]
    assert gravest_notes([]) == []


def test_grave_notes_are_printed_and_others_counted(tmp_path):
    notes = [Note(STARTS, "one"), Note(UNSTABLE, "it would not stay"), Note(READING, "column c")]
    notes += [Note(SLIP, "a negative loop"), Note(UNKNOWN, "two")]
    *printed, counted = warning_lines(notes, tmp_path)
    assert printed == ["warning: it would not stay", "warning: a negative loop", "note: column c"]
    assert counted.startswith("2 further notes: ")
