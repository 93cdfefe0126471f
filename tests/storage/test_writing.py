"""Writing of files: whole or not at all, plain values as JSON, and the user's cache folder."""

import json
import math
import os
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from bubblefit.errors import OutputError
from bubblefit.storage import writing


def test_cache_folder_follows_platform_and_environment(monkeypatch):
    named = {"BUBBLEFIT_CACHE": "", "XDG_CACHE_HOME": "bubblefit", "HOME": ".cache/bubblefit"}
    for name in named:
        monkeypatch.setenv(name, f"/{name}")
    for name, below in named.items():
        assert writing.cache_folder() == Path(f"/{name}", below)
        monkeypatch.delenv(name)


def test_replaced_file_is_whole_or_as_before(tmp_path):
    path = tmp_path / "below" / "table.csv"
    with writing.replacing(path) as temporary:
        temporary.write_text("first")
        assert not path.exists()
    assert path.read_text() == "first"
    with pytest.raises(KeyboardInterrupt), writing.replacing(path) as temporary:
        temporary.write_text("sec")
        raise KeyboardInterrupt
    assert path.read_text() == "first"
    assert [file.name for file in path.parent.iterdir()] == ["table.csv"]


def test_text_is_on_the_disk_before_it_replaces_the_file(tmp_path, monkeypatch):
    path = tmp_path / "result.json"
    steps = []
    monkeypatch.setattr(os, "fsync", lambda number: steps.append(("flushed", path.exists())))
    replace = os.replace
    monkeypatch.setattr(os, "replace", lambda *paths: steps.append("replaced") or replace(*paths))
    writing.write_text(path, "1")
    assert steps == [("flushed", False), "replaced"] and path.read_text() == "1"


def test_numbers_of_a_table_are_those_that_pandas_writes(tmp_path):
    numbers = [0.1, -0.0, math.nan, math.inf, 1e-300, 123456789012.0, 1 / 3]
    table = pd.DataFrame({"a": numbers, "b, c": np.float32(numbers), "d": 2**60, "e": "x,y"})
    for digits in (9, 6, None):
        writing.write_csv(table, tmp_path / "a.csv", digits)
        expected = table.to_csv(index=False, float_format=digits and f"%.{digits}g")
        assert (tmp_path / "a.csv").read_text() == expected


def test_file_in_a_file_is_refused_with_advice(tmp_path):
    (tmp_path / "file").write_text("text")
    with pytest.raises(OutputError) as caught:
        writing.write_text(tmp_path / "file" / "page.html", "text")
    words = str(caught.value)
    assert "page.html: cannot be written: " in words and words.endswith("choose another --out")


def test_full_disk_is_told_apart():
    reason = writing.unwritable_reason(OSError(28, "No space left on device"))
    assert reason == "cannot be written: No space left on device; free space or choose"


def test_undecodable_bytes_of_a_path_are_written_as_replacements(tmp_path):
    writing.write_text(tmp_path / "page.html", "caf\udce9, caf\u00e9")
    assert (tmp_path / "page.html").read_text(encoding="utf-8") == "caf\ufffd, caf\u00e9"


def test_temporary_files_of_ended_processes_are_removed(tmp_path):
    ended = subprocess.Popen([sys.executable, "-c", ""])
    ended.wait()
    kept = (f".page.{os.getpid()}.html", ".hidden", "page.html", ".env.txt")
    removed = (f".page.{ended.pid}.html", f".table.{ended.pid}")
    for name in (*kept, *removed):
        (tmp_path / name).write_text("text")
    writing.remove_unfinished(tmp_path)
    assert {file.name for file in tmp_path.iterdir()} == set(kept)


@dataclass
class Strip:
    name: str
    loads: np.ndarray
    place: Path


def test_results_become_plain_values():
    strip = Strip("warp", np.array([1.0, math.inf]), Path("a.csv"))
    content = {"strip": strip, "count": np.int64(3), "rms": math.nan, "ok": True, "none": None}
    expected = {
        "strip": {"name": "warp", "loads": [1.0, None], "place": "a.csv"},
        "count": 3,
        "rms": None,
        "ok": True,
        "none": None,
    }
    assert writing.plain_values(content) == expected
    text = writing.json_text(content)
    assert json.loads(text) == expected and text.endswith("}\n")
