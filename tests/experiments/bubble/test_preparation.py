"""From a section's data to fields and surfaces: what goes wrong on the way names its key."""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from bubblefit.errors import InputError
from bubblefit.experiments.bubble import data as preparation
from bubblefit.experiments.bubble.data import _same_steps_and_mesh
from bubblefit.experiments.kinds import Fabric, Place
from bubblefit.meshes.disk import disk_mesh
from bubblefit.readers.fields import DisplacementField

from ...complaints import complaint

PLACE = Place(Path("p.toml"), "bubble[0]", Fabric("a fabric", 0.8))


def points(registration: Any = None, recorded: Any = None) -> Any:
    return SimpleNamespace(
        files=("a.csv",), options="how", format="x", recorded=recorded, registration=registration
    )


def made(match_by: str = "surfaces", degree: int = 2) -> Any:
    return SimpleNamespace(
        place=PLACE, pressures=(0.1,), outline="rim", match_by=match_by, match_degree=degree
    )


def raising(error: InputError) -> Any:
    def call(*_: Any, **__: Any) -> None:
        raise error

    return call


def test_files_are_read_as_the_section_says(monkeypatch: pytest.MonkeyPatch) -> None:
    told: list[Any] = []
    monkeypatch.setattr(preparation, "read_fields", lambda *a, **named: told.append((a, named)))
    preparation._measured(made(), points())
    preparation._measured(made(), points(recorded=SimpleNamespace(frames=[3])))
    files, how = (("a.csv",), (0.1,)), {"options": "how", "format": "x"}
    assert told == [(files, {**how, "frames": None}), (files, {**how, "frames": [3]})]
    monkeypatch.setattr(preparation, "register_fields", lambda *what: what)
    assert preparation._measured(made(), points("asked")) == (None, "rim", "asked")


def test_what_cannot_be_read_or_registered_names_its_key(monkeypatch) -> None:
    monkeypatch.setattr(preparation, "read_fields", raising(InputError(None, "files", "odd")))
    said = complaint(preparation._measured, made(), points())
    assert said == "p.toml: bubble[0].data.points.files: odd"
    # A file at fault is named itself.
    monkeypatch.setattr(preparation, "read_fields", raising(InputError("a.csv", "line 3", "odd")))
    assert complaint(preparation._measured, made(), points()) == "a.csv: line 3: odd"
    monkeypatch.setattr(preparation, "read_fields", lambda *_, **__: ())
    for field, key in (("", ""), ("centre", ".centre")):
        error = InputError(None, field, "far off")
        monkeypatch.setattr(preparation, "register_fields", raising(error))
        said = complaint(preparation._measured, made(), points("asked"))
        assert said == f"p.toml: bubble[0].data.points.registration{key}: far off"


def field(count: int) -> DisplacementField:
    at = np.random.default_rng(1).uniform(-50, 50, (count, 2))
    return DisplacementField(0.1, at, np.ones((count, 3)))


def test_surfaces_that_are_only_reported_can_be_left_out() -> None:
    """A degree of two has nine coefficients, which the fewest points of a field have to settle."""
    enough, few = (field(20), field(9)), (field(20), field(8))
    for by in ("surfaces", "points"):
        found = preparation._surfaces(made(by), enough, computed=False)
        assert [surface.degree for surface in found] == [2, 2]
    assert preparation._surfaces(made("points"), few, computed=False) == ()
    assert complaint(preparation._surfaces, made(), few, computed=False) == (
        "p.toml: bubble[0].match.degree: surface of degree 2 at 100 kPa: 9 coefficients need as "
        "many points, there are 8; lower the degree"
    )


def test_a_computed_quarter_is_mirrored_for_its_surfaces(monkeypatch) -> None:
    seen: list[int] = []
    monkeypatch.setattr(preparation, "mirrored", lambda f: seen.append(len(f.points)) or f)
    preparation._surfaces(made(), (field(12),), computed=False)
    assert seen == []
    preparation._surfaces(made(), (field(12),), computed=True)
    assert seen == [12]


def test_data_of_this_model_are_told_from_others() -> None:
    """The same increments, to rounding, and the same nodes."""

    def same(steps: tuple[float, ...], elements: int) -> bool:
        test: Any = SimpleNamespace(
            elements=48, increments=(0.1, 0.2),
            model=lambda elements: SimpleNamespace(mesh=disk_mesh(100.0, elements)),
        )  # fmt: skip
        data: Any = SimpleNamespace(elements=elements, increments=steps)
        return _same_steps_and_mesh(test, data)

    assert same((0.1, 0.2), 48) and same((0.1 * (1 + 1e-10), 0.2), 48)
    assert not same((0.1, 0.2, 0.3), 48) and not same((0.1,), 48)
    assert not same((0.1 * (1 + 1e-8), 0.2), 48) and not same((1e-9, 0.2), 48)
    assert not same((0.1, 0.2), 108)
