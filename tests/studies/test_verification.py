"""Published numbers beside ours: all are met, and one that is wrong is seen."""

from __future__ import annotations

import json
from collections import Counter
from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from bubblefit.errors import InputError
from bubblefit.runs import verification as subjects
from bubblefit.runs.verification import (
    SUBJECTS,
    numbers,
)
from bubblefit.runs.verification import (
    published as abaqus,
)
from bubblefit.runs.verification import (
    published as marc_bubble,
)
from bubblefit.runs.verification.number import Number
from bubblefit.runs.verification.published import marc_bars
from bubblefit.solvers.base import History
from bubblefit.solvers.membrane.solver import MembraneSolver

from ..commands import in_process
from ..published_laws import TABLE_4_2

#: How many each subject has.
COUNTS = {
    "bars": 4, "hencky": 7, "abaqus": 16, "marc bubble": 7, "strips": 5, "thin walls": 6,
    "bent tube": 3, "nu12": 5,
}  # fmt: skip


@cache
def ours() -> dict[str, list[Number]]:
    """Of the embedded membrane."""
    return dict(numbers([subject for subject in SUBJECTS if subject != "calculix"]))


def test_every_number_is_met() -> None:
    found = ours()
    assert {subject: len(some) for subject, some in found.items()} == COUNTS
    assert [one.row for some in found.values() for one in some if not one.met] == []
    names = Counter(one.what for some in found.values() for one in some)
    assert max(names.values()) == 1
    assert all(one.source for some in found.values() for one in some)


def test_theirs_are_the_published_ones() -> None:
    """Some of each, as printed."""
    printed = {
        "end stress, direct warp bar": 62.677,
        "end stress, inverse fill bar": 51.448,
        "b_0 of Hencky's membrane, nu 0": 1.6204,
        "b_0 of Hencky's membrane, nu 0.34": 1.7439,
        "apex, test 1 e, 298 kPa": 39.4934,
        "engineering strain of the gauge, bias strip": 0.555,
        "largest displacement over the mean, nu12 0.45": 0.967,
    }
    theirs = {one.what: one.theirs for some in ours().values() for one in some}
    assert {what: theirs[what] for what in printed} == pytest.approx(printed, abs=5e-5)
    assert marc_bubble.SOLUTION == tuple(TABLE_4_2)
    # The apex of Marc's bubble is the highest node of each curve.
    apex = [theirs[f"apex of Table 4.2, {1e3 * p:g} kPa"] for p in marc_bubble.PRESSURES]
    assert apex == pytest.approx([14.2, 20.05, 24.4, 28.1, 32.6, 36.5, 38.8], abs=0.2)


@pytest.mark.slow
def test_with_calculix(ccx) -> None:
    ((_, found),) = numbers(["calculix"])
    assert len(found) == 6
    assert [one.row for one in found if not one.met] == []
    assert all(one.what.startswith("CalculiX: ") for one in found)


def test_measured_strips(shared_data) -> None:
    *_, (subject, found) = numbers([], shared_data / "uniaxial")
    assert subject == "measured strips"
    assert {one.what: one.theirs for one in found} == {
        "R^2 of the warp polynomial": 0.998,
        "R^2 of the fill polynomial": 0.959,
        "R^2 of the bias polynomial": 0.987,
    }
    assert all(one.met for one in found)


@pytest.mark.parametrize("absolute", [False, True])
def test_a_number_further_off_than_allowed_is_missed(absolute: bool) -> None:
    number = Number("x", 2.02, 2.0, "mm", 0.021 if absolute else 0.0101, "somebody", absolute)
    assert number.met
    assert number.deviation == pytest.approx(0.02 if absolute else 0.01)
    for worse in (2.03, 1.97, float("nan")):
        assert not replace(number, ours=worse).met


class Stiff(MembraneSolver):
    """A solver whose loads are 0.02 % too high."""

    def run(self, *args: object, **options: object) -> History:
        history = super().run(*args, **options)
        return replace(history, load=1.0002 * np.asarray(history.load))


def test_a_solver_that_is_a_little_wrong_is_seen() -> None:
    assert not any(one.met for one in marc_bars(Stiff()))


def test_the_command(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    fewer = {"bars": marc_bars, "calculix": lambda: iter(())}
    monkeypatch.setattr(subjects, "SUBJECTS", fewer)
    done = in_process("verify", "--subject", "bars", "--subject", "calculix", cwd=tmp_path)
    assert "end stress, direct warp bar" in done.output
    row = next(line for line in done.output.splitlines() if "direct warp bar" in line)
    assert row.split()[5:10] == ["62.6747", "62.677", "MPa", "-0.0036", "%"]
    assert "MSC Marc; Jekel et al., Composite Structures 161 (2017)" in row
    assert "calculix: not here (bubblefit doctor says why), nothing compared" in done.output
    assert done.output.endswith("all 4 numbers are met\n")


def test_the_command_fails_when_a_number_is_missed(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.setattr(subjects, "SUBJECTS", {"bars": lambda: marc_bars(Stiff())})
    done = in_process("verify", "--subject", "bars", cwd=tmp_path, code=1)
    assert done.output.count("   MISSED\n") == 4
    assert "4 of 4 missed: end stress, direct warp bar; " in done.output.splitlines()[-1]
    told = json.loads(
        in_process("verify", "--subject", "bars", "--json", cwd=tmp_path, code=1).output
    )
    assert told["ok"] is False
    first = told["numbers"][0]
    assert (first["subject"], first["met"]) == ("bars", False)
    assert first["deviation"] == pytest.approx(1.64e-4, abs=1e-6)
    assert list(first) == [
        "subject", "what", "ours", "theirs", "unit", "deviation", "allowed", "absolute", "met",
        "source",
    ]  # fmt: skip


def test_bad_input(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"--subject: 'hinge' is not one of: bars, hencky"):
        list(numbers(["hinge"]))
    with pytest.raises(InputError, match=r"valmex7318_load_gauge\.csv"):
        list(numbers([], tmp_path))
    assert abaqus.TABLE.is_file()
