"""The registry of readers, and what importing them costs."""

import json
from pathlib import Path

import numpy as np
import pytest
from bubblefit.errors import PlugInFailure
from bubblefit.readers import registry
from bubblefit.readers.curves import read_load_curves, read_published_polynomials
from bubblefit.readers.fields import read_fields
from bubblefit.readers.frames import WITHOUT_VALUE, Frame, read_frames
from bubblefit.readers.registry import (
    Format,
    format_named,
    format_names,
    format_of,
    formats,
    register_format,
)

from ..builders.plug_ins import install_plug_in
from ..support.refusals import complaint, raised

STARRED = "*** a camera\n1 2 0 0.1 0.2 0.3\n4 5 0 0.4 0.5 0.6\n7 8 0 nan nan nan\n"


def read_starred(path: Path, options) -> list[Frame]:
    values = np.loadtxt(path, skiprows=1, ndmin=2)
    return [Frame(values[:, :3], values[:, 3:], path)]


def starred(name="starred", recognises=lambda path, head: head.startswith(b"*** a camera")):
    return Format(name, "frame", "with three stars", read_starred, recognises)


@pytest.fixture
def registered_formats(monkeypatch):
    formats("frame")
    monkeypatch.setattr(registry, "_FORMATS", dict(registry._FORMATS))


def test_contents_have_one_default_format(tmp_path):
    for content in ("frame", "machine table", "load polynomials"):
        ours = formats(content)
        assert sum(one.recognises is None for one in ours) == 1
        assert format_names(content)[: len(ours)] == tuple(one.name for one in ours)
        assert all(one.title and format_named(content, one.name) == one for one in ours)
    message = complaint(read_load_curves, tmp_path / "a.csv", format="csb")
    assert message.startswith("format: 'csb' is not one of: text")
    for read in (lambda p: read_frames([p]), read_load_curves, read_published_polynomials):
        assert "no such file" in complaint(read, tmp_path / "a.csv")
    for read in (read_load_curves, read_published_polynomials):
        assert "is a folder" in complaint(read, tmp_path)


def test_file_is_read_by_the_format_that_recognises_it(tmp_path, registered_formats):
    path = tmp_path / "frame.csv"
    path.write_text(STARRED)
    assert "no row of names with places" in complaint(read_frames, [path])
    register_format(starred())
    assert format_of("frame", path).name == "starred"
    (frame,) = read_frames([path])
    np.testing.assert_array_equal(frame.displacement[0], [0.1, 0.2, 0.3])
    # A field needs all of a point: what correlation lost is dropped.
    (field,) = read_fields([path], [0.1])
    assert (len(field.points), field.dropped) == (2, {WITHOUT_VALUE: 1})
    # What is named is not looked for; other contents do not know it.
    assert "'csv'" not in complaint(read_frames, [path], format="csv")
    assert format_of("machine table", path).name == "text"
    register_format(starred("other"))
    assert f"{path}: the format may be 'other' or 'starred'" in complaint(read_frames, [path])
    assert len(read_frames([path], format="other")) == 1
    twice = Format("twice", "frame", "two", lambda *a: read_starred(*a) * 2)
    register_format(twice)
    assert len(read_frames([path], format="twice")) == 2
    said = complaint(read_fields, [path], [0.1], format="twice")
    assert "expected one frame for each of 1 pressures, found 2" in said
    path.write_text("*** a camera\n7 8 0 nan nan nan\n")
    said = complaint(read_fields, [path], [0.1], format="other")
    assert "no row is left to use: 1 without a value" in said


READER = """
import json
import numpy as np
from bubblefit.readers.frames import Frame
from bubblefit.readers.registry import Format

def read(path, options):
    content = json.loads(path.read_text())
    return [Frame(np.array(content["places"]), np.array(content["moves"]), path)]

def recognises(path, head):
    return b'"places"' in head

THING = Format("{name}", "frame", "places and moves", read, recognises)
"""


def install_reader(folder, name="json", text=READER, **options):
    install_plug_in(
        folder, name, text.replace("{name}", name), group="bubblefit.readers", **options
    )


def test_plug_in_format_is_found_and_its_failures_reported(packages, tmp_path, registered_formats):
    install_reader(packages)
    install_reader(packages, "csv", "raise RuntimeError")
    path = tmp_path / "frame.json"
    path.write_text(json.dumps({"places": [[1, 2, 3]], "moves": [[0.1, 0.2, 0.3]]}))
    assert "json" in format_names("frame")
    assert format_of("frame", path).name == "json"
    assert read_frames([path])[0].points.tolist() == [[1, 2, 3]]
    assert len(read_frames([path], format="json")) == 1
    message = complaint(read_load_curves, path, format="json")
    assert message == "format: 'json' is of a frame, not of a machine table"
    for text, cause in (('{"places": []}', "KeyError: 'moves'"), ('"places"', "TypeError: ")):
        path.write_text(text)
        failure = raised(PlugInFailure, "", read_frames, [path])
        words = f"the plug-in 'json' of acme-things 2.5 fails on {path} ({cause}"
        assert str(failure).startswith(words) and "\n" not in str(failure)
    # Ours are asked first, and keep their names.
    assert format_named("frame", "csv").title.startswith("columns of text")
    path.write_text('{"places": [[1, 2, 3]], "moves": [[0, 0, 0]]}')
    register_format(starred("mine", lambda path, head: head.startswith(b"{")))
    assert format_of("frame", path).name == "mine"
