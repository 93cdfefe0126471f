"""Read a deck of the user's from its section: template, parameters, files, measured values."""

from __future__ import annotations

import math
import os
import shutil
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, Self

from ...errors import InputError
from ...inference.nuisance import WIDE, Nuisance
from ...meshes.bubble_model import BubbleModel
from ...meshes.strip_models import UniaxialModel
from ...readers.sections import path_beside
from ...solvers.base import DifferentiatingSolver
from ...solvers.decks import JOB
from ...solvers.registry import SURROGATE
from ...solvers.settings import programs_problem
from ...storage.reading import is_file, missing_file_reason
from ..base import MakeSolver, Reach, Refined, SectionTest, Test
from ..data_files import DataFile, joined
from ..sections import ObjectPlace, Place
from .differences import DeckSolver
from .embedded import EmbeddedSolver
from .feasibility import holds, linear_conditions
from .measured import Compared, read_compared
from .model import RESERVED, DeckModel
from .results import DeckReader
from .section import FEASIBLE, DeckSection, ParameterSection

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
    matched: dict[str, Compared] = {}
    for number, compare in enumerate(section.compare):
        at = f"compare[{number}]"
        compared = read_compared(compare, place, at, section.folder)
        if matched.setdefault(compared.name, compared) is not compared:
            raise place.error(f"{at}.name", f"{compared.name!r} is there twice; name one of them")
    parameters = _parameters(section, place)
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


def _parameters(section: DeckSection, place: Place) -> tuple[Nuisance, ...]:
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
