"""Verification: published and closed-form numbers beside those of this program."""

import json
from collections import Counter
from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from bubblefit.errors import InputError
from bubblefit.runs.verification import SUBJECTS, Number, bubbles
from bubblefit.runs.verification.verify import verify

from ...builders.laws import TABLE_4_2
from ...support.refusals import raised

COUNTS = {
    "bars": 4, "hencky": 7, "abaqus": 16, "marc bubble": 7, "strips": 5, "thin walls": 6,
    "bent tube": 3, "loaded tubes": 6, "nu12": 5,
}  # fmt: skip


@cache
def ours():
    return verify([name for name in SUBJECTS if name != "calculix"]).subjects


def test_every_number_is_within_its_tolerance():
    found = ours()
    assert {subject: len(some) for subject, some in found.items()} == COUNTS
    every = [one for some in found.values() for one in some]
    assert [one.row for one in every if not one.met] == []
    assert max(Counter(one.quantity for one in every).values()) == 1
    assert all(one.source for one in every)


def test_reference_numbers_are_the_published_ones(tmp_path):
    printed = {
        "end stress, direct warp bar": 62.677, "end stress, inverse fill bar": 51.448,
        "b_0 of Hencky's membrane, nu 0": 1.6204, "b_0 of Hencky's membrane, nu 0.34": 1.7439,
        "apex, test 1 e, 298 kPa": 39.4934, "engineering strain of the gauge, bias strip": 0.555,
        "largest displacement over the mean, nu12 0.45": 0.967,
    }  # fmt: skip
    theirs = {one.quantity: one.theirs for some in ours().values() for one in some}
    assert {what: theirs[what] for what in printed} == pytest.approx(printed, abs=5e-5)
    assert bubbles.SOLUTION == tuple(TABLE_4_2)
    apex = [theirs[f"apex of Table 4.2, {1e3 * p:g} kPa"] for p in bubbles.PRESSURES]
    assert apex == pytest.approx([14.2, 20.05, 24.4, 28.1, 32.6, 36.5, 38.8], abs=0.2)
    raised(InputError, r"--subject: expected one of bars, hencky.* got 'hinge'", verify, ["hinge"])
    raised(InputError, r"valmex7318_load_gauge\.csv", verify, [], data=tmp_path)
    assert bubbles.TABLE.is_file()


@pytest.mark.slow
def test_calculix_meets_published_numbers(ccx):
    (found,) = verify(["calculix"]).subjects.values()
    assert len(found) == 6
    assert [one.row for one in found if not one.met] == []
    assert all(one.quantity.startswith("CalculiX: ") for one in found)


def test_measured_strips_are_verified(shared_data):
    ((subject, found),) = verify([], data=shared_data / "uniaxial").subjects.items()
    assert subject == "measured strips"
    squares = {"warp": 0.998, "fill": 0.959, "bias": 0.987}
    expected = {f"R^2 of the {name} polynomial": r for name, r in squares.items()}
    assert {one.quantity: one.theirs for one in found} == expected
    assert all(one.met for one in found)


def test_number_of_numpy_is_printed_as_json():
    row = Number("x", np.float64(2.02), 2.0, "mm", 0.1, "somebody").row
    assert json.loads(json.dumps(row)) == row and row["met"] is True


def test_number_beyond_its_tolerance_is_missed():
    for absolute, off, allowed in ((True, 0.02, 0.021), (False, 0.01, 0.0101)):
        number = Number("x", 2.02, 2.0, "mm", allowed, "somebody", absolute)
        assert number.met and number.deviation == pytest.approx(off)
        for worse in (2.03, 1.97, float("nan")):
            assert not replace(number, ours=worse).met
