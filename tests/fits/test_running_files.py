"""The output folder of a fit: what survives a kill, and what resume makes of it."""

from __future__ import annotations

import csv
import errno
import json
import os
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from bubblefit.errors import InputError, OutputError
from bubblefit.runs.folder import RESULT, RUN, Store
from bubblefit.runs.starts import HISTORY, STARTS, EvaluationRecord, RunningFiles, StartRecord
from hypothesis import given, settings
from hypothesis import strategies as st

from .. import needs

COLUMNS = ["beta_3_GPa", "beta_7_GPa", "beta_11_GPa"]
SCALE = [1000.0] * 3


def evaluation(start: int, analysis: int, value: float | None = 0.5) -> EvaluationRecord:
    return EvaluationRecord(start, analysis, value, "ok", (12.0, 250.0, 1e3 / 3), ())


def finished(number: int, value: float | None = 0.1) -> StartRecord:
    return StartRecord(
        number, (1, number), value, "converged", 7, (0.1, 1 / 3), (12.0, 250.0, 400.0), 1.5
    )


class Folder(RunningFiles):
    """The running files of a fit in a store of their own."""

    def __init__(self, path: Path) -> None:
        super().__init__(Store(path), COLUMNS, SCALE)


def begin(
    folder: Folder, project: str = "a", resume: bool = False, overwrite: bool = False
) -> dict[int, StartRecord]:
    going_on = folder.store.begin(
        {"law": project, "data": "d"}, resume, overwrite, (STARTS, HISTORY)
    )
    return {record.number: record for record in folder.begin(going_on)}


def test_a_start_that_the_solvers_failure_ended_is_run_again(tmp_path: Path) -> None:
    folder = Folder(tmp_path)
    begin(folder)
    cut = replace(finished(1), status="calculix failed: killed", failure="killed")
    for record in (evaluation(0, 1), finished(0), evaluation(1, 1), cut):
        folder.add(record)
    folder.finish()
    again = Folder(tmp_path)
    assert list(begin(again, resume=True)) == [0]
    again.close()
    rows = (tmp_path / HISTORY).read_text().splitlines()[1:]
    assert [row.split(",")[0] for row in rows] == ["0"]


def test_a_start_that_began_again_has_its_rows_once(tmp_path: Path) -> None:
    """Its process died, and another did it from the beginning."""
    folder = Folder(tmp_path)
    begin(folder)
    first = [evaluation(1, 1), evaluation(0, 1), evaluation(1, 2)]
    again = [evaluation(1, 1, 0.25), evaluation(1, 2, 0.125), evaluation(1, 3, 0.0625)]
    for record in (*first, *again, finished(1), finished(0)):
        folder.add(record)
    folder.finish()
    rows = list(csv.DictReader((tmp_path / HISTORY).open()))
    told = [(row["start"], row["analysis"], float(row["objective"])) for row in rows]
    assert told == [("0", "1", 0.5), ("1", "1", 0.25), ("1", "2", 0.125), ("1", "3", 0.0625)]


def test_page_and_card_of_an_earlier_result_go(tmp_path: Path) -> None:
    """Beside a later fit that failed they would pass for its own."""
    begin(Folder(tmp_path)).clear()
    for name in (RESULT, "report.html", "material.toml", "notes.txt"):
        (tmp_path / name).write_text("of the first fit")
    begin(Folder(tmp_path), overwrite=True)
    kept = {path.name for path in tmp_path.iterdir()}
    assert "notes.txt" in kept and not kept & {RESULT, "report.html", "material.toml"}


def study(path: Path) -> Folder:
    """Starts 0 and 1 finished, start 2 under way: then the process is killed."""
    folder = Folder(path)
    assert begin(folder) == {}
    for start in (1, 0, 2):
        for analysis in (1, 2):
            folder.add(evaluation(start, analysis))
        if start < 2:
            folder.add(finished(start))
    return folder


def rows(path: Path) -> list[dict[str, str]]:
    with open(path / HISTORY, encoding="utf-8", newline="") as stream:
        return list(csv.DictReader(stream))


# Written while running


def test_rows_are_on_disk_before_anything_is_closed(tmp_path: Path) -> None:
    study(tmp_path)
    assert [(r["start"], r["analysis"]) for r in rows(tmp_path)] == [
        ("1", "1"), ("1", "2"), ("0", "1"), ("0", "2"), ("2", "1"), ("2", "2"),
    ]  # fmt: skip
    first = rows(tmp_path)[0]
    assert float(first["beta_11_GPa"]) == 1 / 3  # to the last bit
    assert float(first["objective"]) == 0.5 and first["status"] == "ok"
    lines = (tmp_path / STARTS).read_text().splitlines()
    assert [StartRecord.from_json(json.loads(line)) for line in lines] == [
        finished(1),
        finished(0),
    ]
    assert not (tmp_path / RESULT).exists()


def test_failed_analyses_have_an_empty_objective(tmp_path: Path) -> None:
    folder = Folder(tmp_path)
    begin(folder)
    folder.add(EvaluationRecord(0, 1, None, 'said, "no"', (1.0, 2.0, 3.0), ()))
    assert rows(tmp_path)[0]["objective"] == ""
    assert rows(tmp_path)[0]["status"] == 'said, "no"'


def test_finish_puts_history_in_order(tmp_path: Path) -> None:
    folder = study(tmp_path)
    folder.finish()
    order = [(int(r["start"]), int(r["analysis"])) for r in rows(tmp_path)]
    assert order == sorted(order) and len(order) == 6
    folder.close()  # harmless


@given(
    st.one_of(st.none(), st.floats(0, 1e9)),
    st.lists(st.floats(allow_nan=False, allow_infinity=False), max_size=12),
    st.text(max_size=20),
)
def test_start_records_survive_json(value: Any, unknowns: list[float], status: str) -> None:
    record = StartRecord(3, (1, 3), value, status, 9, tuple(unknowns), tuple(unknowns), 0.1)
    assert StartRecord.from_json(json.loads(json.dumps(record.to_json()))) == record


# Resume


def test_resume_keeps_finished_starts_and_drops_the_unfinished(tmp_path: Path) -> None:
    study(tmp_path)
    folder = Folder(tmp_path)
    done = begin(folder, resume=True)
    assert done == {0: finished(0), 1: finished(1)}
    assert {r["start"] for r in rows(tmp_path)} == {"0", "1"}
    folder.add(evaluation(2, 1))
    folder.add(finished(2))
    folder.finish()
    assert [r["start"] for r in rows(tmp_path)] == ["0", "0", "1", "1", "2"]
    assert begin(Folder(tmp_path), resume=True).keys() == {0, 1, 2}


@pytest.mark.parametrize("cut", range(1, 60, 7))
def test_a_truncated_last_line_is_run_again(tmp_path: Path, cut: int) -> None:
    study(tmp_path)
    for name in (STARTS, HISTORY):
        content = (tmp_path / name).read_bytes()
        (tmp_path / name).write_bytes(content[:-cut])
    done = begin(Folder(tmp_path), resume=True)
    assert done.keys() <= {0, 1} and done[1] == finished(1)
    # Without its end of line a record is still whole.
    assert (0 in done) == (cut == 1)
    for row in rows(tmp_path):
        assert None not in row and None not in row.values()
        assert np.isfinite(float(row["beta_11_GPa"]))


@given(st.integers(0, 10_000), st.integers(0, 10_000))
@settings(max_examples=60, deadline=None)
def test_cut_anywhere_resume_works_or_says_why(first: int, second: int) -> None:
    import tempfile

    with tempfile.TemporaryDirectory() as name:
        path = Path(name)
        study(path).close()
        for file, cut in ((STARTS, first), (HISTORY, second)):
            content = (path / file).read_bytes()
            (path / file).write_bytes(content[: cut % (len(content) + 1)])
        folder = Folder(path)
        done = begin(folder, resume=True)
        folder.close()
        assert all(record == finished(number) for number, record in done.items())
        assert {r["start"] for r in rows(path)} <= {str(number) for number in done}


def test_a_damaged_middle_line_is_an_error(tmp_path: Path) -> None:
    study(tmp_path)
    lines = (tmp_path / STARTS).read_text().splitlines()
    (tmp_path / STARTS).write_text(lines[0][:20] + "\n" + lines[1] + "\n")
    with pytest.raises(InputError, match=r"starts.jsonl: line 1: .*--overwrite"):
        begin(Folder(tmp_path), resume=True)


def test_another_study_is_not_resumed(tmp_path: Path) -> None:
    study(tmp_path)
    with pytest.raises(InputError, match=r"parts: .*another law;"):
        begin(Folder(tmp_path), "b", resume=True)
    assert len(rows(tmp_path)) == 6


@pytest.mark.parametrize("content", [b"", b"{", b"[]", b"{}", b"3", b"\xff\xfe", b'{"x": 1}'])
def test_a_damaged_fingerprint_is_said(tmp_path: Path, content: bytes) -> None:
    study(tmp_path)
    (tmp_path / RUN).write_bytes(content)
    with pytest.raises(InputError, match=r"run.json"):
        begin(Folder(tmp_path), resume=True)


def test_bytes_that_are_no_text_do_not_end_in_a_traceback(tmp_path: Path) -> None:
    """A disk that filled up or a crash can leave blocks of anything at the end of a file."""
    for name in (STARTS, HISTORY):
        study(tmp_path / name).close()
        with open(tmp_path / name / name, "ab") as stream:
            stream.write(b"\x00\xff\xfe")
        done = begin(Folder(tmp_path / name), resume=True)
        assert done.keys() == {0, 1}


def test_resume_removes_an_old_result(tmp_path: Path) -> None:
    folder = study(tmp_path)
    folder.store.write(RESULT, "{}")
    begin(Folder(tmp_path), resume=True)
    assert not (tmp_path / RESULT).exists()


def test_resume_where_nothing_is_says_so(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"new: holds nothing to go on with.*--resume"):
        begin(Folder(tmp_path / "new"), resume=True)
    assert not (tmp_path / "new").exists()


def test_a_folder_in_use_is_not_written_over(tmp_path: Path) -> None:
    study(tmp_path)
    with pytest.raises(OutputError, match=r"--resume.*--overwrite"):
        begin(Folder(tmp_path))
    assert len(rows(tmp_path)) == 6
    assert begin(Folder(tmp_path), "b", overwrite=True) == {}
    assert rows(tmp_path) == []


# Disks that cannot be written


def test_a_path_under_a_file(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    with pytest.raises(OutputError, match=r"cannot be written.*--out"):
        begin(Folder(tmp_path / "file" / "out"))
    with pytest.raises(OutputError, match="--out"):
        begin(Folder(tmp_path / "file"))


def test_a_folder_that_takes_no_files() -> None:
    if not Path("/proc/self").is_dir():
        needs.missing("no /proc here: nothing that is read-only even to root")
    with pytest.raises(OutputError, match="--out") as caught:
        begin(Folder(Path("/proc/self/out")))
    assert caught.value.exit_code == 2 and "\n" not in str(caught.value)


def test_a_full_disk_leaves_no_half_file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    folder = study(tmp_path)
    folder.store.write(RESULT, "before")

    def full(*_: Any) -> None:
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    monkeypatch.setattr(os, "fsync", full)
    with pytest.raises(OutputError, match="No space left"):
        folder.store.write(RESULT, "after")
    with pytest.raises(OutputError, match="No space left"):
        folder.add(finished(2))
    monkeypatch.undo()
    assert (tmp_path / RESULT).read_text() == "before"
    assert not list(tmp_path.glob("*.part")) and not list(tmp_path.glob(".*"))
