"""Read the section [[cylinder]] of a project: keys of the model, wall of a beam, measured loads."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from ...meshes.beam_model import BeamModel, BraidedWall, PlainWall, TubeCrossSection
from ...meshes.cylinder_model import (
    DEFAULTS,
    Collar,
    Cord,
    Gas,
    RigidSupports,
    curve_reading,
    usual_collar,
)
from ...readers.bending import BendingCurve, loading_of, read_bending_curves
from ...readers.sections import whole_in_base_units
from ..sections import Place, listed_files, named_format
from .section import BentSection, CordSection, CylinderSection, MeasuredSection, WallSection
from .test import GRAVITY, CylinderTest

#: Edge length of an element, mm, unless the section gives it.
ELEMENT_SIZE = 25.0
#: Largest mass per area of one layer, kg/m^2; a larger number is probably in g/m^2.
LARGEST_MASS_PER_AREA = 50.0
#: Keys that may be left out, and words on the usual value that is then assumed.
ASSUMPTIONS = {
    "span": f"span ({RigidSupports().span:g} mm)",
    "seam_width": f"seam width ({DEFAULTS.seam_width:g} mm)",
    "length": f"length ({DEFAULTS.length:g} mm)",
    "collar": "collar",
    "support_diameter": f"diameter of the supports ({RigidSupports().diameter:g} mm)",
}
#: Keys of the section by names of the models' fields.
KEYS = {"supports.span": "span", "supports.diameter": "support_diameter", "size": "element_size"}
#: Keys that belong to one of the models only.
MODEL_KEYS = {
    "membrane": (
        "length",
        "seam_width",
        "symmetry",
        "support_diameter",
        "saddle",
        "mass_per_area",
        "collar",
        "cap_warp",
        "gas",
    ),
    "beam": (
        "wall",
        "load_spacing",
        "load_width",
        "roller_below_axis",
        "mass_per_length",
        "friction",
    ),
}
#: Keys of a plain wall of a beam, and of a braided one.
PLAIN_KEYS = ("axial", "hoop", "shear")
BRAID_KEYS = ("angle", "yarn", "yarn_shear", "bladder", "bladder_shear")


@dataclass(frozen=True)
class Shared:
    """Fields of `CylinderTest` that membranes and beams have in common, in base units."""

    name: str
    place: Place
    diameter: float
    deflections: tuple[float, ...]
    reads_files: bool
    cords: tuple[Cord, ...]


def read(section: BentSection, place: Place, name: str) -> CylinderTest:
    """Read a bent cylinder, as a membrane or a beam, from its section.

    Parameters
    ----------
    section : BentSection
        Section in the project's units.
    place : Place
        Place of the section in its project, for messages and files.
    name : str
        Name of the test.

    Raises
    ------
    InputError
        If keys do not belong to the model or make no valid one, or if measured files cannot be
        read.
    """
    is_beam = isinstance(section, CylinderSection) and section.model == "beam"
    other_model = "membrane" if is_beam else "beam"
    for key in MODEL_KEYS[other_model]:
        if key in section.model_fields_set:
            problem = f'is a key of model = "{other_model}"; take it out or change model'
            raise place.error(key, problem)
    converted = whole_in_base_units(section, place.scales)
    shared = Shared(
        name=name,
        place=place,
        diameter=converted.diameter,
        deflections=_deflections(converted),
        reads_files=bool(section.measured.files or place.measured),
        cords=tuple(_cord(c, place, f"cord[{i}]") for i, c in enumerate(converted.cord)),
    )
    if isinstance(section, CylinderSection) and is_beam:
        return _beam(section, shared)
    return _membrane(section, converted, shared)


def _deflections(section: BentSection) -> tuple[float, ...]:
    """Return the deflection (mm) of each frame of a section in base units."""
    if section.deflections is not None:
        return tuple(section.deflections)
    end = section.deflection or DEFAULTS.deflection
    steps = np.linspace(0.0, end, (section.frames or DEFAULTS.frames) + 1)
    return tuple(steps[1:].tolist())


def _membrane(section: BentSection, converted: BentSection, shared: Shared) -> CylinderTest:
    """Return the test of a membrane; InputError if no valid model can be made.

    `section` is in the project's units, `converted` the same in base units.
    """
    place = shared.place
    usual = RigidSupports()
    mass = converted.mass_per_area or 0.0
    if mass > LARGEST_MASS_PER_AREA:
        raise place.error("mass_per_area", f"expected kg/m^2, 0.9 for 900 g/m^2; got {mass:g}")
    seam_width = converted.seam_width
    with place.errors_name(keys=KEYS):
        collar, saddle = (
            None if ring is None else Collar(**ring.model_dump(exclude_none=True))
            for ring in (converted.collar, converted.saddle)
        )
        test = CylinderTest(
            **vars(shared),
            pressure=converted.pressure,
            length=converted.length or DEFAULTS.length,
            seam_width=DEFAULTS.seam_width if seam_width is None else seam_width,
            size=converted.element_size or ELEMENT_SIZE,
            symmetry=converted.symmetry,
            cap_warp=converted.cap_warp,
            supports=RigidSupports(
                converted.span or usual.span,
                converted.support_diameter or usual.diameter,
                saddle,
            ),
            mass_per_area=mass,
            collar=collar or usual_collar(converted.diameter),
            gas=Gas(**converted.gas.model_dump(exclude_none=True)),
            reading=curve_reading(converted.diameter, converted.places, converted.slope_over),
        )
        test.model()
    assumed = [words for key, words in ASSUMPTIONS.items() if getattr(converted, key) is None]
    return replace(test, measured=read_measured(section.measured, place), assumed=tuple(assumed))


def _cord(section: CordSection, place: Place, key: str) -> Cord:
    """Return a cord of a section; InputError names its key."""
    table = section.table(place, key)
    with place.errors_name(key):
        return Cord(table=table, **section.model_dump(exclude={"stiffness", "strain", "force"}))


def _wall(section: WallSection, pressure: float, place: Place) -> PlainWall | BraidedWall:
    """Return the wall at a pressure (in the project's unit), interpolated between those listed."""
    listed = section.pressure or [pressure]
    if not (np.diff(listed) > 0).all():
        raise place.error("wall.pressure", f"expected each above the last, got {listed}")
    if not listed[0] * (1 - 1e-9) <= pressure <= listed[-1] * (1 + 1e-9):
        ends = f"{listed[0]:g} to {listed[-1]:g}"
        raise place.error("pressure", f"{pressure:g} lies outside wall.pressure, {ends}")
    is_braid = section.yarn is not None
    keys = BRAID_KEYS if is_braid else PLAIN_KEYS
    _check_wall_keys(section, keys, PLAIN_KEYS if is_braid else BRAID_KEYS, place)
    optional = "across" if is_braid else "poisson"
    values = {
        key: _at_pressure(section, key, listed, pressure, place)
        for key in (*keys, optional)
        if getattr(section, key) is not None
    }
    with place.errors_name("wall"):
        if is_braid:
            return BraidedWall(**values)
        return PlainWall(**values, wrinkles=section.wrinkles)


def _check_wall_keys(
    section: WallSection,
    keys: Sequence[str],
    foreign_keys: Sequence[str],
    place: Place,
) -> None:
    """Raise InputError unless a wall has all keys of its kind, and none of the other kind."""
    missing = [key for key in keys if getattr(section, key) is None]
    misplaced = [key for key in foreign_keys if getattr(section, key) is not None]
    if missing or misplaced:
        problem = f"expected {', '.join(PLAIN_KEYS)}, or of a braid {', '.join(BRAID_KEYS)}"
        raise place.error(f"wall.{(missing or misplaced)[0]}", problem)


def _at_pressure(
    section: WallSection,
    key: str,
    listed: Sequence[float],
    pressure: float,
    place: Place,
) -> float:
    """Return a value of a wall that is one number, or a number for each listed pressure."""
    value = getattr(section, key)
    if not isinstance(value, list):
        return float(value)
    if len(value) != len(listed):
        raise place.error(f"wall.{key}", f"expected {len(listed)}, one a pressure, got {value}")
    return float(np.interp(pressure, listed, value))


def _beam(section: CylinderSection, shared: Shared) -> CylinderTest:
    """Return the test of a beam; InputError if no valid model can be made."""
    place = shared.place
    converted = whole_in_base_units(section, place.scales)
    if section.wall is None:
        raise place.error("wall", 'a beam (model = "beam") needs its stiffness per width; add it')
    wall = _wall(section.wall, section.pressure, place)
    for i, cord in enumerate(shared.cords):
        if not cord.bonded:
            problem = "one that slides is for a membrane; a beam takes bonded = true"
            raise place.error(f"cord[{i}].bonded", problem)
    with place.errors_name(keys={**KEYS, "angle": "wall.angle"}):
        tube = TubeCrossSection(0.5 * converted.diameter, converted.pressure, wall, shared.cords)
        beam = BeamModel(
            section=tube,
            span=converted.span or RigidSupports().span,
            deflections=list(shared.deflections),
            load_spacing=converted.load_spacing or 0.0,
            load_width=converted.load_width or 0.0,
            roller_below=converted.roller_below_axis or 0.0,
            weight=1e-3 * GRAVITY * (converted.mass_per_length or 0.0),
            friction=converted.friction or 0.0,
            size=converted.element_size or ELEMENT_SIZE,
            reading=curve_reading(converted.diameter, converted.places, converted.slope_over),
        )
    assumed = [ASSUMPTIONS["span"]] if section.span is None else []
    assumed.append("constant pressure while bending")
    if section.mass_per_length is None:
        assumed.append("weightless tube")
    return CylinderTest(
        **vars(shared),
        pressure=beam.pressure,
        length=beam.span,
        seam_width=0.0,
        size=beam.size,
        symmetry="quarter",
        cap_warp="x",
        supports=beam.supports,
        collar=beam.collar,
        gas=Gas(),
        reading=beam.reading,
        beam=beam,
        measured=read_measured(section.measured, place),
        assumed=tuple(assumed),
    )


def read_measured(section: MeasuredSection, place: Place) -> tuple[BendingCurve, ...]:
    """Read the measured repetitions, in memory or in the files that a section lists, if any."""
    folder = place.folder(section.folder)
    options: dict[str, Any] = {
        "deflection": section.deflection.channel,
        "load": section.load.channel,
        "format": named_format(place, "measured.format", "machine table", section.format),
    }
    for key in ("repetition", "preload", "zero", "comment", "decimal"):
        options[key] = getattr(section, key)
    curves: list[BendingCurve] = []
    for number, curve in enumerate(place.measured or ()):
        readings = replace(curve, load=curve.load + section.preload)
        curves.append(loading_of(readings, section.zero, f"curves[{number}]"))
    for file, key, _ in listed_files(place, folder, {None: section.files or []}, "measured.files"):
        if place.has(file, key):
            curves += read_bending_curves(file, **options)
    return tuple(curves)
