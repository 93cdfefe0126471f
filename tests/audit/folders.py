"""Read a finished output folder, its project and its measured data."""

import json
import tomllib
from functools import cached_property
from pathlib import Path

import pandas as pd

from .laws import Law
from .pages import Page


class Folder:
    """An output folder.

    Parameters
    ----------
    path : the folder.
    project : path of the project file; None: as provenance.json says, or the parent's project.toml.
    terminal : what the command printed.
    base : folder in which the command was typed, to which relative paths refer.
    files : names of the tables to read, None for all.

    Attributes
    ----------
    result : result.json, None where there is none.
    tables : every CSV as text, by its name below the folder.
    """

    def __init__(self, path, project=None, terminal="", base=None, files=None):
        self.path = Path(path)
        self.terminal = terminal
        self.base = Path(base) if base is not None else self.path.parent
        names = sorted(self.path.glob("*.csv")) if files is None else [path / f for f in files]
        self.tables = {
            file.name: pd.read_csv(file, dtype=str, keep_default_na=False, comment="#")
            for file in names
            if file.stat().st_size > 1
        }
        self._project = project

    def _json(self, name):
        file = self.path / name
        return json.loads(file.read_text(encoding="utf-8")) if file.exists() else None

    @cached_property
    def result(self):
        return self._json("result.json")

    @cached_property
    def check(self):
        """What `check` writes in place of result.json."""
        return self._json("check.json")

    @cached_property
    def command(self):
        return (self.result or self.check or {}).get("command")

    @cached_property
    def provenance(self):
        return self._json("provenance.json")

    @cached_property
    def page_data(self):
        return self._json("page.json")

    def charts(self, name):
        """Return the figures of a name in page.json."""
        sections = (self.page_data or {}).get("sections", [])
        parts = (part for section in sections for part in section["parts"])
        return [part for part in parts if part["part"] == "charts" and part["name"] == name]

    @cached_property
    def page(self):
        file = self.path / "report.html"
        return Page(file) if file.exists() else None

    @cached_property
    def starts(self):
        """Lines of starts.jsonl; of a report from Python, which has none, those of result.json."""
        file = self.path / "starts.jsonl"
        if not file.exists():
            starts = (self.result or {}).get("starts", [])
            return [start | {"number": start["start"]} for start in starts]
        return [json.loads(line) for line in file.read_text().splitlines() if line.strip()]

    @cached_property
    def card_text(self):
        """The folder's own material card as TOML; None where there is none."""
        file = self.path / "material.toml"
        return tomllib.loads(file.read_text(encoding="utf-8")) if file.exists() else None

    @cached_property
    def card(self):
        return None if self.card_text is None else Law.of_card(self.card_text)

    def other_card(self, name):
        """Return the law of a card that result.json names, relative to where it was typed."""
        places = (self.base, *list(self.path.resolve().parents)[:3])
        there = (place / name for place in places if (place / name).exists())
        card = next(there, self.base / name)
        return Law.of_card(tomllib.loads(card.read_text(encoding="utf-8")))

    @cached_property
    def project_path(self):
        if self._project is not None:
            return Path(self._project)
        if self.provenance is not None:
            return Path(self.provenance["project"]["file"])
        named = (self.result or {}).get("project")
        if isinstance(named, str) and (self.base / named).exists():
            return self.base / named
        above = (self.base, *list(self.path.resolve().parents)[:3])
        near = (place / "project.toml" for place in above)
        return next((path for path in near if path.exists()), None)

    @cached_property
    def project(self):
        """The project file as TOML; {} where there is none."""
        if self.project_path is None or not self.project_path.exists():
            return {}
        return tomllib.loads(self.project_path.read_text(encoding="utf-8-sig"))

    def numbers(self, file, column):
        """Return a column of a CSV as floats (rows,), NaN where it holds no number."""
        return pd.to_numeric(self.tables[file][column], errors="coerce").to_numpy(float)

    def data(self, file):
        """Return a table of the folder with numbers where all cells of a column are numbers."""
        table = self.tables[file].copy()
        for name in table:
            numbers = pd.to_numeric(table[name], errors="coerce")
            if not ((table[name] != "") & numbers.isna()).any():
                table[name] = numbers
        return table
