"""Read a project: one fabric, its tests, its law, and how it is fitted, from a TOML file."""

from __future__ import annotations

import os
from collections.abc import Callable, Mapping, Sequence
from contextlib import AbstractContextManager
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path
from typing import Any

import tomli_w
from pydantic import ValidationError

from ..arguments import checked_arguments
from ..errors import InputError, check_one_of
from ..experiments.base import Test, with_defaults
from ..experiments.fabric import Fabric
from ..experiments.own import OwnTest
from ..experiments.registry import kind_named, kind_names, kinds
from ..experiments.sections import Place, Scales
from ..inference.methods import method_named, method_names
from ..materials.card import MaterialCard, read_card
from ..materials.forms.base import Form, form_settings
from ..materials.forms.spline import Form as OwnForm
from ..readers.sections import (
    LENGTH_UNITS,
    MODULUS_UNITS,
    PRESSURE_UNITS,
    first_error,
    in_base_units,
    path_beside,
)
from ..solvers.registry import overridden, solver_sections, solver_settings
from ..solvers.run_cache import RunCache, run_cache
from ..solvers.settings import SCHEDULER
from ..storage.reading import is_file, missing_file_reason, read_bytes
from ..storage.writing import write_text
from .objects import (
    PYTHON,
    Definition,
    Law,
    arguments_named,
    definition_of,
    plain,
    scratch_folder,
)
from .schema import (
    FITTED,
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

Settings = dict[str, Any]
#: Data folders: of all tests, or by the name of a test.
Folders = Path | Mapping[str, Path]
NO_FILES = "is computed (known_solution) and reads no files; leave --data out"
#: Of every number of an object.
UNITS = {"modulus": "MPa", "pressure": "MPa", "length": "mm"}
HEAD = "# As it was run: what the project says, with the options of the command.\n"


@dataclass(frozen=True, eq=False)
class Written:
    """The words of a project file, in its own units.
    common : [fabric] and [units]. tests : the section of each test by its name, with the folder of
    its data, without defaults (which need not go with each other when they are said). whole : each
    with its defaults. cards : each [[card]]. made : the objects that
    the tests are of, by name, with arrays and cards in files below `held`; none of a file."""

    text: str
    common: Mapping[str, Any]
    tests: Mapping[str, Settings]
    whole: Mapping[str, Settings]
    cards: Sequence[Settings] = ()
    made: Mapping[str, Definition] = field(default_factory=dict)
    held: Path | None = None


def section_as_run(
    said: Mapping[str, Any], name: str, folder_key: str | None, base: Path, folder: Path | None
) -> Settings:
    """Return a test's section with its name, and with the folder of its files in full.
    folder_key : dotted, None where the kind has none. base : the project's folder. folder : what
    the command says instead of the section."""
    whole = {**plain(said), "name": name}
    if folder_key is None:
        return whole
    *above, key = folder_key.split(".")
    table: Any = whole
    for part in above:
        table = table.get(part)
        if not isinstance(table, dict):
            return whole  # its data are of another sort
    given = base / os.path.expanduser(table.get(key, "")) if folder is None else folder
    data = table[key] = os.path.abspath(given)

    def beside_project(value: Any) -> Any:
        """Return full paths of files that are not in the data's folder, but beside the project."""
        if isinstance(value, dict):
            return {key: beside_project(own) for key, own in value.items()}
        if isinstance(value, list):
            return [beside_project(own) for own in value]
        if isinstance(value, str) and Path(value).suffix and not os.path.exists(Path(data, value)):
            return os.path.abspath(base / value) if is_file(base / value) else value
        return value

    return {key: beside_project(own) for key, own in whole.items()}


def settings_of(
    project: Project, tests: Sequence[str], cards: Sequence[str | Path] | None = None
) -> Settings:
    """Return what a run of these tests is given, options included, as a project file.
    cards : names of the project's cards, and files, that predict; each says its own law."""
    written = project.written
    assert written is not None
    settings: Settings = {
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
        own = dict(zip(project.cards, _cards(project), strict=True))
        settings["card"] = [own.get(str(card), {"file": os.path.abspath(card)}) for card in cards]
    return settings


def _fit_in_full(project: Project, fit: Mapping[str, Any]) -> Settings:
    """Return [fit] with the folder that it names in full."""
    said = fit.get("cache")
    whole = plain(fit)
    if isinstance(said, str):
        whole["cache"] = os.path.abspath(path_beside(project.path.parent, said))
    return whole


def _cards(project: Project) -> list[Settings]:
    """Return each [[card]], its file in full."""
    assert project.written is not None
    here = project.path.parent
    return [
        {**said, "file": os.path.abspath(here / said["file"])} if "file" in said else dict(said)
        for said in project.written.cards
    ]


def project_text(settings: Mapping[str, Any]) -> str:
    """Return settings as a project file (TOML)."""
    return HEAD + "\n" + tomli_w.dumps(settings)


def _solver_options(project: Project, solver: str) -> Settings:
    """Return the options that the table of a solver may hold, paths in full."""
    section = solver_sections().get(solver)
    options = _in_full(plain(project.solver_options.get(solver, {})))
    return {k: v for k, v in options.items() if section is None or k in section.model_fields}


def _in_full(value: Any) -> Any:
    if isinstance(value, dict):
        return {key: _in_full(own) for key, own in value.items()}
    if isinstance(value, str) and os.sep in value and os.path.exists(value):
        return os.path.abspath(value)
    return value


@dataclass(frozen=True, eq=False, kw_only=True)
class Project:
    """A whole project file, in mm, N and MPa where it is not a section.

    tests, cards : in the file's order. law, fit : the sections, in the units of `scales`.
    solver_options : by name of a solver. written : None without a file. scheduler : address of the
    Dask scheduler whose workers do the runs. form, objectives : objects instead of [law] form and,
    by name, of the objective of a test. InputError: settings that contradict each other.
    """

    path: Path
    fabric: Fabric
    scales: Scales
    tests: Mapping[str, Test]
    law: LawSection
    fit: FitSection
    cards: Mapping[str, NamedCard]
    solver_options: Mapping[str, Mapping[str, Any]]
    written: Written | None = None
    scheduler: str | None = None
    form: OwnForm | Form | None = None
    objectives: Mapping[str, Callable[..., Any]] = field(default_factory=dict)

    def __post_init__(self) -> None:
        name = self.fit.method
        check_one_of(name, method_names(), "fit.method", self.path)
        if self.fit.constraints == "boolean" and not method_named(name).boolean:
            others = [repr(other) for other in method_names() if method_named(other).boolean]
            problem = f"boolean flags have no slope: use 'margin' with method {name!r}, or "
            raise InputError(self.path, "fit.constraints", problem + " or ".join(others))

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
        """Put a project together from objects, in mm, N and MPa.

        cards : by name, or what each [[card]] says. solver_options : by name of a solver. folder :
        in which arrays are kept as files, below data; a temporary one unless given. fit : keys of
        [fit]. InputError names the argument; OutputError.
        """
        given = [tests] if isinstance(tests, (Definition, OwnTest)) else list(tests)
        made = [own for own in given if isinstance(own, Definition)]
        needed = isinstance(cards, Mapping) or any(own.files for own in made)
        held = Path(folder) / "data" if folder is not None else scratch_folder() if needed else None
        content = plain(
            {
                "fabric": asdict(fabric),
                "units": UNITS,
                "law": law,
                "fit": fit,
                "solver": solver_options,
                "card": _card_tables(cards, held),
            }
        )
        for own in made:
            content.setdefault(own.kind, []).append(own.placed(held) if held else own.section)
        with arguments_named(made):
            project = _project(content, PYTHON, project_text(content), None, need_data, made)
        assert project.written is not None
        for name, one in project.written.made.items():
            if one.function is not None:
                project = project.with_objective(name, one.function)
        if law is not None and law.own_form is not None:
            project = project.with_form(law.own_form)
        project = project.with_tests(*(own for own in given if not isinstance(own, Definition)))
        return replace(project, written=replace(project.written, held=held))  # type: ignore[type-var]

    @property
    def own_parts(self) -> list[str]:
        """Return the parts that are objects of Python and that no file says, by argument."""
        form = [] if self.form is None else ["law.form"]
        tests = [f"test {n!r}" for n, test in self.tests.items() if isinstance(test, OwnTest)]
        return [*form, *(f"objective of {name!r}" for name in self.objectives), *tests]

    @property
    def definitions(self) -> dict[str, Definition]:
        """Return the tests as objects, by name; those of a file with the folder of their data."""
        if (written := self.written) is None:
            return {}
        return {
            name: written.made.get(name) or _definition(self.tests[name], said, self.scales)
            for name, said in written.tests.items()
            if name in self.tests
        }

    @property
    def objects(self) -> dict[str, Any]:
        """Return the arguments with which `Project.of` makes the same project."""
        law = plain(self.law.model_dump(exclude_unset=True))
        fit = _fit_in_full(self, self.fit.model_dump(exclude_unset=True))
        cards = [] if self.written is None else _cards(self)
        given = Law.of(in_base_units(LawSection, law, self.scales))
        given.own_form = self.form
        own = [test for test in self.tests.values() if isinstance(test, OwnTest)]
        return {
            "tests": [
                one.with_keys(objective=self.objectives[name]) if name in self.objectives else one
                for name, one in self.definitions.items()
            ]
            + own,
            "law": given,
            "fabric": self.fabric,
            "cards": [in_base_units(CardSection, card, self.scales) for card in cards],
            "solver_options": {name: _solver_options(self, name) for name in self.solver_options},
            **in_base_units(FitSection, fit, self.scales),
        }

    def to_toml(self, path: Path | str) -> Path:
        """Write the project file, and its arrays below a folder beside it; return its path.

        `read_project` reads the same project from it. Files of the tests stay where they are.
        InputError : a part that was made without a definition. OutputError.
        """
        path = Path(path)
        for name in self.own_parts:
            raise InputError(None, name, "is an object of Python: no project file can say it")
        for name in self.tests:
            if self.written is None or name not in self.written.tests:
                problem = "is of no file and no definition, and cannot be written"
                raise InputError(None, f"test {name!r}", problem)
        settings = settings_of(self, list(self.tests))
        made = self.definitions
        options = {name: _solver_options(self, name) for name in self.solver_options}
        more = {"solver": {name: own for name, own in options.items() if own}, "card": _cards(self)}
        settings.update({key: value for key, value in more.items() if value})
        held = None if self.written is None else self.written.held
        data = path.parent / f"{path.stem}-data"
        for card in settings.get("card", []):
            if held is not None and Path(file := card.get("file", "")).parent == held.absolute():
                write_text(data / Path(file).name, Path(file).read_text(encoding="utf-8"))
                card["file"] = f"{data.name}/{Path(file).name}"
        for kind in kind_names():
            for k, said in enumerate(settings.get(kind, [])):
                if (own := made[said["name"]]).files:
                    placed = own.placed(data, path.parent)
                    settings[kind][k] = {**placed, "name": said["name"]}
        write_text(path, tomli_w.dumps(settings))
        return path

    def naming_arguments(self) -> AbstractContextManager[None]:
        """Return the context in which errors name the arguments of objects."""
        return arguments_named([] if self.written is None else list(self.written.made.values()))

    @property
    def title(self) -> str:
        """Return the fabric's name, else that of the folder."""
        return self.fabric.name or self.path.parent.resolve().name

    @property
    def run_cache(self) -> RunCache | None:
        """Return where runs of another program are kept, for all projects; None: nowhere."""
        said = self.fit.cache
        return run_cache(path_beside(self.path.parent, said) if isinstance(said, str) else said)

    def options_of(self, solver: str) -> dict[str, Any]:
        """Return what a solver is made with; a cluster counts its licences."""
        counted = {} if self.scheduler is None else {SCHEDULER: self.scheduler}
        return {**self.solver_options.get(solver, {}), **counted}

    def with_scheduler(self, address: str | None) -> Project:
        """Return the project, run by the workers of a Dask scheduler if there is an address."""
        return self if address is None else replace(self, scheduler=address)

    def with_fit(self, **changes: Any) -> Project:
        """Return the project with other settings of its fit; None leaves a setting as it is.

        InputError : names the setting that is not possible.
        """
        given = {key: value for key, value in changes.items() if value is not None}
        try:
            valid = FitSection.model_validate(given, strict=False)
        except ValidationError as errors:
            raise first_error(None, errors, FitSection) from None
        return replace(self, fit=self.fit.model_copy(update={k: getattr(valid, k) for k in given}))

    def with_weights(self, weights: Mapping[str, float]) -> Project:
        """Return the project with other weights of tests, by their name or kind; InputError."""
        tests: dict[str, Any] = dict(self.tests)
        named = {*tests, *(test.kind for test in tests.values())}
        for key in weights:
            if key not in named:
                problem = f"there is no such test; the project has: {', '.join(tests)}"
                raise InputError(None, f"weights.{key}", problem)
        given = {
            n: w for n, t in tests.items() if (w := weights.get(n, weights.get(t.kind))) is not None
        }
        for name, w in given.items():
            own = tests[name]
            own_kind = isinstance(own, OwnTest)
            tests[name] = own.changed(weight=w) if own_kind else replace(own, weight=float(w))
        if (written := self.written) is not None:
            said, whole = (
                {n: {**own, "weight": given[n]} if n in given else own for n, own in each.items()}
                for each in (written.tests, written.whole)
            )
            made = {
                n: own.with_keys(weight=given[n]) if n in given else own
                for n, own in written.made.items()
            }
            written = replace(written, tests=said, whole=whole, made=made)
        return replace(self, tests=tests, written=written)

    def with_law(self, form: str, settings: Mapping[str, Any] | None = None) -> Project:
        """Return the project with another form of the moduli; its settings stay unless given."""
        known = form_settings(form)
        own = self.law.model_extra or {}
        said = self.law.model_dump(exclude=set(own), exclude_unset=True)
        kept = {key: value for key, value in own.items() if key in known}
        law = LawSection.model_validate({**said, **kept, **(settings or {}), "form": form})
        return replace(self, law=law, form=None)

    def with_form(self, given: Any) -> Project:
        """Return the project with the form of the moduli of a class or an object; InputError."""
        form = given() if isinstance(given, type) else given
        if not isinstance(form, (OwnForm, Form)):
            problem = "expected a subclass of bubblefit.Form, or an object of one, got "
            raise InputError(None, "form", problem + repr(given))
        return replace(self.with_law(type(form).__name__), form=form)

    def with_tests(self, *tests: OwnTest) -> Project:
        """Return the project with tests of one's own beside its others; InputError."""
        made = {**self.tests}
        for test in tests:
            if not isinstance(test, OwnTest) or test.name in made:
                problem = "expected an object of a subclass of bubblefit.OwnTest, and a new name"
                raise InputError(None, "tests", f"{problem}, got {test!r}")
            made[test.name] = test.changed(thickness=self.fabric.thickness)
        return replace(self, tests=made)

    def with_objective(self, test: str, function: Callable[..., Any]) -> Project:
        """Return the project that fits a test by a function (`FunctionObjective`)."""
        if test not in self.tests or not callable(function):
            problem = f"expected a function of one of {', '.join(self.tests)}, got {function!r}"
            raise InputError(None, "objective", f"{problem} of {test!r}")
        return replace(self, objectives={**self.objectives, test: function})

    def with_solver(
        self, name: str | None, options: Mapping[str, Any], settings: Sequence[str] = ()
    ) -> Project:
        """Return the project with another solver, or with more options for the one that it has.

        options : None leaves one as it is. settings : each "KEY=VALUE". InputError: unknown to it.
        """
        solver = name or self.fit.solver
        changed = overridden(solver, self.solver_options.get(solver, {}), options, settings)
        chosen = replace(self, solver_options={**self.solver_options, solver: changed})
        return chosen.with_fit(solver=name)

    def chosen(
        self, which: str | Sequence[str] | None, fitted: bool | None = None
    ) -> tuple[Test, ...]:
        """Return tests by name or by kind, in the project's order; all of them where none is named.

        fitted : only those that a fit can match, or only those that are predicted. InputError.
        """
        names = None if which is None else [which] if isinstance(which, str) else list(which)
        if names == []:
            raise InputError(self.path, "tests", "names no test; leave it out to take all of them")
        able = [t for t in self.tests.values() if fitted in (None, kind_named(t.kind).fitted)]
        for name in names or ():
            if name not in self.tests and name not in kind_names():
                problem = f"there is no test {name!r}; the project has: {', '.join(self.tests)}"
                raise InputError(self.path, "--test", problem)
        tests = tuple(t for t in able if names is None or t.name in names or t.kind in names)
        if not tests:
            kind = {None: "", True: " to be fitted", False: " to be predicted"}[fitted]
            of = "" if names is None else f" among {', '.join(names)}"
            able_kinds = [f"[[{k.name}]]" for k in kinds().values() if fitted in (None, k.fitted)]
            problem = f"the project has no test{kind}{of}; add {' or '.join(able_kinds)}"
            raise InputError(self.path, "", problem)
        return tests


@checked_arguments
def read_project(
    path: Path | str, data: Folders | str | None = None, need_data: bool = True
) -> Project:
    """Read a project file (TOML).

    data : folder of the measured files, or of each test by name, instead of the file's. need_data :
    they must be there. InputError: in one line, the file and the dotted key.
    """
    path = Path(path)
    data = Path(data) if isinstance(data, str) else data
    content = read_content(path)
    text = read_bytes(path).decode("utf-8-sig")
    return _project(content, path, text, data, need_data)


def _project(
    content: Mapping[str, Any],
    path: Path,
    text: str,
    data: Folders | None,
    need_data: bool,
    made: Sequence[Definition] = (),
) -> Project:
    """Return the project of a file's content, or of objects: one way for both."""
    file = validated(content, path)
    said = file.fabric
    units = file.units
    length = LENGTH_UNITS[units.length]
    names = (units.modulus, units.pressure, units.length)
    fabric = Fabric(said.name, said.thickness * length, said.thickness_change, said.lab)
    scales = Scales(MODULUS_UNITS[units.modulus], PRESSURE_UNITS[units.pressure], length, *names)
    place = Place(path, "", fabric, scales, None, need_data)
    replace(place, at="fabric").check_units(file.fabric)
    for number, card in enumerate(file.card):
        replace(place, at=f"card[{number}]").check_units(card)
    tests, written = _tests(file, place, text, data, made)
    return Project(
        path=path,
        fabric=fabric,
        scales=scales,
        tests=tests,
        law=file.law,
        fit=file.fit,
        cards=read_cards(place, file.card),
        solver_options=solver_settings(path, file.solver),
        written=written,
    )


def _definition(test: Test, said: Settings, scales: Scales) -> Definition:
    """Return a test of a file as an object, its numbers in mm, N and MPa."""
    own = kind_named(test.kind)
    said = own.with_units(said, scales)
    return definition_of(test.kind, in_base_units(own.section, said, scales))


def _card_tables(
    cards: Mapping[str, MaterialCard] | Sequence[Mapping[str, Any]], held: Path | None
) -> list[Mapping[str, Any]]:
    """Return [[card]] tables; those of objects are written below the folder `held`."""
    if not isinstance(cards, Mapping):
        return list(cards)
    said: list[Mapping[str, Any]] = []
    for k, (name, card) in enumerate(cards.items(), start=1):
        assert held is not None
        held.mkdir(parents=True, exist_ok=True)
        card.write(file := held / f"card-{k}.toml", unit="MPa")
        said.append({"name": name, "file": os.path.abspath(file)})
    return said


def _tests(
    file: ProjectFile,
    place: Place,
    text: str,
    data: Folders | None,
    made: Sequence[Definition],
) -> tuple[dict[str, Test], Written]:
    """Return the tests of a file by name, and the words of the file."""
    tests: dict[str, Test] = {}
    said = dict[str, Settings]()
    whole = dict[str, Settings]()
    objects: dict[str, Definition] = {}
    present = kinds([kind for kind in kind_names() if file.tests(kind)])
    names = [name for kind in present for name in _names(kind, file.tests(kind))]
    if isinstance(data, Mapping):
        for name in data:
            if name not in names:
                problem = f"there is no test {name!r}; the project has: {', '.join(names)}"
                raise InputError(place.path, "--data", problem)
    for name, kind in present.items():
        sections = file.tests(name)
        for i, (section, own) in enumerate(zip(sections, _names(name, sections), strict=True)):
            folder = data.get(own) if isinstance(data, Mapping) else data
            here = replace(place, at=f"{name}[{i}]", data_folder=folder)
            if own in tests:
                raise here.error("name", f"{own!r} is there twice; give one of them another name")
            here.check_units(section)
            tests[own] = with_defaults(kind.read(section, here, own))
            if isinstance(data, Mapping) and folder is not None and not tests[own].reads_files:
                raise here.error("data", NO_FILES)
            key = kind.folder_key or None
            keys = section.model_dump(exclude_unset=True)
            said[own] = section_as_run(keys, own, key, place.path.parent, folder)
            whole[own] = section.model_dump(exclude_none=True)
        given = [one for one in made if one.kind == name]
        objects |= dict(zip(_names(name, sections), given, strict=bool(made)))
    if isinstance(data, Path) and not any(test.reads_files for test in tests.values()):
        at = next((f"{kind}[0].data" for kind in present), "data")
        raise InputError(place.path, at, NO_FILES)
    common = {name: getattr(file, name).model_dump() for name in ("fabric", "units")}
    cards = [card.model_dump(exclude_none=True) for card in file.card]
    return tests, Written(text, common, said, whole, cards, objects)


def _names(kind: str, sections: Sequence[Any]) -> list[str]:
    """Return the names of tests: else their kind, with a number where there are several."""
    alone = len(sections) == 1
    return [s.name or (kind if alone else f"{kind} {i}") for i, s in enumerate(sections, start=1)]


def fitted_card(project: Project) -> Path:
    """Return the file of the card that the project's fit leaves in its usual folder."""
    return usual_folder(project.path) / FITTED


def card_sources(project: Project, cards: Cards = None) -> list[str | Path] | None:
    """Return names in the project and files of `chosen_cards`; None where Python gave them."""
    if isinstance(cards, Mapping):
        return None
    given = cards or list(project.cards) or [fitted_card(project)]
    named = [name for name in project.cards if name in map(str, given)]
    return [*named, *(card for card in given if str(card) not in project.cards)]


def chosen_cards(project: Project, cards: Cards = None) -> dict[str, MaterialCard]:
    """Return cards by name: those given, else the project's, else that of its fit; InputError."""
    if isinstance(cards, Mapping):
        return dict(cards)
    sources = card_sources(project, cards) or []
    files = [Path(one) for one in sources if str(one) not in project.cards]
    for path in files:
        if path.is_dir():
            raise InputError(project.path, "--card", missing_file_reason(path))
        if not is_file(path):
            problem = f"there is no card (and no file) {str(path)!r}; the project has: "
            problem += f"{', '.join(project.cards) or 'none'}; fit first (bubblefit fit), name a "
            raise InputError(project.path, "--card", problem + "card's file, or add [[card]]")
    own = {name: named.card for name, named in project.cards.items() if name in sources}
    return named_cards(files, own)


def named_cards(files: Sequence[Path], own: Mapping[str, MaterialCard]) -> dict[str, MaterialCard]:
    """Return cards, beside `own`, by their names or their files', the path where two agree."""
    named = dict(own)
    for path in files:
        if files.count(path) > 1:
            raise InputError(path, "--card", "is given twice")
        card = read_card(path)
        name = card.name or path.stem
        named[f"{name} ({path})" if name in named else name] = card
    return named
