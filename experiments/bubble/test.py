"""A bubble test as its section describes it, its model, and the quantities that studies compare."""

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field
from itertools import pairwise
from typing import ClassVar, Literal

import numpy as np
from numpy.typing import NDArray

from ...materials.card import State
from ...meshes.bubble_model import BubbleModel, SheetCord, default_increments
from ...meshes.disk import Outline, check_disk_memory, elliptic_disk_mesh
from ...meshes.mesh import Facet
from ...readers.fields import DisplacementField, read_fields
from ...readers.histories import LoadHistory, Pace, pace_of
from ...readers.inflations import InflationChoice
from ...readers.sections import whole_in_base_units
from ...solvers.base import History
from ..kinds import Place, Reach, Refined, SectionTest, Studied, divided
from .point_files import PointFiles, measured_files
from .registration import clamp_radius
from .section import (
    BubbleSection,
    Sheet,
    Symmetry,
    cords_of,
    facet_of,
    fitted_registration,
    outline_of,
    sheet_of,
)


def merge_increments(
    place: Place, field: str, extra: Sequence[float], pressures: Sequence[float]
) -> tuple[float, ...]:
    """Return load steps (MPa): the pressures and the extra ones between.
    Raises InputError for an extra one, of key `field`, beyond the last pressure."""
    steps = list(pressures)
    for i, value in enumerate(extra):
        if value > pressures[-1] * (1 + 1e-9):
            step = value / place.scales.pressure
            problem = f"expected a step up to the last pressure, got {step:g} beyond it"
            raise place.error(f"{field}[{i}]", problem)
        # 22 kPa written twice must not become two steps one rounding error apart.
        if not np.isclose(steps, value, rtol=1e-9, atol=0.0).any():
            steps.append(value)
    return tuple(sorted(steps))


@dataclass(frozen=True, eq=False)
class KnownSolution:
    """Data to be computed by the forward model: beta and increments in MPa, a full disk's quads.
    recorded : there are no frames to choose among."""

    beta: NDArray[np.float64]
    form: str
    elements: int
    increments: tuple[float, ...]
    symmetry: Literal["full", "quarter"]
    solver: str | None = None
    recorded: ClassVar[None] = None


def known_solution(
    section: BubbleSection, place: Place, pressures: Sequence[float], steps: tuple[float, ...]
) -> KnownSolution:
    """Return the known solution of a section; steps : increments (MPa) unless it names its own."""
    known = section.data.known_solution
    assert known is not None
    if known.increments is not None:
        at = "data.known_solution.increments"
        steps = merge_increments(place, at, known.increments, pressures)
    return KnownSolution(
        beta=np.array(known.beta),
        form=known.form,
        elements=known.elements or section.elements,
        increments=steps,
        symmetry=known.symmetry or section.symmetry,
        solver=known.solver,
    )


PART = "bubble"


@dataclass(frozen=True, eq=False, kw_only=True)
class BubbleTest(SectionTest):
    """A clamped disk that is inflated. Lengths mm, pressures MPa.
    `pressures` are reported and matched, `increments` are the load steps and contain them. `noise`
    of one displacement. `facet` : by which the camera reads displacements, None for points.
    `registration` : one standard deviation (degrees, mm) of each of its unknowns."""

    outline: Outline
    elements: int
    symmetry: Symmetry
    generator: Literal["blocks", "gmsh"]
    pressures: tuple[float, ...]
    increments: tuple[float, ...]
    data: KnownSolution | PointFiles
    match_by: Literal["surfaces", "points"]
    match_degree: int
    objective: Literal["e", "mm"]
    displacement_offset: bool
    pressure_offset: bool
    sheet: Sheet
    facet: Facet | None = None
    of_clamp: bool = False  # the radius is that of the clamp, found in the data
    registration: Mapping[str, float] = field(default_factory=dict)
    inflation: InflationChoice = 1
    cords: tuple[SheetCord, ...] = ()
    kind: str = "bubble"
    reach: ClassVar[Reach] = Reach()  # known only when its law is

    @property
    def state(self) -> State:
        """Return "conditioned" where only a later inflation is taken."""
        return "first loading" if self.inflation in (1, "all") else "conditioned"

    @property
    def rising(self) -> int:
        """Return the number of pressures before the first one that falls."""
        return int(np.argmax([*(np.diff(self.pressures) < 0), True])) + 1

    @property
    def pace(self) -> Pace:
        """Return rate of strain, that of a spherical cap, and hold by the log and its frames."""
        if self.data.recorded is None or (clock := self.data.recorded.clock) is None:
            return Pace()
        known = np.isfinite(clock.pressure + clock.heights)
        strain = 2.0 / 3.0 * (clock.heights[known] / self.outline.radius) ** 2
        path = self.place.path
        pressure = clock.pressure[known]
        return pace_of([LoadHistory(path, pressure, strain, clock.times[known])])

    @property
    def reads_files(self) -> bool:
        return isinstance(self.data, PointFiles)

    def model(
        self,
        thickness: float | None = None,
        elements: int | None = None,
        symmetry: Symmetry | None = None,
        increments: tuple[float, ...] | None = None,
    ) -> BubbleModel:
        """Return the test's model, or one of the same disk with another mesh or increments."""
        mesh = elliptic_disk_mesh(
            self.outline, elements or self.elements, symmetry or self.symmetry, self.generator
        )
        steps = increments or self.increments
        unloaded = self.rising < len(self.pressures)
        return BubbleModel(
            mesh, self.thick(thickness), self.pressures, steps, unloaded=unloaded, cords=self.cords
        )

    def models(
        self, thickness: float | None = None, refined: Refined = "elements", factor: float = 1.0
    ) -> Mapping[str, BubbleModel]:
        """Return the one model; edges of its quads, or its increments, divided by a factor."""
        own = self.model(thickness)
        if factor == 1:
            return {PART: own}
        if refined == "elements":
            # From the count that the mesh has, not the one asked for: finer meshes divide quads.
            whole = len(own.mesh.quads) * (4 if self.symmetry == "quarter" else 1)
            return {PART: self.model(thickness, elements=round(whole * factor**2))}
        steps = divided(self.increments, factor, "bubble")
        return {PART: self.model(thickness, increments=tuple(steps))}

    def settings(self) -> Mapping[str, object]:
        names = (
            "elements",
            "symmetry",
            "generator",
            "pressures",
            "increments",
            "match_by",
            "match_degree",
            "objective",
            "displacement_offset",
            "pressure_offset",
            "weight",
        )
        said: dict[str, object] = {name: getattr(self, name) for name in names}
        said["outline"] = asdict(self.outline)
        if self.inflation != 1:
            said["inflation"] = self.inflation
        if self.cords:
            said["cords"] = repr(self.cords)
        if self.facet is not None:
            said["filter"] = asdict(self.facet)
        if self.registration:
            said["fitted_registration"] = dict(self.registration)
        if self.sheet != Sheet():
            said["sheet"] = asdict(self.sheet)
        if isinstance(self.data, PointFiles) and self.data.registration is not None:
            said["registration"] = asdict(self.data.registration)
        if isinstance(self.data, KnownSolution):
            known = asdict(self.data)
            said["known_solution"] = {**known, "beta": self.data.beta.tolist()}
        return said


def read(section: BubbleSection, place: Place, name: str) -> BubbleTest:
    """Return the test of a section; raises InputError naming the file and the dotted key."""
    points = section.data.points
    may_fall = points is not None and points.pressure is None
    for i, (before, after) in enumerate(pairwise(section.pressures or ()), start=1):
        if after == before or (after < before and (i == 1 or not may_fall)):
            problem = f"pressures must increase, got {after:g} after {before:g}"
            raise place.error(f"pressures[{i}]", problem)
    with place.naming():
        check_disk_memory(section.elements, section.symmetry)
    section = whole_in_base_units(section, place.scales)
    asked = None if section.pressures is None else tuple(section.pressures)
    measured = measured_files(section, place, asked)
    recorded = None if measured is None else measured.recorded
    pressures = asked if recorded is None else tuple(recorded.pressure.tolist())
    if pressures is None:
        problem = "this key is missing; add it, or say in [bubble.data.points.pressure] where each"
        raise place.error("pressures", f"{problem} frame's own stands")
    increments = default_increments(pressures)
    of_one = {
        "increments": section.increments is not None,
        "sheet.rim": section.sheet.rim == "measured",
    }
    for key, said in of_one.items():
        if said and list(pressures) != sorted(pressures):
            raise place.error(key, "is of one inflation, and inflation = 'all' takes several")
    if measured is None and section.inflation != 1:
        raise place.error("inflation", "expected 1: a known solution is inflated once")
    if section.increments is not None:
        increments = merge_increments(place, "increments", section.increments, pressures)
    clamp = None
    if section.radius == "clamp":
        if measured is None or not place.need_data:
            raise place.error("radius", "'clamp' is found in measured data; give the radius here")
        with place.naming(field="radius"):  # by points that stand still
            fields = measured_fields(place, measured, pressures)
            clamp, _ = clamp_radius(fields, measured.registration)
    outline = outline_of(section, place, clamp)
    source = measured or known_solution(section, place, pressures, increments)
    same = ("weight", "elements", "symmetry", "generator", "objective", "noise", "inflation")
    test = BubbleTest(
        name=name,
        place=place,
        outline=outline,
        pressures=pressures,
        increments=increments,
        data=source,
        match_by=section.match.by,
        match_degree=section.match.degree,
        displacement_offset=section.nuisance.displacement_offset,
        pressure_offset=section.nuisance.pressure_offset,
        facet=facet_of(section, place),
        sheet=sheet_of(section, place, pressures),
        of_clamp=section.radius == "clamp",
        registration=fitted_registration(section, place),
        cords=cords_of(section, place, outline),
        **{key: getattr(section, key) for key in same},
    )
    if test.cords:
        with place.naming():  # a quarter without a mirror image
            test.model()
    return test


def measured_fields(
    place: Place, data: PointFiles, pressures: Sequence[float]
) -> tuple[DisplacementField, ...]:
    """Read the fields at the pressures (MPa) as the files have them; raises InputError."""
    frames = None if data.recorded is None else data.recorded.frames
    with place.naming("data.points"):
        return read_fields(data.files, pressures, data.options, data.format, frames)


def apex_heights(model: BubbleModel, history: History) -> np.ndarray:
    """Return (frames,) mm."""
    apex = int(model.mesh.node_sets["apex"][0])
    return np.asarray(history.displacement[:, apex, 2])


def quantities(model: BubbleModel, history: History) -> dict[str, float]:
    """Return apex heights, and the largest in-plane displacement at the last pressure."""
    kilo = 1e3 * history.load
    heights = apex_heights(model, history)
    in_plane = np.linalg.norm(history.displacement[-1, :, :2], axis=1).max()
    values = {f"apex at {p:.4g} kPa, mm": float(z) for p, z in zip(kilo, heights, strict=True)}
    return {**values, f"largest in-plane displacement at {kilo[-1]:.4g} kPa, mm": float(in_plane)}


def responses(model: BubbleModel, history: History) -> dict[str, float]:
    """Return the largest displacement at every pressure, mm."""
    largest = np.linalg.norm(history.displacement, axis=2).max(axis=1)
    return {f"{p:.4g} kPa": float(u) for p, u in zip(1e3 * history.load, largest, strict=True)}


STUDIED = Studied(
    lambda model: model.increments, quantities, responses, response="largest displacement"
)
