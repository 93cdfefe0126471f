"""Each test left out of the fit in turn: what is foretold of it, in closed form and on bubbles."""

from __future__ import annotations

import json
from collections import Counter
from dataclasses import replace
from functools import cache

import numpy as np
import pandas as pd
import pytest
from bubblefit import __version__
from bubblefit.errors import InputError, Note, OutputError, SolverFailure
from bubblefit.materials.card import MaterialCard, write_card
from bubblefit.materials.law import HypoelasticLaw
from bubblefit.project.project import read_project
from bubblefit.runs import verification as subjects
from bubblefit.runs.setup import prepare_fit
from bubblefit.runs.simulation import FAILED
from bubblefit.runs.validation import HeldOut, Judged, Validation, held_out, judge_cards, validate
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
from ..page_charts import charts_of
from ..places import KNOWN
from ..projects import ELONGATION, MODULI, changed, constant_strips
from ..published_laws import TABLE_4_2


def warp_of_two(modulus: float) -> tuple[float, float]:
    """RMS (N) of a constant E1 (MPa) at the test "two", and over its largest load."""
    strain = np.log1p(ELONGATION[ELONGATION <= 2.5] / 20)
    loads = np.concatenate([20 * e * strain for e in MODULI["two"]["warp"]])
    rms = float(np.sqrt(np.mean((20 * modulus * np.tile(strain, 2) - loads) ** 2)))
    return rms, rms / loads.max()


def test_what_a_fit_to_the_other_test_foretells(tmp_path):
    """The fit to "one" has the mean of its specimens' moduli, 330 MPa; "two" has 330 and 410."""
    project = read_project(constant_strips(tmp_path))
    told: list[str] = []
    found = validate(
        project, starts=1, out=tmp_path / "out",
        progress=lambda event: told.append(event) if isinstance(event, str) else None,
    )  # fmt: skip
    assert told == ["constant: all tests", "constant: without one", "constant: without two"]
    assert [one.predicted.test for one in found.judged] == ["one", "two"]
    two = found.judged[1]
    rms, relative = warp_of_two(330.0)
    assert two.predicted.rms == {"two: warp": pytest.approx(rms, rel=1e-4)}
    assert two.predicted.error == pytest.approx(relative, rel=1e-4)
    assert two.predicted.units == {"two: warp": "N"}
    # Given the test itself, it is nearer to it: both tests' warp strips pull at E1.
    assert two.fitted is not None and two.fitted.error < two.predicted.error
    found.write(tmp_path / "out")
    table = pd.read_csv(tmp_path / "out" / "validation.csv")
    pd.testing.assert_frame_equal(table, found.table(), rtol=1e-8)
    row = table[table["test"] == "two"].iloc[0]
    assert row["foretold_rms"] == pytest.approx(rms, rel=1e-4)
    assert row["fitted_rms"] == pytest.approx(two.fitted.rms["two: warp"])
    said = json.loads((tmp_path / "out" / "result.json").read_text())
    assert said["mean_foretold"]["constant"] == pytest.approx(
        (found.judged[0].predicted.error + relative) / 2, rel=1e-4
    )
    folders = {path.name for path in (tmp_path / "out").iterdir() if path.is_dir()}
    assert folders == {"constant-all", "constant-without-1", "constant-without-2"}
    assert all((tmp_path / "out" / name / "report.html").exists() for name in folders)
    # In the test's own words, too, as after a fit.
    own = two.predicted.rms["two: warp"]
    assert f"constant, two: RMS errors in N: warp {own:.4g}" in found.lines()
    assert two.predicted.numbers["e_uniaxial_N"] == pytest.approx(rms, rel=1e-4)
    assert found.lines()[-1] == (
        f"constant: predicted {100 * said['mean_foretold']['constant']:.3g} % on average"
    )


def test_a_card_is_judged_without_a_fit(tmp_path):
    path = constant_strips(tmp_path)
    law = HypoelasticLaw.linear(350.0, 190.0, 60.0, 0.0)
    law = replace(law, strain_range=np.array([0.1, 0.14, 0.1]))
    write_card(MaterialCard(law, 0.8, "made"), tmp_path / "card.toml")
    command = ("validate", "project.toml", "--card", "card.toml", "--out", "judged")
    done = in_process(*command, cwd=tmp_path)
    table = pd.read_csv(tmp_path / "judged" / "validation.csv")
    rms, relative = warp_of_two(350.0)
    row = table[table["test"] == "two"].iloc[0]
    assert (row["foretold_rms"], row["foretold_relative"]) == pytest.approx(
        (rms, relative), rel=1e-4
    )
    assert np.isnan(row["fitted_rms"])
    assert (
        "made, two: warp strain 0.118 is beyond 0.100, up to which the law is known" in done.output
    )
    assert f"{rms:12.4g}" in done.output and path.exists()
    again = in_process(*command, cwd=tmp_path, code=2)
    said = again.output + again.stderr
    assert "judged" in said and "--overwrite" in said


def test_a_card_of_another_thickness_is_refused(tmp_path):
    project = read_project(constant_strips(tmp_path))
    card = MaterialCard(HypoelasticLaw.linear(350.0, 190.0, 60.0, 0.0), 1.0, "thick")
    with pytest.raises(InputError, match=r"fabric\.thickness: thick: .* 1 mm"):
        judge_cards(project, {"thick": card})


def test_one_test_cannot_be_left_out(tmp_path):
    constant_strips(tmp_path)
    done = in_process("validate", "project.toml", "--test", "one", cwd=tmp_path, code=2)
    assert "one test is left out of two or more: there is only one" in done.output


def test_what_is_no_law_is_fitted_to_the_test_left_out(tmp_path):
    text = changed(
        KNOWN.read_text(),
        ("elements = 800", "elements = 48"),
        ("displacement_offset = false", "displacement_offset = true"),
    )
    (tmp_path / "project.toml").write_text(text)
    project = read_project(tmp_path / "project.toml")
    setup = prepare_fit(project, project.chosen(None, fitted=True))
    (prepared,) = setup.tests
    moved = tuple(
        replace(f, displacement=f.displacement + np.array([0.0, 0.0, 1.5])) for f in prepared.fields
    )
    law = prepared.known
    plain = held_out(prepared, law, setup.make_solver)
    shifted = held_out(replace(prepared, fields=moved), law, setup.make_solver)
    assert plain.error < 1e-6
    assert shifted.error < 1e-3
    off = setup.project.tests["bubble"]
    without = replace(prepared, fields=moved, test=replace(off, displacement_offset=False))
    found = held_out(without, law, setup.make_solver)
    assert found.error > 0.015
    assert found.rms == {"bubble": pytest.approx(1.5 / np.sqrt(3.0), rel=1e-6)}


def test_a_law_that_cannot_be_run_is_told(tmp_path, monkeypatch):
    project = read_project(constant_strips(tmp_path))
    setup = prepare_fit(project, project.chosen(None, fitted=True))

    def tired(*_, **__):
        raise SolverFailure("too tired", "membrane")

    monkeypatch.setattr(MembraneSolver, "run", tired)
    law = HypoelasticLaw.linear(350.0, 190.0, 60.0, 0.0)
    law = replace(law, strain_range=np.array([0.1, 0.14, 0.1]))
    found = held_out(setup.tests[1], law, setup.make_solver)
    assert found.error is None and found.rms == {}
    (note,) = found.notes
    assert note.kind is FAILED and note.of == "two"
    assert "too tired" in note


UNITS = {"one: warp": "N", "one: fill": "N"}
TIRED = Note(FAILED, "no analysis: too tired", "two")
ONE = HeldOut("one", 0.05, {"one: warp": 12.5, "one: fill": 7.0}, UNITS)
TWO = HeldOut("two", 0.15, {"two: warp": 30.0}, {"two: warp": "N"})
LOST = HeldOut("two", None, {}, {"two: warp": "N"}, (TIRED,))
FOUND = Validation(
    "made",
    (
        Judged("cubic", ONE, HeldOut("one", 0.02, {"one: warp": 5.0, "one: fill": 2.0}, UNITS)),
        Judged("cubic", TWO, LOST),
        Judged("constant", HeldOut("one", 0.06, {"one: warp": 20.0, "one: fill": 1.0}, UNITS)),
        Judged("constant", HeldOut("two", 0.07, {"two: warp": 3.0}, {"two: warp": "N"})),
        Judged("spline", ONE),
        Judged("spline", LOST),
    ),
)
#: Law, test, compared, RMS foretold and fitted, relative foretold and fitted.
ROWS = [
    ("cubic", "one", "one: warp", 12.5, 5.0, 0.05, 0.02),
    ("cubic", "one", "one: fill", 7.0, 2.0, 0.05, 0.02),
    ("cubic", "two", "two: warp", 30.0, None, 0.15, None),
    ("constant", "one", "one: warp", 20.0, None, 0.06, None),
    ("constant", "one", "one: fill", 1.0, None, 0.06, None),
    ("constant", "two", "two: warp", 3.0, None, 0.07, None),
    ("spline", "one", "one: warp", 12.5, None, 0.05, None),
    ("spline", "one", "one: fill", 7.0, None, 0.05, None),
    ("spline", "two", "two: warp", None, None, None, None),
]


def test_means():
    expected = {"cubic": 0.1, "constant": 0.065, "spline": np.nan}
    assert FOUND.means == pytest.approx(expected, nan_ok=True)


def test_table_and_result(tmp_path):
    columns = [
        "law", "test", "compared", "unit", "foretold_rms", "fitted_rms", "foretold_relative",
        "fitted_relative", "foretold_words",
    ]  # fmt: skip
    wanted = [dict(zip(columns, (*row[:3], "N", *row[3:], ""), strict=True)) for row in ROWS]
    table = FOUND.table()
    assert list(table.columns) == columns
    pd.testing.assert_frame_equal(table, pd.DataFrame(wanted, dtype=None), check_dtype=False)
    assert FOUND.result == {
        "command": "validate", "title": "made", "version": __version__, "left_out": "tests",
        "error": "mean relative RMS error of a test, or of its part",
        "mean_foretold": {
            "cubic": pytest.approx(0.1), "constant": pytest.approx(0.065), "spline": None
        },
        "rows": wanted,
        "notes": [{"of": "spline, two", "kind": "failed", "note": "no analysis: too tired"}],
    }  # fmt: skip
    FOUND.write(tmp_path / "new" / "folder")
    assert json.loads((tmp_path / "new" / "folder" / "result.json").read_text()) == FOUND.result
    (chart,) = charts_of(tmp_path / "new" / "folder")["held out"]
    assert chart.x_names == ["one", "two"]
    assert {series.name: series.y for series in chart.series} == {
        "cubic, predicted": [5.0, 15.0], "constant, predicted": [6.0, 7.0],
        "spline, predicted": [5.0, None], "cubic, fitted": [2.0, None],
    }  # fmt: skip
    for series in chart.series:
        assert np.round(series.x).tolist() == [1.0, 2.0]
    text = (tmp_path / "new" / "folder" / "validation.csv").read_text().splitlines()
    assert text[0] == ",".join(columns)
    assert text[1] == "cubic,one,one: warp,N,12.5,5,0.05,0.02,"
    with pytest.raises(OutputError):
        (tmp_path / "file").write_text("")
        FOUND.write(tmp_path / "file")


def test_lines():
    lines = FOUND.lines()
    assert len(lines) == 1 + len(ROWS) + 3 and "constant" in lines[-1]
    assert [line.split()[0] for line in lines[1:10]] == [row[0] for row in ROWS]
    assert "10 %" in lines[-3] and "6.5 %" in lines[-2]
    alone = Validation("made", FOUND.judged[:2])
    assert "10 %" in alone.lines()[-1]


#: How many each subject has.
COUNTS = {
    "bars": 4, "hencky": 7, "abaqus": 16, "marc bubble": 7, "strips": 5, "thin walls": 6,
    "bent tube": 3, "nu12": 5,
}  # fmt: skip


@cache
def ours() -> dict[str, list[Number]]:
    """Of the embedded membrane."""
    return dict(numbers([subject for subject in SUBJECTS if subject != "calculix"]))


def test_every_number_is_met():
    found = ours()
    assert {subject: len(some) for subject, some in found.items()} == COUNTS
    assert [one.row for some in found.values() for one in some if not one.met] == []
    names = Counter(one.what for some in found.values() for one in some)
    assert max(names.values()) == 1
    assert all(one.source for some in found.values() for one in some)


def test_theirs_are_the_published_ones():
    printed = {
        "end stress, direct warp bar": 62.677, "end stress, inverse fill bar": 51.448,
        "b_0 of Hencky's membrane, nu 0": 1.6204, "b_0 of Hencky's membrane, nu 0.34": 1.7439,
        "apex, test 1 e, 298 kPa": 39.4934, "engineering strain of the gauge, bias strip": 0.555,
        "largest displacement over the mean, nu12 0.45": 0.967,
    }  # fmt: skip
    theirs = {one.what: one.theirs for some in ours().values() for one in some}
    assert {what: theirs[what] for what in printed} == pytest.approx(printed, abs=5e-5)
    assert marc_bubble.SOLUTION == tuple(TABLE_4_2)
    # The apex of Marc's bubble is the highest node of each curve.
    apex = [theirs[f"apex of Table 4.2, {1e3 * p:g} kPa"] for p in marc_bubble.PRESSURES]
    assert apex == pytest.approx([14.2, 20.05, 24.4, 28.1, 32.6, 36.5, 38.8], abs=0.2)


@pytest.mark.slow
def test_with_calculix(ccx):
    ((_, found),) = numbers(["calculix"])
    assert len(found) == 6
    assert [one.row for one in found if not one.met] == []
    assert all(one.what.startswith("CalculiX: ") for one in found)


def test_measured_strips(shared_data):
    *_, (subject, found) = numbers([], shared_data / "uniaxial")
    assert subject == "measured strips"
    assert {one.what: one.theirs for one in found} == {
        "R^2 of the warp polynomial": 0.998,
        "R^2 of the fill polynomial": 0.959,
        "R^2 of the bias polynomial": 0.987,
    }
    assert all(one.met for one in found)


@pytest.mark.parametrize("absolute", [False, True])
def test_a_number_further_off_than_allowed_is_missed(absolute):
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


def test_a_solver_that_is_a_little_wrong_is_seen():
    assert not any(one.met for one in marc_bars(Stiff()))


def test_the_command(monkeypatch, tmp_path):
    fewer = {"bars": marc_bars, "calculix": lambda: iter(())}
    monkeypatch.setattr(subjects, "SUBJECTS", fewer)
    done = in_process("verify", "--subject", "bars", "--subject", "calculix", cwd=tmp_path)
    assert "end stress, direct warp bar" in done.output
    row = next(line for line in done.output.splitlines() if "direct warp bar" in line)
    assert row.split()[5:10] == ["62.6747", "62.677", "MPa", "-0.0036", "%"]
    assert "MSC Marc; Jekel et al., Composite Structures 161 (2017)" in row
    assert "calculix: not here (bubblefit doctor says why), nothing compared" in done.output
    assert done.output.endswith("all 4 numbers are met\n")


def test_the_command_fails_when_a_number_is_missed(monkeypatch, tmp_path):
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


def test_bad_input(tmp_path):
    with pytest.raises(InputError, match=r"--subject: 'hinge' is not one of: bars, hencky"):
        list(numbers(["hinge"]))
    with pytest.raises(InputError, match=r"valmex7318_load_gauge\.csv"):
        list(numbers([], tmp_path))
    assert abaqus.TABLE.is_file()
