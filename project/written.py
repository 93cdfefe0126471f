"""Writing of projects: the settings of a project file, and files of data that is in memory."""

import os
from collections.abc import Mapping, Sequence
from dataclasses import field
from pathlib import Path
from typing import Any

import tomli_w

from ..experiments.registry import kind_names
from ..light_dataclasses import dataclass
from ..materials.card import MaterialCard, write_card
from ..storage.reading import is_file
from .objects import Definition, path_from, plain

Settings = dict[str, Any]
HEAD = "# As it was run: what the project says, with the options of the command.\n"


def project_text(settings: Mapping[str, Any]) -> str:
    """Return the text of a project file (TOML) with these settings."""
    return HEAD + "\n" + tomli_w.dumps(settings)


@dataclass(frozen=True, eq=False)
class InMemory:
    """Arrays and cards of a project that was made from objects, which writing it puts into files.

    Attributes
    ----------
    definitions : mapping
        Tests as objects by name; those with arrays have files to write.
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
            Settings of the project, as `settings_of` returns them.
        folder : Path
            Folder below which `write_data` writes the files.
        relative_to : Path, optional
            Folder to which the paths in the settings are relative; by default they are full paths.
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
        """Return the section of a test with the names of the files of its arrays."""
        definition = self.definitions.get(section["name"])
        if definition is None or definition.measured is None:
            return section
        return {**definition.section_with_files(folder, relative_to), "name": section["name"]}

    def _with_file(
        self, section: Mapping[str, Any], folder: Path, relative_to: Path | None
    ) -> Mapping[str, Any]:
        """Return the section of a card with the name of its file."""
        name = str(section.get("name", ""))
        if name not in self.cards:
            return section
        file = _card_file(folder, [*self.cards].index(name) + 1)
        return {"name": name, "file": path_from(file, relative_to)}


def _card_file(folder: Path, number: int) -> Path:
    """Return the path of the file of a card in memory; cards are numbered from 1."""
    return folder / f"card-{number}.toml"


@dataclass(frozen=True, eq=False)
class Written:
    """The settings of a project file as it was written, in its own units.

    Attributes
    ----------
    text : str or None
        The text of the file; None if no file says it.
    common : mapping
        The tables [fabric] and [units].
    tests : mapping
        Section of each test by name, with the folder of its data. Defaults are left out, as keys
        that are compatible as defaults may exclude each other when they are written.
    complete : mapping
        Section of each test by name, with all defaults.
    cards : sequence
        The tables [[card]].
    in_memory : InMemory
        Arrays and cards that no file holds, of a project made from objects.
    """

    text: str | None
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
        The section of the test in the project file.
    name : str
        Name of the test.
    folder_key : str or None
        Dotted key of the data folder in the section; None if the kind of test has none.
    base : Path
        The project's folder.
    folder : Path or None
        Data folder that the command gives in place of the section's.
    """
    section = {**plain(keys), "name": name}
    if folder_key is None:
        return section
    *parents, key = folder_key.split(".")
    table: Any = section
    for part in parents:
        table = table.get(part)
        if not isinstance(table, dict):
            return section  # the test has no such table: its data come from elsewhere
    if folder is None:
        folder = base / os.path.expanduser(table.get(key, ""))
    data = table[key] = os.path.abspath(folder)
    return {key: _found_beside(base, data, value) for key, value in section.items()}


def _found_beside(base: Path, data: str, value: Any) -> Any:
    """Return a value with full paths of files that lie beside the project, not in `data`."""
    if isinstance(value, dict):
        return {key: _found_beside(base, data, element) for key, element in value.items()}
    if isinstance(value, list):
        return [_found_beside(base, data, element) for element in value]
    if isinstance(value, str) and Path(value).suffix and not os.path.exists(Path(data, value)):
        return os.path.abspath(base / value) if is_file(base / value) else value
    return value
