"""The output folder: whose it is, what is in the way, what is said of what differs."""

from __future__ import annotations

import json
import os
from pathlib import Path

import pytest
from bubblefit.errors import InputError, OutputError
from bubblefit.runs.folder import RESULT, RUN, Store, usual_folder

from ..complaints import complaint


def test_a_folder_far_below_is_made(tmp_path: Path) -> None:
    store = Store(tmp_path / "a" / "b" / "c")
    assert not store.begin({"law": "1"}, False, False) and store.used
    content = {"parts": {"law": "1"}, "facts": {}}
    assert (store.path / RUN).read_text() == json.dumps(content, indent=1) + "\n"
    # A folder that is there and holds nothing of this is as good.
    (tmp_path / "there").mkdir()
    (tmp_path / "there" / "notes.txt").write_text("mine")
    assert not Store(tmp_path / "there").begin({}, False, False)


@pytest.mark.parametrize("name", [RUN, RESULT])
def test_each_of_the_two_files_says_that_a_folder_is_used(tmp_path: Path, name: str) -> None:
    (tmp_path / name).write_text("{}")
    store = Store(tmp_path)
    assert store.used
    with pytest.raises(OutputError, match="already holds results"):
        store.begin({}, False, False)
    assert (tmp_path / name).read_text() == "{}"
    assert not store.begin({}, False, True)


def test_what_differs_is_named_without_facts(tmp_path: Path) -> None:
    """As an older version left it, or where there is nothing to tell it by."""
    store = Store(tmp_path)
    store.begin({"law": "1", "data": "2", "solver": "3"}, False, False)
    assert store.begin({"law": "1", "data": "2", "solver": "3"}, True, False)
    said = complaint(store.begin, {"law": "9", "data": "9", "solver": "3"}, True, False)
    assert said == (
        f"{tmp_path / RUN}: parts: this folder's results are of another data and law; go on with "
        "the same, or use --overwrite"
    )
    # Parts that only one of the two knows differ, too.
    for parts in ({"law": "1", "data": "2"}, {"law": "1", "data": "2", "solver": "3", "x": "4"}):
        with pytest.raises(InputError, match=r"another (solver|x);"):
            store.begin(parts, True, False)


def test_what_is_gone_on_with_is_kept(tmp_path: Path) -> None:
    store = Store(tmp_path)
    store.begin({}, False, False)
    before = (tmp_path / RUN).read_text()
    store.finish({"a": 1})
    assert (tmp_path / RESULT).read_text() == '{\n "a": 1\n}\n'
    (tmp_path / "starts").write_text("kept")
    assert store.begin({}, True, False, ("starts",))
    assert (tmp_path / "starts").exists() and not (tmp_path / RESULT).exists()
    assert (tmp_path / RUN).read_text() == before
    store.begin({}, False, True, ("starts",))
    assert not (tmp_path / "starts").exists()


def test_usual_folders(tmp_path: Path) -> None:
    assert usual_folder(tmp_path / "fabric" / "project.toml") == Path("out") / "fabric"
    assert usual_folder(tmp_path / "fabric" / "linear.toml") == Path("out") / "fabric-linear"


def test_what_a_killed_process_had_begun_to_write_goes(tmp_path: Path) -> None:
    gone, ours = ".result.999999999.json", f".moduli.{os.getpid()}.csv"
    for name in (gone, ours, ".hidden", ".a.b", "notes.999999999.txt"):
        (tmp_path / name).write_text("half")
    Store(tmp_path).begin({}, False, False)
    left = sorted(path.name for path in tmp_path.iterdir())
    assert left == sorted([RUN, ours, ".hidden", ".a.b", "notes.999999999.txt"])


def test_a_folder_that_is_to_be_replaced_holds_nothing(tmp_path: Path) -> None:
    store = Store(tmp_path / "fit")
    store.forget()  # not there
    store.begin({}, False, False)
    store.finish({})
    store.forget()
    assert not store.used
