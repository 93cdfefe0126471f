"""Sections and schema of the project file, in the units of the file, and reading of its cards."""

import functools
import json
import re
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Annotated, Any, Literal, Self, cast

import numpy as np
from pydantic import (
    BaseModel,
    BeforeValidator,
    ConfigDict,
    Field,
    ValidationError,
    ValidationInfo,
    create_model,
    field_validator,
    model_validator,
)
from pydantic_core import PydanticCustomError

from ..errors import InputError
from ..experiments.registry import kind_named, kind_names, kinds
from ..experiments.sections import Place
from ..light_dataclasses import dataclass
from ..materials.card import MaterialCard, read_card
from ..materials.forms.base import UNLIMITED, form_named
from ..materials.forms.symmetry import Symmetry
from ..materials.law import HypoelasticLaw
from ..plugins import plug_in_named, plug_ins
from ..readers.sections import (
    Bounds,
    LengthUnit,
    Modulus,
    ModulusUnit,
    Name,
    Number,
    Positive,
    PositiveBounds,
    PressureUnit,
    Section,
    StrainTriple,
    Thickness,
    Unit,
    error_in_full,
    first_error,
)
from ..solvers.registry import solver_sections
from ..storage.reading import read_toml


def error_in_bounds(message: str) -> ValidationError:
    """Return an error of the key `bounds` below what a validator checks."""
    error = error_in_full(message)
    location = ("bounds",)
    return ValidationError.from_exception_data(
        "", [{"type": error, "loc": location, "input": None}]
    )


class FabricSection(Section):
    """[fabric]: the one fabric that all tests are of."""

    name: str = ""
    thickness: Thickness
    thickness_change: Literal["constant", "incompressible"] = "constant"
    lab: str = ""


class UnitsSection(Section):
    """[units]: the units of all numbers in the file."""

    modulus: ModulusUnit = "GPa"
    pressure: PressureUnit = "kPa"
    length: LengthUnit = "mm"


class BoundsSection(Section):
    """[law.bounds]: the least and the largest value of each modulus, or of each coefficient."""

    E1: PositiveBounds | None = None
    E2: PositiveBounds | None = None
    G12: PositiveBounds | None = None
    lower: list[Number] | None = None
    upper: list[Number] | None = None

    @property
    def of_moduli(self) -> dict[str, list[float] | None]:
        """Return [least, largest] of E1, E2 and G12; None for those that are not given."""
        return {"E1": self.E1, "E2": self.E2, "G12": self.G12}

    @property
    def of_coefficients(self) -> dict[str, list[float] | None]:
        """Return the lower and upper coefficients; None if they are not given."""
        return {"lower": self.lower, "upper": self.upper}

    @property
    def has_moduli(self) -> bool:
        """Return whether a modulus has bounds."""
        return any(bounds is not None for bounds in self.of_moduli.values())

    @model_validator(mode="after")
    def check_one_sort(self) -> Self:
        """Check that moduli or coefficients have bounds, not both."""
        has_coefficients = any(bounds is not None for bounds in self.of_coefficients.values())
        if self.has_moduli and has_coefficients:
            problem = "expected either 'lower' and 'upper' or E1, E2, G12, got some of both"
            raise error_in_full(problem)
        return self


class MarginSection(Section):
    """[law.margin]: the smallest moduli allowed where coefficients are bounded."""

    E: Positive
    G12: Positive


class RecalledSection(Section):
    """[law.memory.warp], fill or shear: unloading and reloading below the largest strain."""

    permanent_set: Annotated[float, Field(ge=0, lt=1)] = 0.0
    unloading: Annotated[float, Field(ge=1, lt=2)] = 1.0
    reloading: Annotated[float, Field(ge=1, lt=2)] = 1.0
    saturation: Annotated[float, Field(ge=0, le=1e6)] = 0.0


def _recalled(value: Any) -> Any:
    """Return the recalled constants of a section, checked: "fitted", or a table of numbers."""
    # Checked by hand, as the errors of a union would name its members and not the key.
    if isinstance(value, dict):
        return RecalledSection.model_validate(value)
    if value not in (None, "fitted") and not isinstance(value, RecalledSection):
        raise PydanticCustomError("fitted", "Input should be 'fitted' or a table of numbers")
    return value


Recalled = Annotated[RecalledSection | Literal["fitted"] | None, BeforeValidator(_recalled)]


class MemorySection(Section):
    """[law.memory]: for each strain the constants of its memory, "fitted", or none at all."""

    warp: Recalled = None
    fill: Recalled = None
    shear: Recalled = None

    @property
    def by_strain(self) -> dict[str, RecalledSection | Literal["fitted"] | None]:
        """Return the memory of each strain by name."""
        return {"warp": self.warp, "fill": self.fill, "shear": self.shear}


#: Poisson's ratio and form of a law that says none.
NU12 = 0.24
FORM = "cubic"


class LawSection(Section):
    """[law]: the form of the moduli, and their bounds.
    Keys beyond these belong to a form (knots, breaks); it checks them."""

    model_config = ConfigDict(extra="allow", strict=True, allow_inf_nan=False)
    __pydantic_extra__: dict[str, Any] = Field(init=False)

    form: Name = FORM
    symmetry: Symmetry = "orthotropic"
    nu12: Annotated[float, Field(ge=0, lt=1)] = NU12
    strain_range: StrainTriple | None = None
    bounds: Annotated[BoundsSection | None, Unit("modulus")] = None
    margin: Annotated[MarginSection | None, Unit("modulus")] = None
    closed_path: Positive | None = None
    memory: MemorySection | None = None

    @field_validator("margin", mode="after")
    @classmethod
    def check_margin(
        cls, margin: MarginSection | None, info: ValidationInfo
    ) -> MarginSection | None:
        """Check that there is no margin beside bounds of the moduli."""
        bounds: BoundsSection | None = info.data.get("bounds")
        if margin is not None and bounds is not None and bounds.has_moduli:
            problem = "the lower bounds of E1, E2 and G12 are the margins; leave this out"
            raise error_in_full(problem)
        return margin


class UnknownSection(Section):
    """[fit.unknowns.NAME]: bounds of an unknown, and the standard deviation of its prior."""

    bounds: Bounds | None = None
    prior: Positive | None = None


class UnknownsSection(Section):
    """[fit.unknowns]: what is fitted beside the moduli, one value for all tests."""

    nu12: UnknownSection | None = None
    thickness: Annotated[UnknownSection | None, Unit("length")] = None

    @field_validator("nu12", mode="after")
    @classmethod
    def check_nu12(cls, section: UnknownSection | None) -> UnknownSection | None:
        """Check that every law within the bounds can be positive definite."""
        if section is not None and section.bounds is not None:
            low, high = section.bounds
            if low < 0 or high >= 1:
                problem = f"expected numbers from 0 to below 1, got [{low:g}, {high:g}]"
                raise error_in_bounds(problem)
        return section

    @field_validator("thickness", mode="after")
    @classmethod
    def check_thickness(cls, section: UnknownSection | None) -> UnknownSection | None:
        """Check that every thickness within the bounds is above 0."""
        if section is not None and section.bounds is not None and section.bounds[0] <= 0:
            problem = f"expected thicknesses above 0, got {section.bounds[0]:g}"
            raise error_in_bounds(problem)
        return section


class FitSection(Section):
    """[fit]: starts, method and solver of a fit."""

    starts: Annotated[int, Field(ge=1)] = 50
    seed: Annotated[int, Field(ge=0)] = 1
    starts_from: Literal["random", "sobol", "estimate"] = "random"
    method: Name = "lm"
    gradient: Literal["exact", "differences"] = "exact"
    constraints: Literal["margin", "boolean"] = "margin"
    solver: Name = "membrane"
    max_analyses: Annotated[int, Field(ge=1)] | None = None
    tolerance: Positive = 1e-7
    coarse_to_fine: bool | None = None
    jobs: Annotated[int, Field(ge=1, le=10000)] | None = None
    trust: list[Name] = Field(default=[])
    unknowns: UnknownsSection = UnknownsSection.model_construct()
    mesh_error: Literal["told", "taken out"] = "taken out"
    cache: bool | Name = True


#: Keys that a card's own file says.
OF_THE_FILE = ("beta", "form", "nu12", "thickness", "thickness_change", "strain_range")
#: Cards by name; or names in the project and files; none for the project's own.
Cards = Mapping[str, MaterialCard] | Sequence[str | Path] | None
#: Names of the files that a fit writes to its folder: the card, and parameters of decks.
FITTED_CARD = "material.toml"
PARAMETERS = "parameters.toml"


class CardSection(Section):
    """A card's file, or coefficients; keys beyond these (knots, breaks) belong to the form."""

    model_config = ConfigDict(extra="allow", strict=True, allow_inf_nan=False)
    __pydantic_extra__: dict[str, Any] = Field(init=False)

    name: Name | None = None
    file: str | None = None
    beta: list[Modulus] | None = None
    form: str | None = None
    nu12: Annotated[float, Field(ge=0, lt=1)] | None = None
    thickness: Thickness | None = None
    thickness_change: Literal["constant", "incompressible"] | None = None
    strain_range: StrainTriple | None = None
    test: str | None = None


#: Largest number of tables of one sort; a file with more of them was written by mistake.
MAX_TABLES = 1000
OLD = (
    "is of version 0.1, which had a file for each kind of test; `bubblefit docs changelog`, "
    '"From version 0.1", says how to write it now (or start from `bubblefit init`)'
)


class ProjectFile(Section):
    """A whole project file; subclasses from `project_file` have a list of tests for each kind."""

    fabric: FabricSection
    units: UnitsSection = UnitsSection.model_construct()
    law: LawSection = LawSection.model_construct()
    fit: FitSection = FitSection.model_construct()
    card: Annotated[list[CardSection], Field(max_length=MAX_TABLES, default_factory=list)]
    solver: Annotated[dict[str, dict[str, Any]], Field(default_factory=dict)]

    def tests(self, kind: str) -> Sequence[Any]:
        """Return the sections of the tests of a kind, in the file's order."""
        return cast(Sequence[Any], getattr(self, kind))


@functools.cache
def project_file(names: frozenset[str]) -> type[ProjectFile]:
    """Return the model of a file with tests of these kinds; of others it knows the names only."""
    several = Field(max_length=MAX_TABLES)
    tests = dict[str, Any]()
    working_kinds = kinds(names)
    for name in kind_names():
        if name in working_kinds or name not in names:  # else a plug-in that does not work
            section: Any = dict[str, Any]
            if name in working_kinds:
                section = working_kinds[name].section
            tests[name] = Annotated[list[section], several], []
    tables: dict[str, Any] = {name: (dict[str, Any], {}) for name in tests}
    defaults = create_model("Defaults", **tables)
    return create_model("Project", __base__=ProjectFile, defaults=(defaults, defaults()), **tests)


def validated(content: Mapping[str, Any], path: Path) -> ProjectFile:
    """Check a complete project file; tests have the keys of [defaults.KIND] that they do not say.

    Parameters
    ----------
    content : mapping
    path : Path
        File, for messages.

    Raises
    ------
    InputError
        The file is invalid; one line names the file and the dotted key.
    PlugInFailure
        The plug-in of a kind of test does not work.
    """
    if isinstance(content.get("project"), dict) and "kind" in content["project"]:
        raise InputError(path, "project.kind", OLD)
    model = project_file(frozenset(content.keys() & kind_names()))
    for name in content.keys() - model.model_fields.keys():
        if plug_in_named("bubblefit.tests", name) is not None:
            kind_named(name)  # says why it is not among the model's
    try:
        return model.model_validate(_with_defaults(content))
    except ValidationError as errors:
        raise first_error(path, errors, cast(type[BaseModel], model)) from None


def read_content(path: Path) -> dict[str, Any]:
    """Read the tables of a project file without checking them; raise InputError if not TOML."""
    try:
        content = read_toml(path)
        if "beta" in content and "fabric" not in content:
            advice = f"give it beside a project: PROJECT.toml --card {path}"
            raise InputError(path, "", f"is a material card and no project; {advice}")
        return content
    except InputError as error:
        if not isinstance(error.__context__, FileNotFoundError):
            raise
        problem = "no such file; `bubblefit init DIR` writes an example to start from"
        raise InputError(path, "", problem) from None


def _with_defaults(content: Mapping[str, Any]) -> dict[str, Any]:
    """Return the content with the keys of [defaults.KIND] added to each test that lacks them."""
    completed = dict(content)
    defaults = content.get("defaults")
    for kind, common in defaults.items() if isinstance(defaults, dict) else ():
        tests = completed.get(kind)
        if isinstance(common, dict) and isinstance(tests, list):
            completed[kind] = [_merged(common, t) if isinstance(t, dict) else t for t in tests]
    return completed


def _merged(common: Mapping[str, Any], section: Mapping[str, Any]) -> dict[str, Any]:
    """Return a section with the keys of `common` that it lacks; tables are merged by key."""
    merged = {**common, **section}
    for key in common.keys() & section.keys():
        if isinstance(common[key], dict) and isinstance(section[key], dict):
            merged[key] = _merged(common[key], section[key])
    return merged


DRAFT = "https://json-schema.org/draft/2020-12/schema"
REFERENCE = re.compile(r'"#/\$defs/([^"]+)"')


def project_schema(with_plug_ins: bool = True) -> dict[str, Any]:
    """Return the JSON schema of a whole project file, as plain values.
    A test may have its keys from [defaults.KIND], so that none is required here."""
    schema = project_file(frozenset(kind_names())).model_json_schema()
    definitions = schema["$defs"]
    properties = schema["properties"]
    excluded = set()
    if not with_plug_ins:
        excluded = {plug_in.name for plug_in in plug_ins("bubblefit.tests")}
    names = [name for name in kinds() if name not in excluded]
    for name in kinds().keys() & excluded:
        del properties[name]
    for name in names:
        for used in _used(properties[name], definitions):
            definitions[used].pop("required", None)
    properties["defaults"] = {
        "description": "Keys that every test of a kind has unless it says them itself.",
        "type": "object",
        "additionalProperties": False,
        "properties": {name: properties[name]["items"] for name in names},
    }
    sections = {name: s.model_json_schema() for name, s in solver_sections().items()}
    for section in sections.values():
        definitions.update(section.pop("$defs", {}))
    properties["solver"] = {
        "description": "Settings of solvers, by name: [solver.membrane] and so on.",
        "type": "object",
        "properties": sections,
        # Those of plug-ins check their own settings.
        "additionalProperties": {"type": "object"},
    }
    needed = _used(properties, definitions)
    schema["$defs"] = {name: definitions[name] for name in sorted(needed)}
    return {**_plain(schema), "$schema": DRAFT, "title": "bubblefit project"}


def schema_text(with_plug_ins: bool = True) -> str:
    """Return the text of the JSON file with the schema."""
    return json.dumps(project_schema(with_plug_ins), indent=1, sort_keys=True) + "\n"


def _plain(part: Any) -> Any:
    """Return it without null, which TOML does not have, and without titles that repeat the keys."""
    if isinstance(part, list):
        return [_plain(element) for element in part]
    if not isinstance(part, dict):
        return part
    choices = [choice for choice in part.get("anyOf", []) if choice != {"type": "null"}]
    keywords = {key: _plain(value) for key, value in part.items() if _is_telling(key, value)}
    if len(choices) == 1:
        return {**_plain(choices[0]), **keywords}
    if choices:
        keywords["anyOf"] = _plain(choices)
    return keywords


def _is_telling(key: str, value: Any) -> bool:
    """Return whether a keyword tells more than the name of a field, or that it may be left out."""
    if key == "title":
        return not isinstance(value, str)
    return key != "anyOf" and (key != "default" or value is not None)


def _used(part: Any, definitions: dict[str, Any]) -> set[str]:
    """Return the names of the definitions that a part of the schema leads to."""
    used = set[str]()
    new = {*REFERENCE.findall(json.dumps(part))}
    while new:
        used |= new
        new = {*REFERENCE.findall(json.dumps([definitions[name] for name in new]))} - used
    return used


def usual_folder(project: Path) -> Path:
    """Return out/NAME below the current folder, named by the project's folder and file."""
    name = project.resolve().parent.name
    return Path("out") / (name if project.stem == "project" else f"{name}-{project.stem}")


@dataclass(frozen=True, eq=False)
class NamedCard:
    """A material card and, where it is known, the sort of test that it was fitted to."""

    card: MaterialCard
    test: str | None = None


def read_cards(place: Place, sections: Sequence[CardSection]) -> dict[str, NamedCard]:
    """Return the cards by name, in the order of the file; InputError."""
    cards: dict[str, NamedCard] = {}
    for i, section in enumerate(sections):
        at = f"card[{i}]"
        if (section.file is None) == (section.beta is None):
            raise InputError(place.path, at, "expected exactly one of 'file' and 'beta'")
        card = _of_file(place, at, section) if section.file else _of_table(place, at, section)
        if card.name in cards:
            problem = f"{card.name!r} is there twice; name one of them"
            raise InputError(place.path, f"{at}.name", problem)
        cards[card.name] = NamedCard(card, section.test)
    return cards


def _of_file(place: Place, at: str, section: CardSection) -> MaterialCard:
    """Return the card of a file, named as the section says."""
    extra = list(section.model_extra or {})
    for key in (*OF_THE_FILE, *extra):
        if key in extra or getattr(section, key) is not None:
            problem = "is said by the card's file; leave this out"
            raise InputError(place.path, f"{at}.{key}", problem)
    source = place.path.parent / str(section.file)
    card = read_card(source)
    return replace(card, name=section.name or card.name or source.stem)


def _of_table(place: Place, at: str, section: CardSection) -> MaterialCard:
    """Return the card of coefficients in the section."""
    if section.name is None:
        raise InputError(place.path, f"{at}.name", "this key is missing; add it")
    thickness = place.fabric.thickness
    if section.thickness is not None:
        thickness = section.thickness * place.scales.length
    ends = section.strain_range or [UNLIMITED] * 3
    try:
        form = form_named(section.form or FORM, section.model_extra or {}, ends)
        law = HypoelasticLaw(
            place.scales.modulus * np.array(section.beta),
            NU12 if section.nu12 is None else section.nu12,
            np.array(ends),
            section.thickness_change or place.fabric.thickness_change,
            form,
        )
        return MaterialCard(law, thickness, section.name)
    except InputError as error:
        raise InputError(place.path, f"{at}.{error.field}", error.problem) from None
