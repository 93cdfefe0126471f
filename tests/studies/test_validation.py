"""Each test left out of the fit in turn, and published numbers beside ours."""

import json
from collections import Counter
from dataclasses import replace
from functools import cache
from itertools import groupby
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from bubblefit.errors import InputError, Note, OutputError, SolverFailure
from bubblefit.materials.card import MaterialCard, write_card
from bubblefit.materials.law import HypoelasticLaw
from bubblefit.project.project import read_project
from bubblefit.runs import verification
from bubblefit.runs.result import Fit
from bubblefit.runs.setup import prepare_fit
from bubblefit.runs.simulation import FAILED
from bubblefit.runs.validation import HeldOut, Judged, Validation, held_out, judge_cards, validate
from bubblefit.runs.verification import SUBJECTS, Number, marc_bars, numbers
from bubblefit.solvers.membrane.solver import MembraneSolver

from ..commands import in_process
from ..drawings import charts_of
from ..projects import ELONGATION, MODULI, constant_strips, small
from ..published_laws import TABLE_4_2

LAW = HypoelasticLaw.linear(350.0, 190.0, 60.0, 0.0)
LAW = replace(LAW, strain_range=np.array([0.1, 0.14, 0.1]))


@pytest.fixture(scope="module")
def project(tmp_path_factory):
    return read_project(constant_strips(tmp_path_factory.mktemp("strips")))


def warp_of_two(modulus):
    """RMS (N) of a constant E1 (MPa) at the test "two", and over its largest load."""
    strain = np.log1p(ELONGATION[ELONGATION <= 2.5] / 20)
    loads = np.concatenate([20 * e * strain for e in MODULI["two"]["warp"]])
    rms = float(np.sqrt(np.mean((20 * modulus * np.tile(strain, 2) - loads) ** 2)))
    return rms, rms / loads.max()


def test_what_a_fit_to_the_other_test_foretells(project, tmp_path, monkeypatch):
    """The fit to "one" has the mean of its specimens' moduli, 330 MPa; "two" has 330 and 410."""
    told, pages, out = [], [], tmp_path / "out"
    monkeypatch.setattr(Fit, "report", lambda self, folder: pages.append(Path(folder)))
    found = validate(project, starts=1, out=out, progress=told.append)
    words = [event for event in told if isinstance(event, str)]
    assert words == ["constant: all tests", "constant: without one", "constant: without two"]
    one, two = found.judged
    assert (one.predicted.test, two.predicted.test) == ("one", "two")
    rms, relative = warp_of_two(330.0)
    assert two.predicted.rms == {"two: warp": pytest.approx(rms, rel=1e-4)}
    assert two.predicted.error == pytest.approx(relative, rel=1e-4)
    assert two.predicted.units == {"two: warp": "N"}
    # Given the test itself, it is nearer to it: both tests' warp strips pull at E1.
    assert two.fitted is not None and two.fitted.error < two.predicted.error
    found.write(out)
    table = pd.read_csv(out / "validation.csv")
    pd.testing.assert_frame_equal(table, found.table(), rtol=1e-8)
    row = table[table["test"] == "two"].iloc[0]
    assert row["foretold_rms"] == pytest.approx(rms, rel=1e-4)
    assert row["fitted_rms"] == pytest.approx(two.fitted.rms["two: warp"])
    mean = json.loads((out / "result.json").read_text())["mean_foretold"]["constant"]
    assert mean == pytest.approx((one.predicted.error + relative) / 2, rel=1e-4)
    folders = ["constant-all", "constant-without-1", "constant-without-2"]
    assert pages == [out / name for name in folders] and all(page.is_dir() for page in pages)
    # In the test's own words, too, as after a fit.
    own = two.predicted.rms["two: warp"]
    assert f"constant, two: RMS errors in N: warp {own:.4g}" in found.lines()
    assert two.predicted.numbers["e_uniaxial_N"] == pytest.approx(rms, rel=1e-4)
    assert found.lines()[-1] == f"constant: predicted {100 * mean:.3g} % on average"


def test_a_card_is_judged_without_a_fit(project, tmp_path):
    constant_strips(tmp_path)
    write_card(MaterialCard(LAW, 0.8, "made"), tmp_path / "card.toml")
    command = ("validate", "project.toml", "--card", "card.toml", "--out", "judged")
    done = in_process(*command, cwd=tmp_path)
    table = pd.read_csv(tmp_path / "judged" / "validation.csv")
    rms, relative = warp_of_two(350.0)
    row = table[table["test"] == "two"].iloc[0]
    found = row["foretold_rms"], row["foretold_relative"]
    assert found == pytest.approx((rms, relative), rel=1e-4) and np.isnan(row["fitted_rms"])
    assert "made, two: warp strain 0.118 is beyond 0.100" in done.output
    assert f"{rms:12.4g}" in done.output
    again = in_process(*command, cwd=tmp_path, code=2)
    assert "--overwrite" in again.output + again.stderr
    thick = MaterialCard(LAW, 1.0, "thick")
    with pytest.raises(InputError, match=r"fabric\.thickness: thick: .* 1 mm"):
        judge_cards(project, {"thick": thick})


def test_what_is_no_law_is_fitted_to_the_test_left_out(tmp_path):
    offset = ("displacement_offset = false", "displacement_offset = true")
    project = read_project(small(tmp_path, offset))
    setup = prepare_fit(project, project.chosen(None, fitted=True))
    (prepared,) = setup.tests
    up = np.array([0.0, 0.0, 1.5])
    moved = tuple(replace(f, displacement=f.displacement + up) for f in prepared.fields)
    shifted = replace(prepared, fields=moved)
    law, solver = prepared.known, setup.make_solver
    assert held_out(prepared, law, solver).error < 1e-6
    assert held_out(shifted, law, solver).error < 1e-3
    without = replace(project.tests["bubble"], displacement_offset=False)
    found = held_out(replace(shifted, test=without), law, solver)
    assert found.error > 0.015
    assert found.rms == {"bubble": pytest.approx(1.5 / np.sqrt(3.0), rel=1e-6)}


def test_a_law_that_cannot_be_run_is_told(project, monkeypatch):
    def tired(*_, **__):
        raise SolverFailure("too tired", "membrane")

    setup = prepare_fit(project, project.chosen(None, fitted=True))
    monkeypatch.setattr(MembraneSolver, "run", tired)
    found = held_out(setup.tests[1], LAW, setup.make_solver)
    (note,) = found.notes
    assert found.error is None and found.rms == {}
    assert (note.kind, note.of) == (FAILED, "two") and "too tired" in note


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


def held(rows, rms, relative):
    known = {row[2]: row[rms] for row in rows if row[rms] is not None}
    failed = Note(FAILED, "no analysis: too tired", rows[0][1])
    units = {row[2]: "N" for row in rows}
    return HeldOut(rows[0][1], rows[0][relative], known, units, () if known else (failed,))


EACH = [list(own) for _, own in groupby(ROWS, key=lambda row: row[:2])]
FOUND = Validation("made", tuple(Judged(o[0][0], held(o, 3, 5), held(o, 4, 6)) for o in EACH))


def test_table_result_and_lines(tmp_path):
    expected = {"cubic": 0.1, "constant": 0.065, "spline": np.nan}
    assert FOUND.means == pytest.approx(expected, nan_ok=True)
    columns = [
        "law", "test", "compared", "unit", "foretold_rms", "fitted_rms", "foretold_relative",
        "fitted_relative", "foretold_words",
    ]  # fmt: skip
    wanted = [dict(zip(columns, (*row[:3], "N", *row[3:], ""), strict=True)) for row in ROWS]
    table = pd.DataFrame(wanted, dtype=None)
    pd.testing.assert_frame_equal(FOUND.table(), table, check_dtype=False)
    out = tmp_path / "new" / "folder"
    FOUND.write(out)
    result = json.loads((out / "result.json").read_text())
    assert result == FOUND.result and result["rows"] == wanted
    assert result["mean_foretold"] == pytest.approx({**expected, "spline": None})
    assert [(note["of"], note["kind"]) for note in result["notes"]] == [("spline, two", "failed")]
    (chart,) = charts_of(out)["held out"]
    assert chart.x_names == ["one", "two"]
    assert {series.name: series.y for series in chart.series} == {
        "cubic, predicted": [5.0, 15.0], "constant, predicted": [6.0, 7.0],
        "spline, predicted": [5.0, None], "cubic, fitted": [2.0, None],
    }  # fmt: skip
    for series in chart.series:
        assert np.round(series.x).tolist() == [1.0, 2.0]
    text = (out / "validation.csv").read_text().splitlines()
    assert text[:2] == [",".join(columns), "cubic,one,one: warp,N,12.5,5,0.05,0.02,"]
    (tmp_path / "file").write_text("")
    with pytest.raises(OutputError):
        FOUND.write(tmp_path / "file")
    lines = FOUND.lines()
    assert len(lines) == 1 + len(ROWS) + 3 and "constant" in lines[-1]
    assert [line.split()[0] for line in lines[1:10]] == [row[0] for row in ROWS]
    assert "10 %" in lines[-3] and "6.5 %" in lines[-2]


#: Numbers of each subject.
COUNTS = {
    "bars": 4, "hencky": 7, "abaqus": 16, "marc bubble": 7, "strips": 5, "thin walls": 6,
    "bent tube": 3, "nu12": 5,
}  # fmt: skip


@cache
def ours():
    """Of the embedded membrane."""
    return dict(numbers([subject for subject in SUBJECTS if subject != "calculix"]))


def test_every_number_is_met():
    found = ours()
    assert {subject: len(some) for subject, some in found.items()} == COUNTS
    every = [one for some in found.values() for one in some]
    assert [one.row for one in every if not one.met] == []
    assert max(Counter(one.what for one in every).values()) == 1
    assert all(one.source for one in every)


def test_theirs_are_the_published_ones():
    printed = {
        "end stress, direct warp bar": 62.677, "end stress, inverse fill bar": 51.448,
        "b_0 of Hencky's membrane, nu 0": 1.6204, "b_0 of Hencky's membrane, nu 0.34": 1.7439,
        "apex, test 1 e, 298 kPa": 39.4934, "engineering strain of the gauge, bias strip": 0.555,
        "largest displacement over the mean, nu12 0.45": 0.967,
    }  # fmt: skip
    theirs = {one.what: one.theirs for some in ours().values() for one in some}
    assert {what: theirs[what] for what in printed} == pytest.approx(printed, abs=5e-5)
    assert verification.SOLUTION == tuple(TABLE_4_2)
    # The apex of Marc's bubble is the highest node of each curve.
    apex = [theirs[f"apex of Table 4.2, {1e3 * p:g} kPa"] for p in verification.PRESSURES]
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
    squares = {"warp": 0.998, "fill": 0.959, "bias": 0.987}
    expected = {f"R^2 of the {name} polynomial": r for name, r in squares.items()}
    assert {one.what: one.theirs for one in found} == expected
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

    def run(self, *args, **options):
        history = super().run(*args, **options)
        return replace(history, load=1.0002 * np.asarray(history.load))


def test_the_command(monkeypatch, tmp_path):
    subjects = {"bars": marc_bars, "calculix": lambda: iter(())}
    monkeypatch.setattr(verification, "SUBJECTS", subjects)
    done = in_process("verify", "--subject", "bars", "--subject", "calculix", cwd=tmp_path)
    row = next(line for line in done.output.splitlines() if "direct warp bar" in line)
    assert row.split()[5:10] == ["62.6747", "62.677", "MPa", "-0.0036", "%"]
    assert "MSC Marc; Jekel et al., Composite Structures 161 (2017)" in row
    assert "calculix: not here" in done.output
    assert done.output.endswith("all 4 numbers are met\n")
    # A solver that is a little wrong is seen.
    subjects["bars"] = lambda: marc_bars(Stiff())
    done = in_process("verify", "--subject", "bars", cwd=tmp_path, code=1)
    assert done.output.count("   MISSED\n") == 4
    assert "4 of 4 missed: end stress, direct warp bar; " in done.output.splitlines()[-1]
    done = in_process("verify", "--subject", "bars", "--json", cwd=tmp_path, code=1)
    told = json.loads(done.output)
    first = told["numbers"][0]
    assert (told["ok"], first["subject"], first["met"]) == (False, "bars", False)
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
    assert verification.TABLE.is_file()
