"""Decks of the user's own: any finite element program's input with parameters to be found."""

from __future__ import annotations

import math
import os
import shutil
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Annotated, Any, Literal, Self

import numpy as np
from pydantic import BeforeValidator, Field, TypeAdapter

from ...errors import InputError
from ...inference.nuisance import WIDE, Nuisance
from ...lazy_modules import LazyFunction
from ...meshes.bubble_model import BubbleModel
from ...meshes.strip_models import UniaxialModel
from ...readers.frames import FrameOptions, frame_files, read_frames
from ...readers.machine_tables import Channel, MachineTable, TableOptions, read_machine_table
from ...readers.sections import (
    Bounds,
    Name,
    Number,
    Positive,
    Section,
    Weight,
    error_in_full,
    path_beside,
)
from ...readers.units import LENGTH_UNITS, LOAD_UNITS, PRESSURE_UNITS, TIME_UNITS
from ...solvers.base import Array, DifferentiatingSolver
from ...solvers.decks import JOB
from ...solvers.registry import SURROGATE
from ...solvers.settings import programs_problem
from ...storage.reading import is_file, missing_file_reason
from ..base import BaseKind, MakeSolver, Reach, Refined, SectionTest, Test
from ..data_files import DataFile, joined
from ..sections import ObjectPlace, Place
from .model import RESERVED, DeckModel, holds, linear_conditions
from .results import DeckReader, FieldReading, Probe, QuantityReading, Reading
from .solvers import DeckSolver, EmbeddedSolver

Axis = Literal["x", "y", "z"]
#: Key of the condition among the parameters.
FEASIBLE = "feasible"
Words = Annotated[list[Name], Field(min_length=1)]


class ParameterSection(Section):
    """Section [deck.parameters.NAME]: bounds of a parameter, its unit, and where a fit starts."""

    bounds: Bounds
    unit: str = ""
    start: Number | None = None


def _checked_parameters(value: Any) -> Any:
    """Return the parameters of a section checked one by one, with the condition on them as text."""
    # Not checked as a union: complaints then name the key, not the form.
    if not isinstance(value, Mapping):
        return value
    tables = {name: entry for name, entry in value.items() if name != FEASIBLE}
    checked: dict[str, Any] = {}
    checked |= TypeAdapter(dict[str, ParameterSection]).validate_python(tables)
    if not isinstance(value.get(FEASIBLE, ""), str):
        raise error_in_full('expected a condition as text: feasible = "C10 + C01 > 0"')
    return {**checked, FEASIBLE: value.get(FEASIBLE, "")}


class QuantitySection(Section):
    """Section x or y of [[deck.compare]]: a measured column, and what of the results it is.

    Attributes
    ----------
    column
        Column of the measured table; found by what headings mean where it is left out.
    unit
        Unit of the column where its heading names none.
    set
        Node set.
    node
        Place (mm) whose nearest node is taken instead of a set.
    displacement, reaction
        Axis: the mean displacement of the set, or the sum of its forces.
    time
        The number at time 1 of the analysis; it grows with time.
    result
        Column of the table that the program writes.
    scale
        Factor of the modelled number.
    """

    column: Name | None = None
    unit: str | None = None
    set: Name | None = None
    node: Annotated[list[Number], Field(min_length=3, max_length=3)] | None = None
    displacement: Axis | None = None
    reaction: Axis | None = None
    time: Number | None = None
    result: Name | None = None
    scale: Number = 1.0

    @property
    def axis(self) -> str:
        """Return the axis of a displacement or a reaction."""
        return self.displacement or self.reaction or "x"

    @property
    def place(self) -> str | tuple[float, ...]:
        """Return the column, set or place of the number in the results, "" for none."""
        return self.result or self.set or tuple(self.node or ()) or ""


class CompareSection(Section):
    """Section [[deck.compare]]: a measured quantity over another one, or fields; in the results.

    Attributes
    ----------
    name
        What is compared; by default the measured column of y.
    measured
        Files, or patterns, of tables of readings, or of frames of DIC.
    x, y
        The quantities of readings.
    quantity
        That of fields, instead of x and y.
    set
        Node set on which fields are sampled; in the axes of the deck.
    times
        Time of the analysis of each frame.
    noise
        Standard deviation of one measured y.
    weight
        Weight beside the other comparisons of the deck; 0 leaves it out.
    """

    name: Name | None = None
    measured: Name | list[Name]
    x: QuantitySection | None = None
    y: QuantitySection | None = None
    quantity: Literal["displacement"] | None = None
    set: Name | None = None
    times: list[Number] = Field(default=[])
    noise: Positive | None = None
    weight: Weight = 1.0


class DeckSection(Section):
    """Section [[deck]]: the user's own input deck, and what of its results was measured.

    Attributes
    ----------
    name, weight
        Name of the test, and weight of its error in the objective.
    program
        "calculix", "marc", or the words of a command, in which {{ job }} is the deck's name.
    folder
        Folder of the template and of the measured files, from the project's.
    template
        The deck as a Jinja template.
    files
        Files of its folder that are copied although the deck does not name them.
    geo
        File of gmsh, of which a mesh with the ending .inp is made first.
    result
        Table, or file of values at nodes, that the program writes; a pattern for a file a frame.
    timeout
        Seconds after which a run is ended.
    side_by_side
        Largest number of runs at a time for the derivatives; one for each core unless given.
    surrogate
        Test of the project, a bubble or "strips: warp", whose model leads the fit of the law.
    surrogate_times
        Time of the deck's analysis of each load of that; in proportion to it up to 1 by default.
    parameters
        Unknowns of the deck beside, or instead of, the law; "feasible" is a condition on them.
    compare
        What is compared.
    """

    name: Name | None = None
    weight: Weight = 1.0
    program: Literal["calculix", "marc"] | Words = "calculix"
    folder: str = ""
    template: Name
    files: list[Name] = Field(default=[])
    geo: Name | None = None
    result: str = ""
    timeout: Positive | None = None
    side_by_side: Annotated[int, Field(ge=1)] | None = None
    surrogate: Name | None = None
    surrogate_times: list[Number] = Field(default=[])
    parameters: Annotated[
        dict[str, ParameterSection | str], BeforeValidator(_checked_parameters)
    ] = Field(default={})
    compare: Annotated[list[CompareSection], Field(min_length=1)]


#: Name of a test's one part.
PART = "deck"
#: Files of results of programs that name them themselves.
RESULTS = {"calculix": f"{JOB}.frd", "marc": f"{JOB}.t19"}


@dataclass(frozen=True, eq=False, kw_only=True)
class DeckTest(SectionTest):
    """A deck of the user's, with what was measured.

    Attributes
    ----------
    section : DeckSection
    model : DeckModel
        At the start values of its parameters.
    parameters : tuple of Nuisance
    matched : mapping of Compared
        What is compared, by name.
    embedded : BubbleModel or UniaxialModel, optional
        Model of ours that leads the fit.
    """

    section: DeckSection
    model: DeckModel
    parameters: tuple[Nuisance, ...]
    matched: Mapping[str, Compared]
    embedded: Any = None
    kind: str = "deck"
    reads_files: bool = True

    @property
    def reach(self) -> Reach:
        """Return no strains: the strains of a deck are not those of a law."""
        return Reach()

    def models(
        self, thickness: float | None = None, refined: Refined = "elements", factor: float = 1.0
    ) -> Mapping[str, DeckModel]:
        """Return the deck; it has a mesh of its own, which is not refined."""
        change = self.thick(thickness) - self.model.thickness
        return {PART: self.model.with_parameters({"thickness": change})}

    def solver(self, make_solver: MakeSolver, comparisons: int = 1) -> DeckSolver:
        """Return what runs the deck, and differentiates its results for so many comparisons."""
        return DeckSolver(make_solver(self.model.program), self.section.side_by_side, comparisons)

    def led_by(self, tests: Mapping[str, Test]) -> Self:
        surrogate = self.section.surrogate
        if surrogate is None:
            return self
        name, _, part = surrogate.partition(": ")
        models = dict(tests[name].models()) if name in tests else {}
        model = models.get(part) if part else next(iter(models.values()), None)
        problem = ""
        if not isinstance(model, BubbleModel | UniaxialModel) or (not part and len(models) > 1):
            problem = 'expected the name of a bubble of the project, or of strips ("strips: warp")'
        elif self.parameters:
            problem = "a model of ours has no parameters of a deck: leave this out"
        if problem:
            raise self.place.error("surrogate", f"{problem}; got {surrogate!r}")
        return replace(self, embedded=model)

    def surrogate(self, make_solver: MakeSolver) -> EmbeddedSolver | None:
        """Return what runs the model that leads the fit, if there is one."""
        if self.embedded is None:
            return None
        solver = make_solver(SURROGATE)
        assert isinstance(solver, DifferentiatingSolver)
        times = self.section.surrogate_times
        return EmbeddedSolver(solver, self.embedded, self.model.reader, times)

    def with_values(self, values: Mapping[str, float]) -> Self:
        if not values:
            return self
        changes = {}
        for name, start in self.model.values.items():
            if name not in values:
                problem = f"there is no value of {name}, only of: {', '.join(values)}"
                raise InputError(self.place.path, "--card", problem)
            changes[name] = values[name] - start
        with self.place.errors_name("parameters"):
            return replace(self, model=self.model.with_parameters(changes))

    def settings(self) -> Mapping[str, object]:
        """Return all on which a fit depends beside data and law; the deck by its content."""
        return {"section": self.section.model_dump(exclude={"folder"}), "files": self.model.mark}

    def data_files(self) -> Sequence[DataFile]:
        return joined(file for compared in self.matched.values() for file in compared.data)


def read(section: DeckSection, place: Place, name: str) -> DeckTest:
    """Read a test from its section, its template and its measured files.

    Parameters
    ----------
    section : DeckSection
    place : Place
        Place of the section in its project, with folders, units and messages.
    name : str
        Name of the test.

    Raises
    ------
    InputError
        A file or a key is wrong, or the project may not name the program.
    """
    command = _command(section, place)
    program = section.program if isinstance(section.program, str) else "command"
    result = section.result or RESULTS.get(program, "")
    if not result:
        raise place.error("result", "expected the name of the file that the program writes")
    template = place.folder(section.folder) / section.template
    named = [("template", template.name), *(("files", name) for name in section.files)]
    if section.geo:
        _check_allowed(place, "geo")  # it can start programs
        named.append(("geo", section.geo))
    for key, name_of_file in named:
        if not is_file(template.parent / name_of_file):
            raise place.error(key, missing_file_reason(template.parent / name_of_file))
    matched = _matched(section, place)
    parameters = _unknowns(section, place)
    condition = str(section.parameters.get(FEASIBLE, ""))
    values = {parameter.name: parameter.start for parameter in parameters}
    bounds = {parameter.name: (parameter.lower, parameter.upper) for parameter in parameters}
    with place.errors_name("parameters"):
        holds(condition, values)
    if parameters:
        first = replace(parameters[0], conditions=linear_conditions(condition, bounds))
        parameters = (first, *parameters[1:])
    model = DeckModel(
        folder=template.parent,
        template=template.name,
        values=values,
        bounds=bounds,
        feasible=condition,
        thickness=place.fabric.thickness,
        reader=DeckReader(tuple(compared.reading for compared in matched.values()), result),
        listed=tuple(section.files),
        program=program,
        command=command,
        timeout=section.timeout,
        geometry=section.geo or "",
    )
    return DeckTest(
        name=name,
        place=place,
        weight=section.weight,
        section=section,
        model=model,
        parameters=parameters,
        matched=matched,
    )


def _matched(section: DeckSection, place: Place) -> dict[str, Compared]:
    """Return what is compared and has a weight, by name; InputError."""
    matched: dict[str, Compared] = {}
    for number, compare in enumerate(section.compare):
        at = f"compare[{number}]"
        compared = _read_compared(compare, place, at, section.folder)
        if not compare.weight:
            continue
        if matched.setdefault(compared.name, compared) is not compared:
            raise place.error(f"{at}.name", f"{compared.name!r} is there twice; name one of them")
    if not matched:
        raise place.error("compare", "expected a weight above 0: nothing would be matched")
    return matched


def _command(section: DeckSection, place: Place) -> tuple[str, ...]:
    """Return the words of a command, if it is one; InputError where it is not allowed."""
    if isinstance(section.program, str):
        return ()
    first, *words = section.program
    program = str(path_beside(place.path.parent, first)) if os.sep in first else first
    _check_allowed(place, "program")
    if shutil.which(program) is None:
        raise place.error("program", f"there is no program {first}; name another")
    return program, *words


def _check_allowed(place: Place, key: str) -> None:
    """Raise InputError where a project file may not say what is run; Python's user may."""
    problem = "" if isinstance(place, ObjectPlace) else programs_problem(place.path)
    if problem:
        raise place.error(key, problem)


def _unknowns(section: DeckSection, place: Place) -> tuple[Nuisance, ...]:
    """Return the parameters of a deck as unknowns of a fit; InputError."""
    parameters = []
    for name, entry in section.parameters.items():
        if not isinstance(entry, ParameterSection):  # the condition, a text
            continue
        if not name.isidentifier() or name in RESERVED:
            problem = f"expected a name of letters and digits, none of {', '.join(RESERVED)}"
            raise place.error(f"parameters.{name}", problem)
        low, high = entry.bounds
        middle = math.sqrt(low * high) if 0 < WIDE * low < high else 0.5 * (low + high)
        start = middle if entry.start is None else entry.start
        if not low <= start <= high:
            problem = f"expected a start from {low:g} to {high:g}, got {start:g}"
            raise place.error(f"parameters.{name}.start", problem)
        parameters.append(
            Nuisance(
                name,
                low,
                high,
                entry.unit,
                model_parameter=name,
                start=start,
                shared=True,
                drawn=True,
            )
        )
    return tuple(parameters)


#: Units of a measured column by the quantity of the results, that of calculations first.
UNITS = {"displacement": LENGTH_UNITS, "reaction": LOAD_UNITS}
AXES = "xyz"


@dataclass(frozen=True, eq=False)
class Compared:
    """Measured values (n,) in the order of the values of their reading, in `unit`, with files."""

    section: CompareSection
    name: str
    reading: Reading
    load: Array
    unit: str
    data: tuple[DataFile, ...]


def _read_compared(section: CompareSection, place: Place, at: str, folder: str) -> Compared:
    """Read measured values of all files; InputError where files, columns, or keys are wrong.

    Parameters
    ----------
    at : str
        Dotted key of the section below the test's.
    folder : str
        Of the files, from the project's.
    """
    paths = _files(section.measured, place, f"{at}.measured", folder)
    read = _read_curve if section.quantity is None else _read_fields
    compared = read(section, place, at, paths)
    if not compared.load.any():
        problem = f"the measured values of {compared.name} are all zero"
        raise place.error(f"{at}.measured", problem)
    return compared


def _read_curve(section: CompareSection, place: Place, at: str, paths: list[Path]) -> Compared:
    """Return the readings of a quantity over another one, file after file."""
    if section.x is None or section.y is None:
        raise place.error(at, 'expected x and y, or quantity = "displacement" with set and times')
    axes = {"elongation": section.x, "load": section.y}
    probes = _probe_of(section.x, place, f"{at}.x"), _probe_of(section.y, place, f"{at}.y")
    kinds = {probe.quantity for probe in probes}
    if "result" in kinds and len(kinds) > 1:
        problem = "a table has no times and no nodes: give result = COLUMN in both x and y"
        raise place.error(at, problem)
    named = {quantity: axis.column for quantity, axis in axes.items() if axis.column}
    columns = []
    data = []
    for path in paths:
        table = read_machine_table(path, TableOptions(named))
        values = [
            _numbers(table, table.column(quantity), probe.quantity, axis.unit)
            for (quantity, axis), probe in zip(axes.items(), probes, strict=True)
        ]
        columns.append(values)
        data.append(DataFile(path, table.source({}, {}), len(values[0])))
    x, y = np.hstack(columns)
    name = section.name or section.y.column or probes[1].quantity
    unit = {"displacement": "mm", "reaction": "N"}.get(probes[1].quantity, section.y.unit or "1")
    return Compared(section, name, QuantityReading(*probes, x), y, unit, tuple(data))


def _read_fields(section: CompareSection, place: Place, at: str, paths: list[Path]) -> Compared:
    """Return the displacements of all points and axes that were measured, frame after frame."""
    frames = read_frames(paths, FrameOptions(("x", "y", "dx", "dy")))
    if not section.set or len(section.times) != len(frames):
        problem = f"expected a node set (set), and a time of the analysis for each of {len(frames)}"
        raise place.error(f"{at}.times", f"{problem} frames (times)")
    blocks = []
    values = []
    data = []
    for time, frame in zip(section.times, frames, strict=True):
        points = np.nan_to_num(frame.points)
        for axis, measured in enumerate(frame.displacement.T):
            is_correlated = np.isfinite(measured)
            if is_correlated.any():
                blocks.append((time, axis, points[is_correlated]))
                values.append(measured[is_correlated])
        assert frame.path is not None
        data.append(DataFile(frame.path, frame.source, len(points)))
    name = section.name or f"displacement of {section.set}"
    reading = FieldReading(section.set, tuple(blocks))
    return Compared(section, name, reading, np.concatenate(values), "mm", tuple(joined(data)))


def _files(measured: str | list[str], place: Place, field: str, folder: str) -> list[Path]:
    """Return the files that names or patterns stand for; InputError where one is missing."""
    names = [measured] if isinstance(measured, str) else measured
    with place.errors_name(field=field):
        paths, _ = frame_files(names, "measured", place.folder(folder))
    for path in paths:
        place.has(path, field)
    return paths


def _numbers(table: MachineTable, column: str, quantity: str, unit: str | None) -> Array:
    """Return the numbers (n,) of a column, in the unit of the quantity if that has one.

    Those of a column of the program's results are converted from the unit in the heading to that
    of the project.
    """
    if quantity in UNITS:
        return table.values(column, UNITS[quantity], Channel(unit=unit))
    numbers = table.table.numbers(column)
    heading = table.units[column]
    if not unit or not heading or unit == heading:
        return numbers
    for units in (LOAD_UNITS, LENGTH_UNITS, PRESSURE_UNITS, TIME_UNITS):
        if unit in units and heading in units:
            return numbers * (units[heading] / units[unit])
    raise table.error(column, f"the file says {heading!r}, the project {unit!r}")


def _probe_of(section: QuantitySection, place: Place, at: str) -> Probe:
    """Return the number of the results that a section describes; InputError."""
    keys = ("displacement", "reaction", "time", "result")
    chosen = [key for key in keys if getattr(section, key) is not None]
    if len(chosen) != 1:
        raise place.error(at, f"expected one of {', '.join(keys)}")
    if section.time is not None:
        return Probe("time", scale=section.time)
    if not section.place:
        raise place.error(at, "expected a node set (set), or a place (node = [x, y, z])")
    return Probe(chosen[0], section.place, AXES.index(section.axis), section.scale)


class DeckKind(BaseKind):
    """An input deck of the user's own, with what is measured of its results."""

    name = "deck"
    title = "an input deck of your own, with what of its results was measured"
    section = DeckSection
    folder_key = "folder"
    fitted = True
    read = staticmethod(read)
    prepare = LazyFunction(f"{__name__}.prepared", "prepare_deck")


KIND = DeckKind()
