"""The base of all sections of a project file, its numbers and units, and errors in one line."""

import os
import re
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Annotated, Any, Literal, TypeVar

from pydantic import AfterValidator, BaseModel, ConfigDict, Field, ValidationError
from pydantic_core import PydanticCustomError

from ..errors import InputError, InputErrors, did_you_mean
from ..light_dataclasses import dataclass
from .units import Quantity, unit_doubt

ModulusUnit = Literal["GPa", "MPa", "Pa"]
PressureUnit = Literal["kPa", "MPa", "bar", "Pa"]
LengthUnit = Literal["mm", "m", "in"]
Name = Annotated[str, Field(min_length=1, max_length=300)]
#: MPa, or mm, per unit.
MODULUS_UNITS: dict[str, float] = {"GPa": 1000.0, "MPa": 1.0, "Pa": 1e-6}
PRESSURE_UNITS: dict[str, float] = {"kPa": 1e-3, "MPa": 1.0, "bar": 0.1, "Pa": 1e-6}
LENGTH_UNITS: dict[str, float] = {"mm": 1.0, "m": 1000.0, "in": 25.4}
#: Largest number that a key may have, so that products of a few numbers do not overflow.
HUGE = 1e18
Number = Annotated[float, Field(ge=-HUGE, le=HUGE)]
Positive = Annotated[float, Field(gt=0, le=HUGE)]
#: Weight of a test, or of a part of it, in the objective of a fit; 0 leaves it out.
Weight = Annotated[float, Field(ge=0, le=1e6)]


@dataclass(frozen=True)
class Unit:
    """Mark keys whose numbers are in a unit of [units].

    Attributes
    ----------
    name : {"modulus", "pressure", "length"}
        Key of [units] that gives the unit.
    quantity : str or None
        Quantity whose plausible range shows that a number is in another unit.
    """

    name: Literal["modulus", "pressure", "length"]
    quantity: Quantity | None = None


Length = Annotated[Positive, Unit("length")]
#: Dimension of a specimen or a machine, such as a width, a diameter or a gauge length.
Size = Annotated[Positive, Unit("length", "size")]
Thickness = Annotated[Positive, Unit("length", "thickness")]
Pressure = Annotated[Positive, Unit("pressure", "pressure")]
Modulus = Annotated[Number, Unit("modulus")]
#: Logarithmic strain; 2 is 640 %, so that a larger number was probably meant in percent.
Strain = Annotated[float, Field(gt=0, le=2)]
#: Type of errors whose message says everything.
IN_FULL = "in_full"


def error_in_full(message: str) -> PydanticCustomError:
    """Return an error for a validator to raise, of which a user reads this message alone."""
    return PydanticCustomError(IN_FULL, "{message}", {"message": message})


def ascending(bounds: list[float]) -> list[float]:
    """Return [least, largest]; a validator of bounds."""
    least, largest = bounds
    if not least < largest:
        raise error_in_full(f"expected [least, largest], got [{least:g}, {largest:g}]")
    return bounds


#: Lower and upper bound, either of any size or positive.
Bounds = Annotated[list[Number], Field(min_length=2, max_length=2), AfterValidator(ascending)]
PositiveBounds = Annotated[
    list[Positive], Field(min_length=2, max_length=2), AfterValidator(ascending)
]
#: Ends of a range of strain: warp, fill, shear.
StrainTriple = Annotated[list[Strain], Field(min_length=3, max_length=3)]

#: What pydantic calls one of several sorts of values that a key may have.
ONE_OF = re.compile(r"constrained-\w+$|literal\[")


class Section(BaseModel):
    """A table of a project file: no unknown keys, no text for numbers, no NaN.
    A default is `model_construct()`: making one in the usual way builds a validator at import."""

    model_config = ConfigDict(
        extra="forbid",
        strict=True,
        allow_inf_nan=False,
        defer_build=True,
    )


AnySection = TypeVar("AnySection", bound=Section)


def path_beside(folder: Path, name: str) -> Path:
    """Return the path of a file in `folder`, unless it is absolute or below the home (~)."""
    return folder / os.path.expanduser(name)


def dotted(location: Sequence[str | int]) -> str:
    """Return a dotted key: ('bounds', 'lower', 3) -> 'bounds.lower[3]'."""
    text = ""
    for part in location:
        text += f"[{part}]" if isinstance(part, int) else f".{part}" if text else part
    return text


def first_error(
    path: Path | None,
    errors: ValidationError,
    file: type[BaseModel],
    at: str = "",
) -> InputError:
    """Return the error of a table, of several as `InputErrors`, unknown keys first.

    Parameters
    ----------
    path : Path or None
        File, for the message.
    errors : ValidationError
    file : type
        Model that was validated.
    at : str
        Dotted key of the table; "" for the file itself.
    """
    details = sorted(errors.errors(), key=lambda error: error["type"] != "extra_forbidden")
    input_errors = []
    for detail in details:
        key = dotted([part for part in detail["loc"] if not ONE_OF.match(str(part))])
        field = f"{at}.{key}" if at and key else at or key
        input_errors.append(InputError(path, field, _problem(detail, file)))
    return input_errors[0] if len(input_errors) == 1 else InputErrors(input_errors)


def _problem(error: Mapping[str, Any], file: type[BaseModel]) -> str:
    """Describe an error of pydantic."""
    kind = error["type"]
    location = error["loc"]
    value = error.get("input")
    brackets = _wrong_brackets(error)
    if brackets:
        return brackets
    if kind == IN_FULL:
        return str(error["msg"])
    if kind == "missing":
        return f"this {_kind_of_key(location, file)} is missing; add it"
    if kind == "extra_forbidden":
        keys = _holder(location, file).model_fields
        suggestion = did_you_mean(location[-1], keys) or ";"
        return f"unknown key{suggestion} allowed here: {', '.join(keys)}"
    if kind == "finite_number":
        return f"expected a finite number, got {value!r}"
    if kind == "too_short":
        return f"expected at least {error['ctx']['min_length']} items, got {len(value or ())}"
    if kind == "too_long":
        return f"expected at most {error['ctx']['max_length']} items, got {len(value or ())}"
    expected = error["msg"].removeprefix("Input should be ").rstrip(".")
    return f"expected {expected}, got {_abbreviated(value)}"


def _wrong_brackets(error: Mapping[str, Any]) -> str:
    """Return how the brackets of a table are written, "" where they are not what is wrong."""
    name = ".".join(part for part in error["loc"] if isinstance(part, str))
    value = error.get("input")
    if error["type"] == "list_type" and isinstance(value, Mapping):
        return f"there can be several of these tables; write [[{name}]] for [{name}]"
    if error["type"] in ("model_type", "dict_type") and isinstance(value, list):
        return f"there is one of these tables only; write [{name}] for [[{name}]]"
    return ""


def _abbreviated(value: Any) -> str:
    """Return the value as Python writes it, cut to 60 letters."""
    text = repr(value)
    return text if len(text) <= 60 else f"{text[:57]}..."


def _kind_of_key(location: Sequence[str | int], file: type[BaseModel]) -> str:
    """Return whether the key at a location is that of a section."""
    field = file.model_fields.get(str(location[0])) if len(location) == 1 else None
    is_section = field is not None and any(_sections(field.annotation))
    return "section" if is_section else "key"


def _holder(location: Sequence[str | int], file: type[BaseModel]) -> type[BaseModel]:
    """Return the model of the table that holds the key at a location."""
    names = [part for part in location[:-1] if isinstance(part, str)]  # numbers count tables
    for name in names:
        file = next(_sections(file.model_fields[name].annotation))
    return file


def _sections(annotation: Any) -> Iterator[type[BaseModel]]:
    """Yield the models in an annotation."""
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        yield annotation
    for part in getattr(annotation, "__args__", ()):
        yield from _sections(part)


def model_of(section: type[BaseModel], dotted: str) -> type[BaseModel]:
    """Return the model of a table below a section, by its dotted name; "" for the section's own."""
    for part in dotted.split(".") if dotted else ():
        section = next(_sections(section.model_fields[part].annotation))
    return section


def in_base_units(
    section: type[BaseModel], table: Mapping[str, Any], scales: Any
) -> dict[str, Any]:
    """Return a table with marked numbers in mm, N and MPa.

    Parameters
    ----------
    section : type
        Model of the table.
    table : mapping
    scales : Scales
        mm, N or MPa per unit, by the names of `Unit`.
    """
    converted = dict(table)
    for key, value in table.items():
        unit, model = _unit_and_model(section, key)
        if unit is not None:
            converted[key] = _scaled(value, getattr(scales, unit.name))
        elif model is not None:
            converted[key] = _tables_in_base_units(model, value, scales)
    return converted


def _unit_and_model(
    section: type[BaseModel], key: str
) -> tuple[Unit | None, type[BaseModel] | None]:
    """Return the unit that a key is marked with, and the model of the table below it."""
    field = section.model_fields.get(key)
    if field is None:
        return None, None  # of a form of the moduli: a strain or a count
    marks = [*field.metadata, *_marks(field.annotation)]
    unit = next((mark for mark in marks if isinstance(mark, Unit)), None)
    return unit, next(_sections(field.annotation), None)


def _tables_in_base_units(section: type[BaseModel], value: Any, scales: Any) -> Any:
    """Return a table, or each table of a list, in base units; anything else as it is."""
    if isinstance(value, list):
        return [_tables_in_base_units(section, element, scales) for element in value]
    return in_base_units(section, value, scales) if isinstance(value, Mapping) else value


def unit_doubts(
    section: type[BaseModel],
    table: Mapping[str, Any],
    scales: Any,
    at: str = "",
) -> Iterator[tuple[str, str]]:
    """Yield the numbers of a table that seem to be in another unit.

    Parameters
    ----------
    section : type
        Model of the table.
    table : mapping
    scales : Scales
        MPa, or mm, per unit by the names of `Unit`, and names of units (`pressure_unit`).
    at : str
        Dotted key of the table.

    Yields
    ------
    key : str
        Dotted key of the number.
    problem : str
    """
    for key, value in table.items():
        unit, model = _unit_and_model(section, key)
        items = _by_key(f"{at}.{key}" if at else key, value)
        series = [item for item in items.values() if isinstance(item, (int, float))]
        for item_key, item in items.items():
            if isinstance(item, Mapping) and model is not None:
                yield from unit_doubts(model, item, scales, item_key)
            elif isinstance(item, (int, float)):
                problem = _doubt_of_number(item, unit, scales, series)
                if problem:
                    yield item_key, problem


def _by_key(key: str, value: Any) -> dict[str, Any]:
    """Return the elements of a list by their keys, or a single value by its key."""
    if isinstance(value, (list, tuple)):
        return {f"{key}[{number}]": element for number, element in enumerate(value)}
    return {key: value}


def _doubt_of_number(number: float, unit: Unit | None, scales: Any, series: Sequence[float]) -> str:
    """Return why a number seems to be in another unit; "" for one without a quantity."""
    if unit is None or unit.quantity is None:
        return ""
    unit_name = getattr(scales, f"{unit.name}_unit")
    return unit_doubt(unit.quantity, number, unit_name, getattr(scales, unit.name), series)


def values_that_were_set(section: BaseModel) -> dict[str, Any]:
    """Return the keys of a section and of its tables that were set and are not None.

    `model_dump` would build the serialiser of the section first, 30 ms for a bubble's.
    """
    keys = (key for key in type(section).model_fields if key in section.model_fields_set)
    values = {key: getattr(section, key) for key in keys}
    return {key: _plain_tables(value) for key, value in values.items() if value is not None}


def _plain_tables(value: Any) -> Any:
    """Return a value of a section with mappings in place of sections."""
    if isinstance(value, BaseModel):
        return values_that_were_set(value)
    if isinstance(value, (list, tuple)):
        return [_plain_tables(item) for item in value]
    if isinstance(value, dict):
        return {key: _plain_tables(item) for key, item in value.items() if item is not None}
    return value


def whole_in_base_units(section: AnySection, scales: Any) -> AnySection:
    """Return a section that was read with its marked numbers in mm, N and MPa."""
    table = values_that_were_set(section)
    return section.model_validate(in_base_units(type(section), table, scales))


def _scaled(value: Any, scale: float) -> Any:
    """Return every number of a value times a scale."""
    if isinstance(value, Mapping):
        return {key: _scaled(element, scale) for key, element in value.items()}
    if isinstance(value, list):
        return [_scaled(element, scale) for element in value]
    return value if isinstance(value, str) else value * scale


def _marks(annotation: Any) -> Iterator[Any]:
    """Yield what the parts of an annotation are marked with."""
    yield from getattr(annotation, "__metadata__", ())
    for part in getattr(annotation, "__args__", ()):
        yield from _marks(part)
