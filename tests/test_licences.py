"""`.ci/licences.py`, a part of `make lint`: bounds, licences, files of somebody else's."""

from __future__ import annotations

import tomllib
from email.message import Message
from pathlib import Path
from types import ModuleType, SimpleNamespace

import pytest

from .places import ROOT
from .scripts import script


@pytest.fixture(scope="module")
def licences() -> ModuleType:
    return script(".ci/licences.py")


def installed(name: str, licence: str, *requires: str) -> SimpleNamespace:
    about = Message()
    about["License-Expression"] = licence
    return SimpleNamespace(version="1", metadata=about, requires=requires, name=name)


def found(licences, monkeypatch, tmp_path, direct, **there) -> list[str]:
    def distribution(name):
        if name not in there:
            raise licences.PackageNotFoundError(name)
        return there[name]

    monkeypatch.setattr(licences, "distribution", distribution)
    project = {"dependencies": direct, "optional-dependencies": {"dev": ["absent>=1"]}}
    return licences.problems(project, tmp_path)


def test_ours_are_in_order(licences) -> None:
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
    assert licences.problems(project, ROOT) == []


def test_what_is_wrong_is_a_line(licences, monkeypatch, tmp_path) -> None:
    there = {"a": installed("a", "MIT", "b>=1", 'c>=1; extra == "x"'), "b": installed("b", "AGPL")}
    (line,) = found(licences, monkeypatch, tmp_path, ["a>=1"], **there)
    assert line == "b 1: licence 'AGPL' is none of those in .ci/licences.py"
    there["b"] = installed("b", "BSD-3-Clause")
    assert found(licences, monkeypatch, tmp_path, ["a>=1"], **there) == []
    for text in ("a", "a<2", "a; python_version > '3'"):
        (line,) = found(licences, monkeypatch, tmp_path, [text], **there)
        assert "has no lower bound" in line
    there["a"] = installed("a", "")
    (line,) = found(licences, monkeypatch, tmp_path, ["a>=1"], **there)
    assert "'nothing'" in line


def test_a_file_of_somebody_elses_has_to_be_named(licences, monkeypatch, tmp_path) -> None:
    path = tmp_path / "templates" / "plot.js"
    path.parent.mkdir()
    path.write_text("/*! plot.js v1 Copyright (c) Somebody */")
    (line,) = found(licences, monkeypatch, tmp_path, [])
    assert line == "templates/plot.js: is somebody else's file; name it in VENDORED"
    monkeypatch.setitem(licences.VENDORED, "templates/plot.js", "MIT")
    assert found(licences, monkeypatch, tmp_path, []) == []


def test_lint_runs_it() -> None:
    lint = Path(ROOT / "Makefile").read_text().split("\nlint:")[1].split("\n\n")[0]
    assert ".ci/licences.py" in lint
