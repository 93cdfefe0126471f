"""Laws at tests that they were not fitted to: every cell, line, mean and note, made up here."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from bubblefit import __version__
from bubblefit.errors import OutputError
from bubblefit.notes import Note, NoteKind
from bubblefit.runs.validation import HeldOut, Judged, Validation

from ..page_charts import charts_of

UNITS = {"one: warp": "N", "one: fill": "N"}
FAILED = Note(NoteKind.FAILED, "no analysis: too tired", "two")
ONE = HeldOut("one", 0.05, {"one: warp": 12.5, "one: fill": 7.0}, UNITS)
TWO = HeldOut("two", 0.15, {"two: warp": 30.0}, {"two: warp": "N"})
LOST = HeldOut("two", None, {}, {"two: warp": "N"}, (FAILED,))
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


def test_means() -> None:
    """One that could not be run leaves its law without a mean."""
    expected = {"cubic": 0.1, "constant": 0.065, "spline": np.nan}
    assert FOUND.means == pytest.approx(expected, nan_ok=True)


def test_table_and_result(tmp_path: Path) -> None:
    columns = [
        "law", "test", "compared", "unit", "foretold_rms", "fitted_rms", "foretold_relative",
        "fitted_relative", "foretold_words",
    ]  # fmt: skip
    wanted = [dict(zip(columns, (*row[:3], "N", *row[3:], ""), strict=True)) for row in ROWS]
    table = FOUND.table()
    assert list(table.columns) == columns
    pd.testing.assert_frame_equal(table, pd.DataFrame(wanted, dtype=None), check_dtype=False)
    assert FOUND.result == {
        "command": "validate",
        "title": "made",
        "version": __version__,
        "left_out": "tests",
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
        "cubic, foretold": [5.0, 15.0], "constant, foretold": [6.0, 7.0],
        "spline, foretold": [5.0, None], "cubic, fitted": [2.0, None],
    }  # fmt: skip
    for series in chart.series:
        assert np.round(series.x).tolist() == [1.0, 2.0]
    text = (tmp_path / "new" / "folder" / "validation.csv").read_text().splitlines()
    assert text[0] == ",".join(columns)
    assert text[1] == "cubic,one,one: warp,N,12.5,5,0.05,0.02,"
    with pytest.raises(OutputError):
        (tmp_path / "file").write_text("")
        FOUND.write(tmp_path / "file")


def test_lines() -> None:
    assert FOUND.lines() == [
        "law           test left out       compared                    foretold    fitted  unit",
        "cubic         one                 one: warp                       12.5         5  N",
        "cubic         one                 one: fill                          7         2  N",
        "cubic         two                 two: warp                         30       nan  N",
        "constant      one                 one: warp                         20       nan  N",
        "constant      one                 one: fill                          1       nan  N",
        "constant      two                 two: warp                          3       nan  N",
        "spline        one                 one: warp                       12.5       nan  N",
        "spline        one                 one: fill                          7       nan  N",
        "spline        two                 two: warp                        nan       nan  N",
        "cubic: foretold 10 % on average",
        "constant: foretold 6.5 % on average",
        "foretells best: constant",
    ]
    alone = Validation("made", FOUND.judged[:2])
    assert alone.lines()[-1] == "cubic: foretold 10 % on average"
