"""A project as it is run, written down: folders and files in full, nothing that is not said."""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest
from bubblefit.project import project as written
from bubblefit.project.project import (
    HEAD,
    Written,
    plain,
    project_text,
    section_as_run,
    settings_of,
    settings_of_predictions,
)


def test_what_toml_can_say() -> None:
    said = {"a": None, "b": (1, None, {"c": None, 3: Path("x/y")}), "d": [[0.5]], "e": False}
    assert plain(said) == {"b": [1, None, {"3": "x/y"}], "d": [[0.5]], "e": False}
    assert project_text({"law": {"nu12": 0.5}}) == f"{HEAD}\n[law]\nnu12 = 0.5\n"


@pytest.mark.parametrize("told", [None, "other"])
def test_the_folder_of_a_section_is_in_full(tmp_path: Path, told: str | None) -> None:
    """That of the command instead of the section's; files in it as the section names them."""
    for name in ("lab/a.csv", "other/a.csv", "beside.csv", "a.csv"):
        (tmp_path / name).parent.mkdir(exist_ok=True)
        (tmp_path / name).write_text("")
    said = {
        "radius": 5.0,
        "data": {"points": {
            "folder": "lab", "files": ["a.csv", "beside.csv", "none.csv", "plain"], "left": None,
            "pressure": {"log": {"file": "beside.csv"}},
        }},
    }  # fmt: skip
    folder = None if told is None else tmp_path / told
    found = section_as_run(said, "first", "data.points.folder", tmp_path, folder)
    beside = str(tmp_path / "beside.csv")
    assert found == {
        "radius": 5.0,
        "name": "first",
        "data": {"points": {
            "folder": str(tmp_path / (told or "lab")),
            "files": ["a.csv", beside, "none.csv", "plain"],
            "pressure": {"log": {"file": beside}},
        }},
    }  # fmt: skip
    assert said["data"]["points"]["folder"] == "lab"  # type: ignore[index]


def test_a_section_without_a_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    assert section_as_run({"a": 1}, "x", None, tmp_path, None) == {"a": 1, "name": "x"}
    computed = {"data": {"known_solution": {"beta": [1.0]}}}
    found = section_as_run(computed, "x", "data.points.folder", tmp_path, tmp_path)
    assert found == {**computed, "name": "x"}
    # Beside the project unless it is said; ~ is the home.
    found = section_as_run({"data": {}}, "x", "data.folder", tmp_path, None)
    assert found["data"] == {"folder": str(tmp_path)}
    monkeypatch.setenv("HOME", "/home/a")
    found = section_as_run({"data": {"folder": "~/lab"}}, "x", "data.folder", tmp_path, None)
    assert found["data"] == {"folder": "/home/a/lab"}


def project(folder: Path, solver: str = "membrane", **options: Any) -> Any:
    tests = {"one": {"name": "one"}, "two": {"name": "two"}, "tube": {"name": "tube"}}
    kinds = {"one": "bubble", "two": "bubble", "tube": "cylinder", "made": "bubble"}
    cards = [{"name": "soft", "beta": [1.0]}, {"file": "c/d.toml"}]
    return SimpleNamespace(
        path=folder / "p.toml",
        written=Written("text", {"fabric": {"thickness": 1.0}}, tests, {}, kinds, cards),
        fit=SimpleNamespace(solver=solver, model_dump=lambda: {"solver": solver, "seed": None}),
        law=SimpleNamespace(model_dump=lambda: {"form": "cubic", "margin": None}),
        cards={"soft": 1, "of a file": 2},
        solver_options={solver: options, "another": {"element": "S4"}},
    )


def test_settings_of_the_tests_that_are_run(tmp_path: Path) -> None:
    own = project(tmp_path)
    assert settings_of(own, ["one", "tube", "made"]) == {
        "fabric": {"thickness": 1.0},
        "law": {"form": "cubic"},
        "fit": {"solver": "membrane"},
        "bubble": [{"name": "one"}],
        "cylinder": [{"name": "tube"}],
    }
    both = settings_of(own, ["one", "two"])
    assert both["bubble"] == [{"name": "one"}, {"name": "two"}] and "solver" not in both


def test_options_of_the_solver_that_runs(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Those that its table may hold; what is there by its full path."""
    (tmp_path / "decks").mkdir()
    monkeypatch.chdir(tmp_path)
    fields = {"templates": 0, "element": 0, "more": 0, "left": 0}
    sections = {"calculix": SimpleNamespace(model_fields=fields)}
    monkeypatch.setattr(written, "solver_sections", lambda: sections)
    said = {
        "templates": "./decks", "element": "decks", "more": {"a": "./decks", "b": "./none"},
        "progress": "x", "left": None,
    }  # fmt: skip
    full = str(tmp_path / "decks")
    wanted = {"templates": full, "element": "decks", "more": {"a": full, "b": "./none"}}
    found = settings_of(project(tmp_path, "calculix", **said), [])
    assert found["solver"] == {"calculix": wanted}
    # Of one that has no table here, all of them.
    found = settings_of(project(tmp_path, "foreign", **said), [])
    assert found["solver"] == {"foreign": {**wanted, "progress": "x"}}


def test_cards_of_a_prediction(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Those of the project as it says them, files in full; others by their files."""
    monkeypatch.chdir(tmp_path)
    own = project(tmp_path / "here")
    found = settings_of_predictions(own, ["tube"], ["of a file", "x/new.toml", "soft"])
    assert "law" not in found and found["cylinder"] == [{"name": "tube"}]
    assert found["card"] == [
        {"file": str(tmp_path / "here" / "c" / "d.toml")},
        {"file": str(tmp_path / "x" / "new.toml")},
        {"name": "soft", "beta": [1.0]},
    ]
    assert own.written.cards[1] == {"file": "c/d.toml"}
