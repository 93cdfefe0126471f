"""Reading of a project's tests, from the sections of its file or from objects alike."""

from collections.abc import Mapping, Sequence
from contextlib import nullcontext
from dataclasses import field, replace
from pathlib import Path
from typing import Any

from ..errors import InputError, Problems
from ..experiments.base import Kind, LedTest, Test, with_defaults
from ..experiments.registry import kind_names, kinds
from ..experiments.sections import ObjectPlace, Place
from ..light_dataclasses import dataclass
from .objects import Definition
from .schema import ProjectFile
from .written import Settings, section_as_run

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
                if name in tests:
                    problem = f"{name!r} is there twice; give one of them another name"
                    raise place.error("name", problem)
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
        keys = section.model_dump(exclude_unset=True)
        base = self.place.path.parent
        as_run = section_as_run(keys, name, None, base, folder)
        if definition is None or definition.measured is None:
            for folder_key in kind.folder_key.split():
                as_run = section_as_run(as_run, name, folder_key, base, folder)
        return ReadTest(test, section, as_run, definition)


def _names(kind: str, sections: Sequence[Any]) -> list[str]:
    """Return the names of tests: as given, or else the kind, numbered if there are several."""
    is_alone = len(sections) == 1
    return [
        s.name or (kind if is_alone else f"{kind} {i}") for i, s in enumerate(sections, start=1)
    ]
