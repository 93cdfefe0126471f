"""Sections of a project file: its tests are read from them, and settings are written to them.

A project that was made from objects has files for arrays and cards in memory, too.
"""

import os
from collections.abc import Iterable, Mapping, Sequence
from contextlib import nullcontext
from dataclasses import field, replace
from pathlib import Path
from typing import Any

import tomli_w

from ..errors import InputError, Problems
from ..experiments.base import Kind, LedTest, Test, with_defaults
from ..experiments.data_files import Output
from ..experiments.registry import kind_names, kinds
from ..experiments.sections import ObjectPlace, Place
from ..light_dataclasses import dataclass
from ..materials.card import MaterialCard, write_card
from ..storage.reading import is_file
from .objects import Definition, path_from, plain
from .schema import ProjectFile

Settings = dict[str, Any]


def project_text(settings: Mapping[str, Any]) -> str:
    """Return the text of a project file (TOML) with these settings."""
    head = "# As it was run: what the project says, with the options of the command.\n"
    return f"{head}\n{tomli_w.dumps(settings)}"


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


def with_full_folder(
    section: Settings, folder_key: str, base: Path, folder: Path | None
) -> Settings:
    """Return a test's section with the folder of its files in full.

    Parameters
    ----------
    section : mapping
        The section of the test as plain values.
    folder_key : str
        Dotted key of the data folder in the section.
    base : Path
        The project's folder.
    folder : Path or None
        Data folder that the command gives in place of the section's.
    """
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


#: Folder of the measured data: one for all tests, or one for each by the name of the test.
Folders = Path | Mapping[str, Path]
NO_FILES = "is computed (known_solution) and reads no files; leave --data out"


@dataclass(frozen=True, eq=False)
class ReadTest:
    """A test that was read.

    Attributes
    ----------
    test : Test
    section : section of the kind of test
        Its section of the project file, validated.
    as_run : Settings
        The same section as plain values, with all paths in full.
    definition : Definition or None
        The object that the test was given as; None if a file was read.
    """

    test: Test
    section: Any
    as_run: Settings
    definition: Definition | None = None


@dataclass(frozen=True, eq=False)
class TestsOfFile:
    """The tests of a project file.

    Attributes
    ----------
    file : ProjectFile
    place : Place
        The folder and the units in which the file is read.
    data : Path, mapping or None
        Folder of the measured data, or one for each test by name; None for those of the file.
    definitions : sequence of Definition
        The objects that the tests were given as, in order within each kind; empty for a file.
    problems : Problems
        Receives the errors of the tests that cannot be read, which are left out.
    """

    file: ProjectFile
    place: Place
    data: Folders | None
    definitions: Sequence[Definition]
    problems: Problems = field(default_factory=Problems)

    def read(self) -> dict[str, ReadTest]:
        """Read all tests; return them by name, in the file's order within each kind."""
        present = kinds([kind for kind in kind_names() if self.file.tests(kind)])
        self._check_data_names(present)
        tests: dict[str, ReadTest] = {}
        for kind in present.values():
            sections = self.file.tests(kind.name)
            for number, name in enumerate(_names(kind.name, sections)):
                place = self._place(kind.name, number, name)
                _check_name(name, tests, place)
                with self.problems.collected():
                    tests[name] = self._read_test(kind, sections[number], place, name, number)
        by_name = {name: read_test.test for name, read_test in tests.items()}
        for name, test in by_name.items():
            if isinstance(test, LedTest):
                with self.problems.collected():
                    tests[name] = replace(tests[name], test=test.led_by(by_name))
        read_tests = [read_test.test for read_test in tests.values()]
        if isinstance(self.data, Path) and tests and not any(t.reads_files for t in read_tests):
            key = next((f"{kind}[0].data" for kind in present), "data")
            raise InputError(self.place.path, key, NO_FILES)
        return tests

    def _check_data_names(self, present: Mapping[str, Kind]) -> None:
        """Raise InputError for a folder of data that is given for an unknown test."""
        names = [name for kind in present for name in _names(kind, self.file.tests(kind))]
        for name in self.data if isinstance(self.data, Mapping) else ():
            if name not in names:
                problem = f"there is no test {name!r}; the project has: {', '.join(names)}"
                raise InputError(self.place.path, "--data", problem)

    def _definition(self, kind: str, number: int) -> Definition | None:
        """Return the object that a test was given as; None if a file was read."""
        of_kind = [definition for definition in self.definitions if definition.kind == kind]
        return of_kind[number] if of_kind else None

    def _place(self, kind: str, number: int, name: str) -> Place:
        """Return the place (folder, units, key for errors) in which a test is read."""
        definition = self._definition(kind, number)
        if definition is not None:
            place = definition.place(self.place.fabric, self.place.need_data)
            return replace(place, at=name)
        folder = self.data.get(name) if isinstance(self.data, Mapping) else self.data
        return replace(self.place, at=f"{kind}[{number}]", data_folder=folder)

    def _read_test(
        self, kind: Kind, section: Any, place: Place, name: str, number: int
    ) -> ReadTest:
        """Read the test of a validated section."""
        place.check_units(section)
        with place.errors_name() if isinstance(place, ObjectPlace) else nullcontext():
            test = with_defaults(kind.read(section, place, name))
        folder = place.data_folder
        if isinstance(self.data, Mapping) and folder is not None and not test.reads_files:
            raise place.error("data", NO_FILES)
        definition = self._definition(kind.name, number)
        as_run = {**plain(section.model_dump(exclude_unset=True)), "name": name}
        if definition is None or definition.measured is None:
            for folder_key in kind.folder_key.split():
                as_run = with_full_folder(as_run, folder_key, self.place.path.parent, folder)
        return ReadTest(test, section, as_run, definition)


def _check_name(name: str, tests: Iterable[str], place: Place) -> None:
    """Refuse the name of a test that another has, or whose files would have the same names."""
    prefixes = {Output.of(Path(), test, several=True).prefix: test for test in tests}
    prefix = Output.of(Path(), name, several=True).prefix
    other = prefixes.get(prefix)
    if other == name:
        raise place.error("name", f"{name!r} is there twice; give one of them another name")
    if other is not None:
        problem = f"files of this test and of {other!r} would begin alike, {prefix!r}"
        raise place.error("name", f"{problem}; give it another name")


def _names(kind: str, sections: Sequence[Any]) -> list[str]:
    """Return the names of tests: as given, or else the kind, numbered if there are several."""
    is_alone = len(sections) == 1
    return [
        s.name or (kind if is_alone else f"{kind} {i}") for i, s in enumerate(sections, start=1)
    ]
