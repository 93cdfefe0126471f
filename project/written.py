"""What a project file says, as plain values; files of what is in memory, where they are written."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import tomli_w

from ..experiments.registry import kind_names
from ..materials.card import MaterialCard, write_card
from ..storage.reading import is_file
from .objects import Definition, path_from, plain

Settings = dict[str, Any]
HEAD = "# As it was run: what the project says, with the options of the command.\n"


def project_text(settings: Mapping[str, Any]) -> str:
    """Return settings as a project file (TOML)."""
    return HEAD + "\n" + tomli_w.dumps(settings)


@dataclass(frozen=True, eq=False)
class InMemory:
    """Data of a project made from objects that are files once it is written.

    Attributes
    ----------
    definitions : mapping
        Tests by name, those with arrays among them.
    cards : mapping
        Material cards by name.
    """

    definitions: Mapping[str, Definition] = field(default_factory=dict)
    cards: Mapping[str, MaterialCard] = field(default_factory=dict)

    def write_data(self, folder: Path) -> dict[str, Path]:
        """Write arrays and cards below a folder; return the folders of the tests with arrays.

        Raises
        ------
        OutputError
            A file cannot be written.
        """
        for number, card in enumerate(self.cards.values(), start=1):
            write_card(card, _card_file(folder, number), unit="MPa")
        return {
            name: definition.write_data(folder)
            for name, definition in self.definitions.items()
            if definition.measured is not None
        }

    def with_files(
        self, settings: Mapping[str, Any], folder: Path, relative_to: Path | None = None
    ) -> Settings:
        """Return settings that name the files that `write_data` writes.

        Parameters
        ----------
        settings : mapping
            Of `settings_of`.
        folder : Path
            As of `write_data`.
        relative_to : Path, optional
            Folder from which the settings name them; by full paths otherwise.
        """
        named = dict(settings)
        for kind in kind_names():
            if kind in settings:
                named[kind] = [self._with_data(s, folder, relative_to) for s in settings[kind]]
        if "card" in settings:
            named["card"] = [self._with_file(s, folder, relative_to) for s in settings["card"]]
        return named

    def _with_data(
        self, section: Mapping[str, Any], folder: Path, relative_to: Path | None
    ) -> Mapping[str, Any]:
        """Return the section of a test that names the files of its arrays."""
        definition = self.definitions.get(section["name"])
        if definition is None or definition.measured is None:
            return section
        return {**definition.section_with_files(folder, relative_to), "name": section["name"]}

    def _with_file(
        self, section: Mapping[str, Any], folder: Path, relative_to: Path | None
    ) -> Mapping[str, Any]:
        """Return the section of a card that names its file."""
        name = str(section.get("name", ""))
        if name not in self.cards:
            return section
        file = _card_file(folder, [*self.cards].index(name) + 1)
        return {"name": name, "file": path_from(file, relative_to)}


def _card_file(folder: Path, number: int) -> Path:
    """Return the file of a card in memory, counted from 1."""
    return folder / f"card-{number}.toml"


@dataclass(frozen=True, eq=False)
class Written:
    """The words of a project file, in its own units.

    Attributes
    ----------
    text : str
        Of the file.
    common : mapping
        [fabric] and [units].
    tests : mapping
        Section of each test by name, with the folder of its data, without defaults: these need not
        go with each other once they are written.
    complete : mapping
        Section of each test with its defaults.
    cards : sequence
        Each [[card]].
    in_memory : InMemory
        Of a project made from objects.
    """

    text: str
    common: Mapping[str, Any]
    tests: Mapping[str, Settings]
    complete: Mapping[str, Settings]
    cards: Sequence[Settings] = ()
    in_memory: InMemory = field(default_factory=InMemory)


def section_as_run(
    keys: Mapping[str, Any], name: str, folder_key: str | None, base: Path, folder: Path | None
) -> Settings:
    """Return a test's section with its name, and with the folder of its files in full.

    Parameters
    ----------
    keys : mapping
        The section.
    name : str
    folder_key : str or None
        Dotted; None where the kind has none.
    base : Path
        The project's folder.
    folder : Path or None
        What the command says instead of the section.
    """
    section = {**plain(keys), "name": name}
    if folder_key is None:
        return section
    *parents, key = folder_key.split(".")
    table: Any = section
    for part in parents:
        table = table.get(part)
        if not isinstance(table, dict):
            return section  # its data are of another sort
    if folder is None:
        folder = base / os.path.expanduser(table.get(key, ""))
    data = table[key] = os.path.abspath(folder)
    return {key: _found_beside(base, data, value) for key, value in section.items()}


def _found_beside(base: Path, data: str, value: Any) -> Any:
    """Return full paths of files that are not in the data's folder, but beside the project."""
    if isinstance(value, dict):
        return {key: _found_beside(base, data, element) for key, element in value.items()}
    if isinstance(value, list):
        return [_found_beside(base, data, element) for element in value]
    if isinstance(value, str) and Path(value).suffix and not os.path.exists(Path(data, value)):
        return os.path.abspath(base / value) if is_file(base / value) else value
    return value
