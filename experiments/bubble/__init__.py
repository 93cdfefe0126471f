"""The bubble inflation test: a clamped disk, inflated, its surface followed by stereo DIC."""

from collections.abc import Mapping, Sequence
from dataclasses import asdict, field
from itertools import pairwise
from typing import ClassVar, Literal

import numpy as np
from numpy.typing import NDArray

from ...lazy_modules import LazyFunction
from ...light_dataclasses import dataclass
from ...materials.card import State
from ...meshes.bubble_model import BubbleModel, SheetCord, default_increments
from ...meshes.disk import Outline, check_disk_memory, elliptic_disk_mesh
from ...meshes.sampling import Facet
from ...readers.fields import DisplacementField
from ...readers.histories import LoadHistory, Pace, pace_of
from ...readers.inflations import InflationChoice
from ...readers.sections import whole_in_base_units
from ...solvers.base import History
from ..base import BaseKind, Reach, Refined, SectionTest
from ..forward import Studied, divided
from ..sections import Place
from .point_files import PointFiles, measured_files
from .reading_tables import read_readings
from .readings import GaugeReadings
from .registration import clamp_radius
from .section import (
    BubbleSection,
    SheetSettings,
    Symmetry,
    cords_of,
    facet_of,
    fitted_registration,
    outline_of,
    sheet_of,
    with_units,
)


def merge_increments(
    place: Place,
    field: str,
    extra: Sequence[float],
    pressures: Sequence[float],
) -> tuple[float, ...]:
    """Return the load increments: the pressures that are reported, and extra steps between them.

    Parameters
    ----------
    place : Place
    field : str
        Key of the extra steps in the section, which messages name.
    extra : sequence of float, MPa
        Extra steps; those that are equal to a pressure count once.
    pressures : sequence of float, MPa
        Pressures that are reported, rising.

    Raises
    ------
    InputError
        An extra step lies beyond the last pressure.
    """
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
    """Data of a test that are computed with the forward model and a known law.

    Attributes
    ----------
    beta : (n,) array, MPa
        Coefficients of the law.
    form : str
        Form of the law.
    elements : int
        Number of quads of the full disk.
    increments : tuple of float, MPa
        Pressures of the load increments.
    symmetry : {"full", "quarter"}
        Part of the disk that the model has.
    solver : str or None
        Name of the solver; None for that of the fit.
    recorded : None
        Always None: there are no recorded frames to choose among.
    """

    beta: NDArray[np.float64]
    form: str
    elements: int
    increments: tuple[float, ...]
    symmetry: Literal["full", "quarter"]
    solver: str | None = None
    recorded: ClassVar[None] = None


def known_solution(
    section: BubbleSection,
    place: Place,
    pressures: Sequence[float],
    steps: tuple[float, ...],
) -> KnownSolution:
    """Return the known solution that a section describes.

    Parameters
    ----------
    steps : tuple of float
        Increments (MPa) that are used where the section of the solution gives none.
    """
    solution = section.data.known_solution
    assert solution is not None
    if solution.increments is not None:
        field_name = "data.known_solution.increments"
        steps = merge_increments(place, field_name, solution.increments, pressures)
    return KnownSolution(
        beta=np.array(solution.beta),
        form=solution.form,
        elements=solution.elements or section.elements,
        increments=steps,
        symmetry=solution.symmetry or section.symmetry,
        solver=solution.solver,
    )


#: Name of the one part of a bubble test.
PART = "bubble"


@dataclass(frozen=True, eq=False, kw_only=True)
class BubbleTest(SectionTest):
    """A bubble test: a disk of fabric, clamped at its rim, that is inflated.

    Attributes
    ----------
    outline : Outline, mm
        The rim.
    elements : int
        Number of quads of the full disk.
    symmetry : {"full", "quarter"}
        Part of the disk that the model has.
    generator : {"blocks", "gmsh"}
        What makes the mesh.
    pressures : tuple of float, MPa
        The pressures at which displacements are matched and reported.
    increments : tuple of float, MPa
        Pressures of the load increments, which contain `pressures`.
    data : KnownSolution, PointFiles or GaugeReadings
        Where the displacements are from, or what was read without a camera.
    match_by : {"surfaces", "points"}
        Whether the model is compared with polynomial surfaces fitted to the data, or with points.
    match_degree : int
        Degree of these polynomials.
    objective : {"e", "mm"}
        Whether errors are relative to the largest displacements, or in mm.
    displacement_offset, pressure_offset : bool
        Whether the fit has an unknown offset of the displacements, and of the pressures.
    height_offset : float, mm, or None
        Standard deviation of the zero of each height gauge; None where it is known.
    height_scale : float or None
        Relative standard deviation of the scale of all heights; None where it is known.
    sheet : SheetSettings
    facet : Facet or None
        The filter of the image correlation, with which the model's displacements are read; None
        reads them at points.
    of_clamp : bool
        Whether the radius is that of the clamp, found in the data.
    nominal_radius : float, mm, or None
        Radius of the clamp by a ruler, which that of the data is compared with.
    registration : mapping of str to float
        Standard deviation (degrees, mm) of the prior of each unknown of the registration that is
        fitted.
    inflation : int or "all"
        Number (from 1) of the inflation whose frames are used, or those of all.
    cords : tuple of SheetCord
        Cords bonded to the sheet.
    noise : float, mm, or None
        Standard deviation of one displacement, where the section says it.
    """

    setting_names: ClassVar[tuple[str, ...]] = (
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
        "noise",
    )

    outline: Outline
    elements: int
    symmetry: Symmetry
    generator: Literal["blocks", "gmsh"]
    pressures: tuple[float, ...]
    increments: tuple[float, ...]
    data: KnownSolution | PointFiles | GaugeReadings
    match_by: Literal["surfaces", "points"]
    match_degree: int
    objective: Literal["e", "mm"]
    displacement_offset: bool
    pressure_offset: bool
    sheet: SheetSettings
    facet: Facet | None = None
    of_clamp: bool = False
    nominal_radius: float | None = None
    registration: Mapping[str, float] = field(default_factory=dict)
    inflation: InflationChoice = 1
    cords: tuple[SheetCord, ...] = ()
    height_offset: float | None = None
    height_scale: float | None = None
    kind: str = "bubble"
    reach: ClassVar[Reach] = Reach()  # known only when its law is

    @property
    def state(self) -> State:
        """Return "conditioned" where only a later inflation is used, else "first loading"."""
        return "first loading" if self.inflation in (1, "all") else "conditioned"

    @property
    def rising(self) -> int:
        """Return the number of pressures before the first one that falls."""
        falls = np.diff(self.pressures) < 0
        return int(np.argmax([*falls, True])) + 1

    @property
    def pace(self) -> Pace:
        """Return the rate of strain and the longest hold; unknown unless pressures are from a log.

        The strain is 2/3 (h/R)^2, that of a spherical cap of height h on a rim of radius R.
        """
        recorded = self.data.recorded
        clock = None if recorded is None else recorded.clock
        if clock is None:
            return Pace()
        is_measured = np.isfinite(clock.pressure + clock.heights)
        strain = 2.0 / 3.0 * (clock.heights[is_measured] / self.outline.radius) ** 2
        pressure = clock.pressure[is_measured]
        times = clock.times[is_measured]
        return pace_of([LoadHistory(self.place.path, pressure, strain, times)])

    @property
    def reads_files(self) -> bool:
        return not isinstance(self.data, KnownSolution)

    def model(
        self,
        thickness: float | None = None,
        elements: int | None = None,
        symmetry: Symmetry | None = None,
        increments: tuple[float, ...] | None = None,
    ) -> BubbleModel:
        """Return the test's model, or one of the same disk with another mesh or increments.

        Parameters are those of the test unless they are given: thickness (mm), elements (number of
        quads of the full disk), symmetry, increments (MPa).
        """
        mesh = elliptic_disk_mesh(
            self.outline, elements or self.elements, symmetry or self.symmetry, self.generator
        )
        steps = increments or self.increments
        unloaded = self.rising < len(self.pressures)
        return BubbleModel(
            mesh,
            self.thick(thickness),
            self.pressures,
            steps,
            unloaded=unloaded,
            tension=self.sheet.tension,
            cords=self.cords,
        )

    def models(
        self, thickness: float | None = None, refined: Refined = "elements", factor: float = 1.0
    ) -> Mapping[str, BubbleModel]:
        """Return the one model, with edges of its quads or its increments divided by a factor."""
        model = self.model(thickness)
        if factor == 1:
            return {PART: model}
        if refined == "elements":
            # From the count that the mesh has, not the one asked for: finer meshes divide quads.
            quads_of_disk = len(model.mesh.quads) * (4 if self.symmetry == "quarter" else 1)
            return {PART: self.model(thickness, elements=round(quads_of_disk * factor**2))}
        steps = divided(self.increments, factor, "bubble")
        return {PART: self.model(thickness, increments=tuple(steps))}

    def settings(self) -> Mapping[str, object]:
        settings = {**super().settings(), "outline": asdict(self.outline)}
        if self.inflation != 1:
            settings["inflation"] = self.inflation
        if self.cords:
            settings["cords"] = repr(self.cords)
        if self.facet is not None:
            settings["filter"] = asdict(self.facet)
        if self.height_offset is not None:
            settings["height_offset"] = self.height_offset
        if self.height_scale is not None:
            settings["height_scale"] = self.height_scale
        if self.registration:
            settings["fitted_registration"] = dict(self.registration)
        if self.sheet != SheetSettings():
            settings["sheet"] = asdict(self.sheet)
        if isinstance(self.data, PointFiles) and self.data.registration is not None:
            settings["registration"] = asdict(self.data.registration)
        if isinstance(self.data, KnownSolution):
            beta = self.data.beta.tolist()
            settings["known_solution"] = {**asdict(self.data), "beta": beta}
        return settings


def read(section: BubbleSection, place: Place, name: str) -> BubbleTest:
    """Return the bubble test that a section describes.

    Parameters
    ----------
    section : BubbleSection
        In the units of the project.
    place : Place
    name : str
        Name of the test.

    Raises
    ------
    InputError
        Names the file and the dotted key.
    """
    _check_order(section, place)
    with place.errors_name():
        check_disk_memory(section.elements, section.symmetry)
    section = whole_in_base_units(section, place.scales)
    listed = None if section.pressures is None else tuple(section.pressures)
    measured = measured_files(section, place, listed)
    readings = read_readings(section, place)
    if readings is not None:
        listed = readings.frame_pressures(listed)
        readings = readings.within(listed)
    pressures = _pressures_of(measured, listed, place)
    _check_inflations(section, place, pressures, section.data.known_solution is None)
    increments = default_increments(pressures)
    if section.increments is not None:
        increments = merge_increments(place, "increments", section.increments, pressures)
    clamp = None
    if section.radius == "clamp":
        clamp = _radius_of_clamp(measured, place, pressures)
    outline = outline_of(section, place, clamp)
    test = BubbleTest(
        name=name,
        place=place,
        weight=section.weight,
        noise=section.noise,
        outline=outline,
        elements=section.elements,
        symmetry=section.symmetry,
        generator=section.generator,
        pressures=pressures,
        increments=increments,
        data=measured or readings or known_solution(section, place, pressures, increments),
        match_by=section.match.by,
        match_degree=section.match.degree,
        objective=section.objective,
        displacement_offset=section.nuisance.displacement_offset,
        pressure_offset=section.nuisance.pressure_offset,
        facet=facet_of(section, place),
        sheet=sheet_of(section, place, pressures),
        of_clamp=section.radius == "clamp",
        nominal_radius=section.nominal_radius,
        registration=fitted_registration(section, place),
        inflation=section.inflation,
        cords=cords_of(section, place, outline),
        height_offset=section.nuisance.height_offset,
        height_scale=section.nuisance.height_scale,
    )
    if test.cords:
        with place.errors_name():  # a quarter without a mirror image
            test.model()
    return test


def _check_order(section: BubbleSection, place: Place) -> None:
    """Refuse listed pressures that do not rise; after the second, those of inflations may fall."""
    points = section.data.points
    may_fall = points is not None and points.pressure is None
    for i, (lower, pressure) in enumerate(pairwise(section.pressures or ()), start=1):
        if pressure == lower or (pressure < lower and (i == 1 or not may_fall)):
            problem = f"pressures must increase, got {pressure:g} after {lower:g}"
            raise place.error(f"pressures[{i}]", problem)


def _pressures_of(
    measured: PointFiles | None, listed: tuple[float, ...] | None, place: Place
) -> tuple[float, ...]:
    """Return the pressures (MPa) of the recorded frames, else those that the section lists."""
    recorded = None if measured is None else measured.recorded
    if recorded is not None:
        return tuple(recorded.pressure.tolist())
    if listed is None:
        problem = "this key is missing; add it, or say in [bubble.data.points.pressure] where each"
        raise place.error("pressures", f"{problem} frame's own stands")
    return listed


def _check_inflations(
    section: BubbleSection,
    place: Place,
    pressures: Sequence[float],
    is_measured: bool,
) -> None:
    """Refuse keys that apply to a single inflation where several are used.

    Refuse several inflations of a known solution, too.
    """
    keys_of_one_inflation = {
        "increments": section.increments is not None,
        "sheet.rim": section.sheet.rim == "measured",
    }
    for key, is_set in keys_of_one_inflation.items():
        # The pressures of one inflation rise; they fall where a release is taken, too.
        if is_set and list(pressures) != sorted(pressures):
            raise place.error(key, "is of one inflation, and inflation = 'all' takes several")
    if not is_measured and section.inflation != 1:
        raise place.error("inflation", "expected 1: a known solution is inflated once")


def _radius_of_clamp(
    measured: PointFiles | None, place: Place, pressures: Sequence[float]
) -> float:
    """Return the radius (mm) beyond which the measured points stand still."""
    if measured is None or not place.need_data:
        raise place.error("radius", "'clamp' is found in measured data; give the radius here")
    with place.errors_name(field="radius"):
        fields = measured_fields(place, measured, pressures)
        radius, _ = clamp_radius(fields, measured.registration)
    return radius


def measured_fields(
    place: Place, data: PointFiles, pressures: Sequence[float]
) -> tuple[DisplacementField, ...]:
    """Return the measured fields at the pressures (MPa), in the coordinates of the files."""
    with place.errors_name("data.points"):
        return data.read_fields(pressures)


def apex_heights(model: BubbleModel, history: History) -> np.ndarray:
    """Return the rise of the apex in each frame of a history, (frames,) mm."""
    apex = int(model.mesh.node_sets["apex"][0])
    return history.displacement[:, apex, 2]


def quantities(model: BubbleModel, history: History) -> dict[str, float]:
    """Return what a study of the mesh compares, by name.

    They are the rise of the apex at each pressure, and the largest in-plane displacement at last.
    """
    kilo = 1e3 * history.load
    heights = apex_heights(model, history)
    in_plane = np.linalg.norm(history.displacement[-1, :, :2], axis=1).max()
    values = {f"apex at {p:.4g} kPa, mm": float(z) for p, z in zip(kilo, heights, strict=True)}
    return {**values, f"largest in-plane displacement at {kilo[-1]:.4g} kPa, mm": float(in_plane)}


def responses(model: BubbleModel, history: History) -> dict[str, float]:
    """Return what a study of nu12 compares: the largest displacement at each pressure, mm."""
    largest = np.linalg.norm(history.displacement, axis=2).max(axis=1)
    pressures = 1e3 * history.load
    return {
        f"{pressure:.4g} kPa": float(displacement)
        for pressure, displacement in zip(pressures, largest, strict=True)
    }


STUDIED = Studied(
    lambda model: model.increments, quantities, responses, response="largest displacement"
)


class BubbleKind(BaseKind):
    """The kind of [[bubble]] in a project."""

    name = "bubble"
    title = "a bubble inflation test"
    folder_key = "data.points.folder data.heights.folder data.profiles.folder data.apex.folder"
    section = BubbleSection
    fitted = True
    studied = STUDIED
    doubts = (
        "frame-numbers",
        "pressure-log",
        "exchanged",
        "length-unit",
        "zero-points",
        "outliers",
        "repeated-points",
        "z-flipped",
        "frame-order",
        "repeated-frame",
        "rest-frame",
        "deformed-coordinates",
        "radius",
        "axis-flipped",
        "strain-rise",
        "pressure-unit",
        "height-flipped",
        "flat-sheet",
        "loaded-reference",
        "moving-edge",
        "camera-frame",
        "off-centre",
        "tilted",
        "turned",
        "swapped",
        "height-falls",
        "height-unit",
        "not-zeroed",
        "left-out",
    )
    read = staticmethod(read)
    prepare = LazyFunction(f"{__name__}.prepared_readings", "prepare")
    candidates = LazyFunction(f"{__name__}.planning", "candidates")
    with_units = staticmethod(with_units)


KIND = BubbleKind()
