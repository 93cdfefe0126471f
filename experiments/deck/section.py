"""Section [[deck]] of a project: a deck of the user's, its parameters, and what is compared."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, Any, Literal

from pydantic import BeforeValidator, Field, TypeAdapter

from ...readers.sections import Bounds, Name, Number, Positive, Section, Weight, error_in_full

Axis = Literal["x", "y", "z"]
#: Key of the condition among the parameters.
FEASIBLE = "feasible"
Words = Annotated[list[Name], Field(min_length=1)]


class ParameterSection(Section):
    """Section [deck.parameters.NAME]: bounds of a parameter, its unit, and where a fit starts."""

    bounds: Bounds
    unit: str = ""
    start: Number | None = None


def _parameters(value: Any) -> Any:
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
        Weight beside the other comparisons of the deck.
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
    parameters: Annotated[dict[str, ParameterSection | str], BeforeValidator(_parameters)] = Field(
        default={}
    )
    compare: Annotated[list[CompareSection], Field(min_length=1)]
