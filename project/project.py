"""Projects: one fabric, its tests, its law and the settings of its fit, from file or objects."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import asdict, field, replace
from pathlib import Path
from typing import Any

import numpy as np
import tomli_w
from pydantic import ValidationError

from ..arguments import checked_arguments
from ..errors import InputError, Problems, check_one_of
from ..experiments.base import Test
from ..experiments.own import OwnTest
from ..experiments.registry import kind_named, kind_names, kinds
from ..experiments.sections import Fabric, Place, Scales
from ..inference.methods import method_named, method_names
from ..light_dataclasses import dataclass
from ..materials.card import MaterialCard, read_card, read_parameters
from ..materials.forms.base import LawForm, form_settings
from ..materials.forms.spline import Form
from ..materials.forms.without_law import NoLaw
from ..materials.law import HypoelasticLaw
from ..readers.sections import (
    LENGTH_UNITS,
    MODULUS_UNITS,
    PRESSURE_UNITS,
    first_error,
    in_base_units,
    path_beside,
)
from ..solvers.registry import overridden, settings_section, solver_settings
from ..solvers.run_cache import RunCache, run_cache
from ..solvers.settings import SCHEDULER
from ..storage.reading import is_file, missing_file_reason, read_bytes
from ..storage.writing import write_text
from .objects import PYTHON, Definition, Law, definition_of, plain
from .schema import (
    FITTED_CARD,
    PARAMETERS,
    Cards,
    CardSection,
    FitSection,
    LawSection,
    NamedCard,
    ProjectFile,
    read_cards,
    read_content,
    usual_folder,
    validated,
)
from .sections import Folders, InMemory, ReadTest, Settings, TestsOfFile, Written, project_text

#: Units of all numbers in a project that is made from objects.
UNITS = {"modulus": "MPa", "pressure": "MPa", "length": "mm"}


def settings_of(
    project: Project, tests: Sequence[str], cards: Sequence[str | Path] | None = None
) -> Settings:
    """Return the contents of a project file that repeats a run of these tests with its options.

    Data in memory have no files in it yet; `InMemory.with_files` adds their names.

    Parameters
    ----------
    project : Project
    tests : sequence of str
        Names of the tests.
    cards : sequence of str or Path, optional
        For a prediction: names of the project's cards and files of others; each has its own law.
    """
    written = project.written
    settings = {
        **written.common,
        "law": plain(project.law.model_dump()),
        "fit": _fit_in_full(project, project.fit.model_dump()),
    }
    if options := _solver_options(project, project.fit.solver):
        settings["solver"] = {project.fit.solver: options}
    for name in tests:
        if name in written.tests:  # the others were made from Python, beside the file
            settings.setdefault(project.tests[name].kind, []).append(written.tests[name])
    if cards is not None:
        del settings["law"]
        tables = dict(zip(project.cards, _cards(project), strict=True))
        settings["card"] = [
            tables.get(str(card), {"file": os.path.abspath(card)}) for card in cards
        ]
    return settings


def _fit_in_full(project: Project, fit: Mapping[str, Any]) -> Settings:
    """Return the table [fit], the folder of its cache as a full path."""
    settings: Settings = plain(fit)
    cache = fit.get("cache")
    if isinstance(cache, str):
        settings["cache"] = os.path.abspath(path_beside(project.path.parent, cache))
    return settings


def _cards(project: Project) -> list[Settings]:
    """Return each table [[card]], its file as a full path; a card in memory has its name only."""
    base = project.path.parent
    cards = [{"name": name} for name in project.written.in_memory.cards]
    for section in project.written.cards:
        card = dict(section)
        if "file" in card:
            card["file"] = os.path.abspath(base / card["file"])
        cards.append(card)
    return cards


def _solver_options(project: Project, solver: str) -> Settings:
    """Return the options of a solver that a project file may have, with full paths."""
    section = settings_section(solver)
    options = _in_full(plain(project.solver_options.get(solver, {})))
    return {k: v for k, v in options.items() if section is None or k in section.model_fields}


def _in_full(value: Any) -> Any:
    """Return a value with the paths of existing files in it as full paths."""
    if isinstance(value, dict):
        return {key: _in_full(element) for key, element in value.items()}
    if isinstance(value, str) and os.sep in value and os.path.exists(value):
        return os.path.abspath(value)
    return value


@dataclass(frozen=True, eq=False, kw_only=True)
class Project:
    """A complete project, read from a file or made from objects.

    Numbers are in mm, N and MPa, except in `law` and `fit`, which have the units of the file.

    Attributes
    ----------
    path : Path
        The project file; "python" for a project that is made from objects.
    fabric : Fabric
    scales : Scales
        Units of the file.
    tests : mapping
        By name, in the file's order.
    law, fit : LawSection, FitSection
        In the units of `scales`.
    cards : mapping
        By name, in the file's order.
    solver_options : mapping
        Options of solvers, by the name of the solver.
    written : Written
        The settings as the file has them.
    scheduler : str or None
        Address of the Dask scheduler whose workers do the runs.
    form : Form, LawForm or None
        A user's own form (`bf.Form`), or a form of the package with its settings (`LawForm`), given
        as an object in place of its name.
    objectives : mapping
        Functions of the user's in place of the objectives of tests, by name of the test.

    Raises
    ------
    InputError
        Settings contradict each other.
    """

    path: Path
    fabric: Fabric
    scales: Scales
    tests: Mapping[str, Test]
    law: LawSection
    fit: FitSection
    cards: Mapping[str, NamedCard]
    solver_options: Mapping[str, Mapping[str, Any]]
    written: Written
    scheduler: str | None = None
    form: Form | LawForm | None = None
    objectives: Mapping[str, Callable[..., Any]] = field(default_factory=dict)

    def __post_init__(self) -> None:
        name = self.fit.method
        check_one_of(name, method_names(), "fit.method", self.path)
        if self.fit.constraints == "boolean" and not method_named(name).boolean:
            methods = [repr(method) for method in method_names() if method_named(method).boolean]
            problem = f"boolean flags have no slope: use 'margin' with method {name!r}, or "
            raise InputError(self.path, "fit.constraints", problem + " or ".join(methods))

    @classmethod
    def of(
        cls,
        tests: Definition | OwnTest | Sequence[Definition | OwnTest],
        law: Law | None = None,
        *,
        fabric: Fabric,
        cards: Mapping[str, MaterialCard] | Sequence[Mapping[str, Any]] = (),
        solver_options: Mapping[str, Mapping[str, Any]] | None = None,
        folder: Path | str | None = None,
        need_data: bool = True,
        **fit: Any,
    ) -> Project:
        """Make a project from objects, with numbers in mm, N and MPa.

        Parameters
        ----------
        tests : object, or sequence of objects
            `Bubble`, `Strips`, `Biaxial`, `Cylinder`, or tests of one's own (`OwnTest`).
        law : Law, optional
        fabric : Fabric
        cards : mapping or sequence
            Material cards by name, or the contents of tables [[card]].
        solver_options : mapping, optional
            Options by name of a solver.
        folder : path, optional
            Folder to which arrays are written as files, below `data`; none are written otherwise.
        need_data : bool
            Whether measured data must exist; forward analyses do not need them.
        **fit
            Keys of [fit].

        Raises
        ------
        InputError
            Names the argument that is wrong.
        OutputError
            A file cannot be written to the folder.
        """
        objects = [tests] if isinstance(tests, (Definition, OwnTest)) else list(tests)
        for test in objects:
            if not isinstance(test, (Definition, OwnTest)):
                problem = f"expected bf.Bubble, bf.Strips ..., got {type(test).__name__}"
                raise InputError(None, "tests", problem)
        definitions = [test for test in objects if isinstance(test, Definition)]
        card_objects, card_tables = (cards, ()) if isinstance(cards, Mapping) else ({}, cards)
        sections = {
            "fabric": asdict(fabric),
            "units": UNITS,
            "law": law,
            "fit": fit,
            "solver": solver_options,
            "card": card_tables,
        }
        content = _content_of(sections, definitions)
        with naming_arguments():
            project = project_of(
                content, PYTHON, project_text(content), None, need_data, definitions, card_objects
            )
        for name, definition in project.definitions.items():
            if definition.function is not None:
                project = project.with_objective(name, definition.function)
        if law is not None and law.form_object is not None:
            project = project.with_form(law.form_object)
        if folder is not None:
            project.write_data(Path(folder) / "data")
        return project.with_tests(*(test for test in objects if isinstance(test, OwnTest)))

    def write_data(self, folder: Path) -> None:
        """Write arrays and cards in memory below a folder; raises OutputError."""
        self.written.in_memory.write_data(folder)

    @property
    def own_parts(self) -> list[str]:
        """Return the arguments whose values are Python objects that no file can describe."""
        form = [] if self.form is None else ["law.form"]
        tests = [f"test {n!r}" for n, test in self.tests.items() if isinstance(test, OwnTest)]
        return [*form, *(f"objective of {name!r}" for name in self.objectives), *tests]

    @property
    def definitions(self) -> dict[str, Definition]:
        """Return the tests as objects by name; tests from a file have the folder of their data."""
        objects = self.written.in_memory.definitions
        return {
            name: objects.get(name) or _definition(self.tests[name], section, self.scales)
            for name, section in self.written.tests.items()
        }

    @property
    def objects(self) -> dict[str, Any]:
        """Return the keyword arguments with which `Project.of` makes the same project."""
        law = plain(self.law.model_dump(exclude_unset=True))
        fit = _fit_in_full(self, self.fit.model_dump(exclude_unset=True))
        law_object = Law.of(in_base_units(LawSection, law, self.scales))
        law_object.form_object = self.form
        tests: list[Definition | OwnTest] = []
        for name, definition in self.definitions.items():
            if name in self.objectives:
                definition = definition.with_keys(objective=self.objectives[name])
            tests.append(definition)
        tests += [test for test in self.tests.values() if isinstance(test, OwnTest)]
        cards: Any = [in_base_units(CardSection, card, self.scales) for card in _cards(self)]
        if self.written.in_memory.cards:
            cards = dict(self.written.in_memory.cards)
        return {
            "tests": tests,
            "law": law_object,
            "fabric": self.fabric,
            "cards": cards,
            "solver_options": {name: _solver_options(self, name) for name in self.solver_options},
            **in_base_units(FitSection, fit, self.scales),
        }

    def to_toml(self, path: Path | str) -> Path:
        """Write the project file, and its arrays below a folder beside it; return its path.

        `read_project` reads the same project from it. Files of the tests stay where they are.

        Parameters
        ----------
        path : path
            Of the project file.

        Raises
        ------
        InputError
            A part is a Python object that no file can describe.
        OutputError
        """
        path = Path(path)
        if self.own_parts:
            problem = "is an object of Python: no project file can say it"
            raise InputError(None, self.own_parts[0], problem)
        settings = settings_of(self, list(self.tests))
        options = {name: _solver_options(self, name) for name in self.solver_options}
        used_options = {name: table for name, table in options.items() if table}
        if used_options:
            settings["solver"] = used_options
        if self.cards:
            settings["card"] = _cards(self)
        data = path.parent / f"{path.stem}-data"
        self.written.in_memory.write_data(data)
        settings = self.written.in_memory.with_files(settings, data, path.parent)
        write_text(path, tomli_w.dumps(settings))
        return path

    @property
    def title(self) -> str:
        """Return the title: the fabric's name, or else that of the project's folder."""
        return self.fabric.name or self.path.parent.resolve().name

    @property
    def has_law(self) -> bool:
        """Return whether a law is sought or run, not parameters of decks alone."""
        return self.form is not None or self.law.form != NoLaw.name

    @property
    def run_cache(self) -> RunCache | None:
        """Return the cache of runs of other programs, shared by projects; None if it is off."""
        cache = self.fit.cache
        return run_cache(path_beside(self.path.parent, cache) if isinstance(cache, str) else cache)

    def options_of(self, solver: str) -> dict[str, Any]:
        """Return the options of a solver, with the scheduler, if any, that counts its licences."""
        counted = {} if self.scheduler is None else {SCHEDULER: self.scheduler}
        return {**self.solver_options.get(solver, {}), **counted}

    def with_scheduler(self, address: str | None) -> Project:
        """Return the project with the address of a Dask scheduler; None leaves it unchanged."""
        return self if address is None else replace(self, scheduler=address)

    def with_fit(self, **changes: Any) -> Project:
        """Return the project with other settings of its fit.

        Parameters
        ----------
        **changes
            Keys of [fit]; None leaves a setting as it is.

        Raises
        ------
        InputError
            Names the setting that is not possible.
        """
        settings = {key: value for key, value in changes.items() if value is not None}
        try:
            valid = FitSection.model_validate(settings, strict=False)
        except ValidationError as errors:
            raise first_error(None, errors, FitSection) from None
        update = {key: value for key, value in valid if key in settings}
        return replace(self, fit=self.fit.model_copy(update=update))

    def with_weights(self, weights: Mapping[str, float]) -> Project:
        """Return the project with other weights of tests.

        Parameters
        ----------
        weights : mapping
            By name or kind of test.

        Raises
        ------
        InputError
            There is no such test.
        """
        tests: dict[str, Any] = dict(self.tests)
        names = {*tests, *(test.kind for test in tests.values())}
        for key in weights:
            if key not in names:
                problem = f"there is no such test; the project has: {', '.join(tests)}"
                raise InputError(None, f"weights.{key}", problem)
        by_name = {}
        for name, test in self.tests.items():
            weight = weights.get(name, weights.get(test.kind))
            if weight is None:
                continue
            by_name[name] = weight
            if isinstance(test, OwnTest):
                tests[name] = test.changed(weight=weight)
            else:
                tests[name] = replace(tests[name], weight=float(weight))
        written = self.written
        objects = {
            name: test.with_keys(weight=by_name[name]) if name in by_name else test
            for name, test in written.in_memory.definitions.items()
        }
        written = replace(
            written,
            tests=_with_weights(written.tests, by_name),
            complete=_with_weights(written.complete, by_name),
            in_memory=replace(written.in_memory, definitions=objects),
        )
        return replace(self, tests=tests, written=written)

    def with_law(self, form: str, settings: Mapping[str, Any] | None = None) -> Project:
        """Return the project with another form of the moduli.

        Parameters
        ----------
        form : str
            Name of the form.
        settings : mapping, optional
            Settings of the form. Those of the project that the form also has are kept.
        """
        settings_of_form = self.law.model_extra or {}
        law = self.law.model_dump(exclude=set(settings_of_form), exclude_unset=True)
        names = form_settings(form)
        law |= {key: value for key, value in settings_of_form.items() if key in names}
        law |= {**(settings or {}), "form": form}
        return replace(self, law=LawSection.model_validate(law), form=None)

    def with_form(self, form_or_class: Any) -> Project:
        """Return the project with a form of the moduli given as a class or object of `Form`."""
        form = form_or_class() if isinstance(form_or_class, type) else form_or_class
        if not isinstance(form, (Form, LawForm)):
            problem = "expected a subclass of bubblefit.Form, or an object of one, got "
            raise InputError(None, "form", problem + repr(form_or_class))
        return replace(self.with_law(type(form).__name__), form=form)

    def with_tests(self, *tests: OwnTest) -> Project:
        """Return the project with tests of one's own beside its others; InputError."""
        tests_by_name = {**self.tests}
        for test in tests:
            if not isinstance(test, OwnTest) or test.name in tests_by_name:
                problem = "expected an object of a subclass of bubblefit.OwnTest, and a new name"
                raise InputError(None, "tests", f"{problem}, got {test!r}")
            tests_by_name[test.name] = test.changed(thickness=self.fabric.thickness)
        return replace(self, tests=tests_by_name)

    def with_objective(self, test: str, function: Callable[..., Any]) -> Project:
        """Return the project with a function as the objective of a test (`FunctionObjective`)."""
        if test not in self.tests or not callable(function):
            problem = f"expected a function of one of {', '.join(self.tests)}, got {function!r}"
            raise InputError(None, "objective", f"{problem} of {test!r}")
        return replace(self, objectives={**self.objectives, test: function})

    def with_solver(
        self, name: str | None, options: Mapping[str, Any], settings: Sequence[str] = ()
    ) -> Project:
        """Return the project with another solver, or with more options for the one that it has.

        Parameters
        ----------
        name : str or None
            Name of the solver; None keeps the project's.
        options : mapping
            Options by their names on the command line; None leaves an option as it is.
        settings : sequence of str
            Further settings of the solver, each "KEY=VALUE".

        Raises
        ------
        InputError
            The solver does not know the option or setting.
        """
        solver = name or self.fit.solver
        changed = overridden(solver, self.solver_options.get(solver, {}), options, settings)
        chosen = replace(self, solver_options={**self.solver_options, solver: changed})
        return chosen.with_fit(solver=name)

    def chosen(
        self, names: str | Sequence[str] | None, fitted: bool | None = None
    ) -> tuple[Test, ...]:
        """Return the chosen tests in the project's order.

        Parameters
        ----------
        names : str, or sequence of str, or None
            Names of tests or of kinds of test; None for all tests.
        fitted : bool, optional
            True for tests that can be fitted only, False for those that are predicted only.

        Raises
        ------
        InputError
            There is no such test.
        """
        listed = [names] if isinstance(names, str) else names
        if listed is not None:
            self._check_test_names(listed)
        tests = tuple(
            test
            for test in self.tests.values()
            if fitted in (None, kind_named(test.kind).fitted)
            and (listed is None or test.name in listed or test.kind in listed)
        )
        if not tests:
            raise self._no_test(listed, fitted)
        return tests

    def _check_test_names(self, names: Sequence[str]) -> None:
        """Raise InputError for a name that is neither a test's nor a kind's."""
        if not len(names):
            raise InputError(self.path, "tests", "names no test; leave it out to take all of them")
        for name in names:
            if name not in self.tests and name not in kind_names():
                problem = f"there is no test {name!r}; the project has: {', '.join(self.tests)}"
                raise InputError(self.path, "--test", problem)

    def _no_test(self, names: Sequence[str] | None, fitted: bool | None) -> InputError:
        """Return the error that the project has no test of the wanted sort."""
        purpose = {None: "", True: " to be fitted", False: " to be predicted"}[fitted]
        among = "" if names is None else f" among {', '.join(names)}"
        tables = [f"[[{k.name}]]" for k in kinds().values() if fitted in (None, k.fitted)]
        problem = f"the project has no test{purpose}{among}; add {' or '.join(tables)}"
        return InputError(self.path, "", problem)


@checked_arguments
def read_project(
    path: Path | str, data: Folders | str | None = None, need_data: bool = True
) -> Project:
    """Read a project file (TOML).

    Parameters
    ----------
    path : path
    data : path or mapping, optional
        Folder of the measured files, or one for each test by name, in place of those of the file.
    need_data : bool
        Whether the measured files must exist.

    Raises
    ------
    InputError
        In one line, the file and the dotted key.
    """
    problems = Problems()
    project = read_readable_tests(Path(path), data, problems, need_data)
    problems.raise_if_any()
    return project


def read_readable_tests(
    path: Path, data: Folders | str | None, problems: Problems, need_data: bool = True
) -> Project:
    """Read a project file as `read_project`, without the tests that cannot be read.

    Parameters
    ----------
    path, data, need_data
        As in `read_project`.
    problems : Problems
        Receives the errors of these tests.

    Raises
    ------
    InputError
        Of the other sections.
    """
    data = Path(data) if isinstance(data, str) else data
    content = read_content(path)
    text = read_bytes(path).decode("utf-8-sig")
    return project_of(content, path, text, data, need_data, problems=problems)


def project_of(
    content: Mapping[str, Any],
    path: Path,
    text: str | None = None,
    data: Folders | None = None,
    need_data: bool = True,
    definitions: Sequence[Definition] = (),
    card_objects: Mapping[str, MaterialCard] | None = None,
    problems: Problems | None = None,
) -> Project:
    """Return the project of the content of a file, or of the same content made from objects.

    Parameters
    ----------
    content : mapping
        Tables and keys of a project file.
    path : Path
        The project file, or what stands for it in messages.
    text : str, optional
        Text of the project file; None if no file says the content.
    data, need_data
        As in `read_project`.
    definitions, card_objects
        Tests and cards as objects, which may hold what no file says.
    problems : Problems, optional
        Receives the errors of tests, which are raised otherwise.

    Raises
    ------
    InputError
    """
    file = validated(content, path)
    place = _place_of(file, path, need_data)
    tests_of_file = TestsOfFile(file, place, data, definitions, problems or Problems())
    tests = tests_of_file.read()
    if problems is None:
        tests_of_file.problems.raise_if_any()
    cards = read_cards(place, file.card)
    for name, card_object in (card_objects or {}).items():
        cards[name] = NamedCard(replace(card_object, name=name))
    return Project(
        path=path,
        fabric=place.fabric,
        scales=place.scales,
        tests={name: test.test for name, test in tests.items()},
        law=file.law,
        fit=file.fit,
        cards=cards,
        solver_options=solver_settings(path, file.solver),
        written=_written(file, text, tests, card_objects or {}),
    )


def _place_of(file: ProjectFile, path: Path, need_data: bool) -> Place:
    """Return path, fabric and units of a project file, whose units are plausible; InputError."""
    units = file.units
    length = LENGTH_UNITS[units.length]
    names = (units.modulus, units.pressure, units.length)
    section = file.fabric
    thickness = section.thickness * length
    fabric = Fabric(section.name, thickness, section.thickness_change, section.lab)
    scales = Scales(MODULUS_UNITS[units.modulus], PRESSURE_UNITS[units.pressure], length, *names)
    place = Place(path, "", fabric, scales, None, need_data)
    replace(place, at="fabric").check_units(section)
    for number, card in enumerate(file.card):
        replace(place, at=f"card[{number}]").check_units(card)
    return place


def _written(
    file: ProjectFile,
    text: str | None,
    tests: Mapping[str, ReadTest],
    card_objects: Mapping[str, MaterialCard],
) -> Written:
    """Return the settings of a project file as it was written."""
    definitions = {name: t.definition for name, t in tests.items() if t.definition is not None}
    return Written(
        text=text,
        common={"fabric": file.fabric.model_dump(), "units": file.units.model_dump()},
        tests={name: test.as_run for name, test in tests.items()},
        complete={name: test.section.model_dump(exclude_none=True) for name, test in tests.items()},
        cards=[card.model_dump(exclude_none=True) for card in file.card],
        in_memory=InMemory(definitions, card_objects),
    )


def _content_of(sections: Mapping[str, Any], definitions: Sequence[Definition]) -> dict[str, Any]:
    """Return the content of a project file with these sections and tests, as plain values."""
    content: dict[str, Any] = plain(sections)
    for definition in definitions:
        content.setdefault(definition.kind, []).append(definition.section)
    return content


@contextmanager
def naming_arguments() -> Iterator[None]:
    """Turn errors of a project made from objects into ones that name the argument, not a file."""
    try:
        yield
    except InputError as error:
        if error.path != PYTHON:
            raise
        raise InputError(None, error.field.removeprefix("fit."), error.problem) from None


def _with_weights(
    sections: Mapping[str, Settings], weights: Mapping[str, float]
) -> dict[str, Settings]:
    """Return the sections of tests, by name, with other weights."""
    return {
        name: {**section, "weight": weights[name]} if name in weights else section
        for name, section in sections.items()
    }


def _definition(test: Test, section: Settings, scales: Scales) -> Definition:
    """Return a test of a file as an object, its numbers in mm, N and MPa."""
    kind = kind_named(test.kind)
    section = kind.with_units(section, scales)
    return definition_of(test.kind, in_base_units(kind.section, section, scales))


def fitted_card(project: Project) -> Path:
    """Return the path of the card that the project's fit writes, or of its parameters alone."""
    return usual_folder(project.path) / (FITTED_CARD if project.has_law else PARAMETERS)


def card_sources(project: Project, cards: Cards = None) -> list[str | Path] | None:
    """Return names and files of the cards of `chosen_cards`; None if they are Python objects."""
    if isinstance(cards, Mapping):
        return None
    sources = cards or list(project.cards) or [fitted_card(project)]
    names = [name for name in project.cards if name in map(str, sources)]
    return [*names, *(card for card in sources if str(card) not in project.cards)]


def chosen_cards(project: Project, cards: Cards = None) -> dict[str, MaterialCard]:
    """Return the chosen material cards by name.

    Parameters
    ----------
    project : Project
    cards : mapping or sequence, optional
        Cards by name; or names of the project's cards and files of others. By default all cards of
        the project, or else the one that its fit wrote. Without a law files of parameters take
        their place, by default the start values of the decks.

    Raises
    ------
    InputError
        There is no such card.
    """
    if isinstance(cards, Mapping):
        return dict(cards)
    if not cards and not project.has_law:
        return {"start": _card_without_law(project, {})}
    sources = card_sources(project, cards) or []
    files = [Path(source) for source in sources if str(source) not in project.cards]
    for path in files:
        if path.is_dir():
            raise InputError(project.path, "--card", missing_file_reason(path))
        if not is_file(path):
            problem = f"there is no card (and no file) {str(path)!r}; the project has: "
            problem += f"{', '.join(project.cards) or 'none'}; fit first (bubblefit fit), name a "
            raise InputError(project.path, "--card", problem + "card's file, or add [[card]]")
    if not project.has_law:
        return {str(path): _card_without_law(project, read_parameters(path)) for path in files}
    cards_of_project = {n: named.card for n, named in project.cards.items() if n in sources}
    return named_cards(files, cards_of_project)


def _card_without_law(project: Project, parameters: Mapping[str, float]) -> MaterialCard:
    """Return the card that has only parameters of decks, as a fit without a law finds."""
    law = HypoelasticLaw(np.zeros(0), form=NoLaw())
    return MaterialCard(law, project.fabric.thickness, parameters=parameters)


def named_cards(
    files: Sequence[Path], project_cards: Mapping[str, MaterialCard]
) -> dict[str, MaterialCard]:
    """Read cards from files, and return them by name together with the project's cards.

    Parameters
    ----------
    files : sequence of Path
        Files of cards. A card whose name is taken already is named by its path.
    project_cards : mapping

    Raises
    ------
    InputError
        A file is given twice, or is no card.
    """
    named = dict(project_cards)
    for path in files:
        if files.count(path) > 1:
            raise InputError(path, "--card", "is given twice")
        card = read_card(path)
        if path.with_name(PARAMETERS).is_file():
            card = replace(card, parameters=read_parameters(path.with_name(PARAMETERS)))
        name = card.name or path.stem
        named[f"{name} ({path})" if name in named else name] = card
    return named
