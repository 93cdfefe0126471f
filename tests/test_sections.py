"""Sections of a project file: units, numbers, errors in one line; files that are not read."""

import os
import pickle
from pathlib import Path
from typing import get_args

import pytest
from bubblefit.errors import InputError, one_line
from bubblefit.materials.card import read_card
from bubblefit.project.project import read_project
from bubblefit.readers.curves import LoadUnit
from bubblefit.readers.frames import read_frames
from bubblefit.readers.sections import (
    HUGE,
    LENGTH_UNITS,
    MODULUS_UNITS,
    PRESSURE_UNITS,
    LengthUnit,
    ModulusUnit,
    Number,
    Positive,
    PositiveBounds,
    PressureUnit,
    Section,
    Strain,
    StrainTriple,
    first_error,
    path_beside,
)
from bubblefit.readers.tables import read_lines
from bubblefit.readers.units import LOAD_UNITS, WIDTH_LOAD_UNITS
from bubblefit.solvers.marc.settings import site_settings
from bubblefit.storage.reading import check_regular, read_bytes
from pydantic import Field, TypeAdapter, ValidationError

from .support.refusals import complaint, raised

#: Of one of each, in SI.
PASCAL = {"Pa": 1.0, "kPa": 1e3, "MPa": 1e6, "GPa": 1e9, "bar": 1e5}


def test_units_are_those_of_si():
    for table in (MODULUS_UNITS, PRESSURE_UNITS):
        pascal = {name: 1e6 * mpa for name, mpa in table.items()}
        assert pascal == pytest.approx({name: PASCAL[name] for name in table})
    assert LENGTH_UNITS == {"m": 1000.0, "mm": 1.0, "in": 25.4}
    assert set(get_args(ModulusUnit)) == {"GPa", "MPa", "Pa"} == set(MODULUS_UNITS)
    assert set(get_args(PressureUnit)) == {"kPa", "MPa", "bar", "Pa"} == set(PRESSURE_UNITS)
    assert set(get_args(LengthUnit)) == set(LENGTH_UNITS)
    assert set(get_args(LoadUnit)) <= {*LOAD_UNITS, *WIDTH_LOAD_UNITS}
    assert LOAD_UNITS["lbf"] == pytest.approx(4.4482216152605)
    assert WIDTH_LOAD_UNITS["lbf/in"] == pytest.approx(0.175126835)


@pytest.mark.parametrize(
    ("kind", "good", "bad"),
    [
        (Number, [-HUGE, 0.0, HUGE], [-1.001e18, 1.001e18]),
        (Positive, [1e-300, HUGE], [0.0, -1.0, 1.001e18]),
        (Strain, [1e-9, 2.0], [0.0, 2.001, -0.1]),
        (PositiveBounds, [[1.0, 2.0]], [[1.0], [1.0, 2.0, 3.0], [0.0, 1.0]]),
        (StrainTriple, [[0.1, 0.2, 2.0]], [[0.1, 0.2], [0.1] * 4, [0.1, 0.2, 2.1]]),
    ],
)
def test_numbers_of_a_project_at_their_ends(kind, good, bad):
    assert HUGE == 1e18
    for value in good:
        assert TypeAdapter(kind).validate_python(value) == value
    for value in bad:
        raised(ValidationError, "", TypeAdapter(kind).validate_python, value)


def test_files_beside_a_project(monkeypatch):
    monkeypatch.setenv("HOME", "/home/a")
    given = {"b.csv": "/p/b.csv", "../b": "/p/../b", "/c": "/c", "~/d": "/home/a/d"}
    assert {name: str(path_beside(Path("/p"), name)) for name in given} == given


class Inner(Section):
    length: float
    pair: list[float] = Field(default=[1.0, 2.0], min_length=2, max_length=2)


class Outer(Section):
    name: str = "a"
    inner: Inner | None = None
    many: list[Inner] = Field(default=[])
    needed: Inner


RIGHT = {"length": 1.0}


def said(content: dict, at: str = "") -> str:
    found = raised(ValidationError, "", Outer.model_validate, content)
    return str(first_error(Path("p.toml"), found, Outer, at))


@pytest.mark.parametrize(
    ("content", "words"),
    [
        ({}, "needed: this section is missing; add it"),
        ({"needed": {}}, "needed.length: this key is missing; add it"),
        ({"needed": {**RIGHT, "zzz": 1}}, "needed.zzz: unknown key; allowed here: length, pair"),
        ({"needed": RIGHT, "nam": "x"}, "nam: unknown key; did you mean 'name'? allowed here: na"),
        ({"needed": RIGHT, "many": [RIGHT, {**RIGHT, "pairs": 1}]}, "many[1].pairs: unknown key;"),
        # Half of the letters in their order are near, fewer are not.
        ({"needed": {**RIGHT, "pxyz": 1}}, "needed.pxyz: unknown key; allowed here: length, pair"),
        ({"needed": {**RIGHT, "paxy": 1}}, "needed.paxy: unknown key; did you mean 'pair'?"),
        ({"needed": {"length": float("inf")}}, "needed.length: expected a finite number, got inf"),
        ({"needed": {**RIGHT, "pair": []}}, "needed.pair: expected at least 2 items, got 0"),
        ({"needed": {**RIGHT, "pair": [1, 2, 3]}}, "needed.pair: expected at most 2 items, got 3"),
        ({"needed": {**RIGHT, "pair": "x" * 58}}, "needed.pair: expected a valid list, got 'x"),
        ({"needed": RIGHT, "name": 3}, "name: expected a valid string, got 3"),
    ],
)
def test_the_whole_line(content, words):
    assert said(content).startswith(f"p.toml: {words}")
    field, rest = words.split(": ", 1)
    assert said(content, "a.b").startswith(f"p.toml: a.b.{field}: {rest}")


def test_long_values_are_cut_and_other_findings_counted():
    for count, end in ((58, "x" * 58 + "'"), (59, "x" * 56 + "...")):
        assert said({"needed": {**RIGHT, "pair": "x" * count}}).endswith(f"got '{end}")
    wrong = {"needed": {"length": "x"}, "name": 3}
    assert said(wrong).endswith("name: expected a valid string, got 3 (1 more)")
    first = said({**wrong, "nam": 1})  # unknown keys before all
    assert "nam: unknown key" in first and first.endswith("(2 more)")


READERS = [read_project, read_card, site_settings, read_lines, lambda path: read_frames([path])]


def test_a_file_whole_and_no_more_of_it_than_is_meant(tmp_path):
    path, link = tmp_path / "a", tmp_path / "link"
    path.write_bytes(b"x" * 2**20)
    link.symlink_to(path)
    assert read_bytes(path) == read_bytes(path, 2**20) == read_bytes(link) == b"x" * 2**20
    # A file of /proc says nothing of its size.
    assert read_bytes("/proc/self/status").startswith(b"Name:")
    for large, most in ((path, 2**20 - 1), ("/proc/self/status", 10)):
        assert f"{large}: has more than 0 MiB" in complaint(read_bytes, large, most)
    raised(FileNotFoundError, "", read_bytes, tmp_path / "b")


@pytest.mark.parametrize("read", READERS)
def test_what_may_never_end_is_not_read(tmp_path, read):
    pipe, link, large = tmp_path / "pipe", tmp_path / "link", tmp_path / "large"
    os.mkfifo(pipe)
    link.symlink_to("/dev/zero")
    for path in (pipe, link, Path("/dev/zero")):
        assert complaint(read, path).startswith(f"{path}: is no regular file")
    assert complaint(read, tmp_path / "a\0b").startswith(f"{tmp_path}/a\\0b: no file can have such")
    with large.open("wb") as file:
        file.truncate(2**40)
    assert "is it the right file?" in complaint(read, large)


def test_a_folder_is_left_to_its_reader(tmp_path):
    check_regular(tmp_path)
    assert complaint(read_card, tmp_path) == f"{tmp_path}: is a folder; name a file in it"


def test_a_message_stays_one_line_whatever_a_name_holds():
    error = InputError("a\nb\x1b[31m.csv", "line 1, column 'x\u202ey\u2028'", "ärger – 0,5 µm")
    text = "a\\nb\\x1b[31m.csv: line 1, column 'x\\u202ey\\u2028': ärger – 0,5 µm"
    assert str(error) == str(pickle.loads(pickle.dumps(error))) == text
    assert one_line("a\u00a0b") == "a\u00a0b" and one_line("\udcff") == "\\udcff"
