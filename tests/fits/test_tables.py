"""Tables of a fit as files, and the columns that every test's residuals end with."""

from __future__ import annotations

import importlib.util
from pathlib import Path
from typing import Any

import bubblefit as bf
import pandas as pd
import pytest
from bubblefit.runs.folder import write_table
from bubblefit.runs.result import COMPARED, TABLES

from ..complaints import complaint_with
from ..places import ROOT


@pytest.mark.parametrize("table", TABLES)
def test_every_table_is_written_and_read_back(together: bf.Fit, tmp_path: Path, table: str) -> None:
    path = together.write_table(tmp_path / "new folder" / f"{table}.csv", table)
    own, read = getattr(together, table)(), pd.read_csv(path)
    pd.testing.assert_frame_equal(read, own, check_dtype=False, rtol=1e-8)


def test_residuals_unless_asked_otherwise(together: bf.Fit, tmp_path: Path) -> None:
    read = pd.read_csv(together.write_table(tmp_path / "fit.csv"))
    assert list(read.columns)[-5:] == list(COMPARED)
    assert set(read["test"]) == {"one", "two"} and set(read["unit"]) == {"N"}
    assert (read["modelled"] - read["measured"] - read["difference"]).abs().max() < 1e-5


def test_parquet_is_written_by_pandas_as_it_is(
    together: bf.Fit, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    asked: list[Any] = []

    def to_parquet(table: pd.DataFrame, path: Path, **options: Any) -> None:
        asked.append((table, options))
        path.write_bytes(b"PAR1")

    monkeypatch.setattr(pd.DataFrame, "to_parquet", to_parquet)
    monkeypatch.setattr(importlib.util, "find_spec", lambda name: name)
    path = together.write_table(tmp_path / "fit.parquet", "moduli")
    ((table, options),) = asked
    assert path.read_bytes() == b"PAR1" and list(tmp_path.iterdir()) == [path]
    pd.testing.assert_frame_equal(table, together.moduli())
    assert options == {"engine": "pyarrow", "index": False}


def test_parquet_without_pyarrow_says_what_to_do(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(importlib.util, "find_spec", lambda name: None)
    path = tmp_path / "fit.parquet"
    words = [f"{path}: ", "pip install 'bubblefit[parquet]'", "or write a .csv"]
    complaint_with(words, write_table, pd.DataFrame({"a": [1]}), path)
    assert not path.exists()


def test_other_endings_and_tables_are_refused(together: bf.Fit, tmp_path: Path) -> None:
    for name in ("fit.xlsx", "fit"):
        complaint_with([name, ".csv or .parquet"], together.write_table, tmp_path / name)
    words = ["table: 'history' is not one of: residuals, moduli, coefficients, starts"]
    complaint_with(words, together.write_table, tmp_path / "a.csv", "history")
    assert list(tmp_path.iterdir()) == []


def test_every_column_is_documented(together: bf.Fit) -> None:
    """In docs/reference/files.md, with those that other kinds of test have."""
    text = (ROOT / "docs/reference/files.md").read_text()
    others = {"frame", "pressure_kPa", "x_mm", "y_mm", "warp_load_kN_per_m", "fill_load_kN_per_m"}
    for column in {*together.moduli(), *together.residuals(), *others}:
        assert f"`{column}`" in text, column
