"""Tests, sheets and laws as Python objects, in place of the tables of a project file.

Numbers are in mm, N and MPa.

`Bubble(points, displacements, pressures, radius=100.0)` is what [[bubble]] says with the data in
memory; `Bubble.read(files, ...)` names files, `Bubble.of(radius=..., data={...})` says each key as
the file does. Keywords are the keys of [[bubble]] and of the table of its data. An object holds its
arrays as the records that readers make of files (`Frame`, `LoadCurve`, ...), so that all that
follows is the same for both; they become files where a project or a run is written.
"""

from __future__ import annotations

import os
import reprlib
import textwrap
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any, ClassVar, Self, TypeAlias, Unpack

import numpy as np
from pydantic import BaseModel, ValidationError

from ..errors import InputError
from ..experiments.bubble.section import RegistrationSection, SheetSection
from ..experiments.data_files import Output, arrays_checksum
from ..experiments.registry import kind_named
from ..experiments.sections import Fabric, ObjectPlace, Scales, argument_of
from ..light_dataclasses import dataclass
from ..materials.forms.base import UNLIMITED, form_named, form_names, form_settings
from ..materials.forms.symmetry import MODULI
from ..readers.curves import DIRECTIONS, cut_of
from ..readers.frames import frame_files
from ..readers.sections import first_error, model_of, unit_doubts
from ..storage.reading import is_file, missing_file_reason
from ..storage.writing import write_text
from .arrays import (
    BIAXIAL_COLUMNS,
    Numbers,
    Table,
    array_files,
    arrays_of,
    arrays_of_table,
    bending_curves_of_arrays,
    biaxial_tables_of_arrays,
    check_names,
    csv_text,
    curves_of_arrays,
    frames_of_arrays,
    is_table,
    rising_pressures,
)
from .keys import (
    BiaxialFileKeys,
    BiaxialKeys,
    BubbleFileKeys,
    BubbleKeys,
    CylinderFileKeys,
    CylinderKeys,
    DeckKeys,
    LawKeys,
    RegistrationKeys,
    SheetKeys,
    StripsFileKeys,
    StripsKeys,
)
from .schema import LawSection

#: Files by name or by pattern.
Files: TypeAlias = str | Path | Sequence[str | Path]

#: Stands for the path of the project file in a project that is made from objects.
PYTHON = Path("python")
#: Bounds of coated fabrics as `bubblefit init` writes them, MPa.
BOUNDS = {"E1": [20.0, 2000.0], "E2": [20.0, 1000.0], "G12": [1.0, 200.0]}
#: Values of keys of files that say what arrays are.
TRUE_OF_ARRAYS: Mapping[str, tuple[str, ...]] = {
    "load_unit": ("N", "N/mm", "kN/m"),
    "strain_unit": ("mm/mm",),
    "length_unit": ("mm",),
    "decimal": (".",),
    "format": ("csv",),
}
#: Keys of the tables of data that say where data come from.
DATA_SOURCES = (
    "files",
    "directions",
    "pairs",
    "pattern",
    "polynomials",
    "known_solution",
    "heights",
    "profiles",
    "apex",
    "compare",
)
#: What is said of a key that names another unit.
IN_BASE_UNITS = "numbers in Python are in mm, N and MPa: convert them, and leave it out"
#: Units of the numbers in objects.
BASE_UNITS = Scales(1.0, 1.0, 1.0, "MPa", "MPa", "mm")


def plain(value: Any) -> Any:
    """Return plain values as TOML has them: without None, arrays as lists, paths as text."""
    if isinstance(value, Keys):
        return value.values
    if isinstance(value, Mapping):
        return {str(k): plain(v) for k, v in value.items() if v is not None}
    if isinstance(value, (list, tuple)):
        return [plain(v) for v in value]
    if isinstance(value, (np.ndarray, np.generic)):
        return value.tolist()
    return str(value) if isinstance(value, Path) else value


def checked_keys(section: type[BaseModel], keys: Mapping[str, Any]) -> dict[str, Any]:
    """Return the keys of a table as plain values; raise InputError naming an invalid one."""
    values: dict[str, Any] = plain(keys)
    try:
        section.model_validate(values)
    except ValidationError as errors:
        raise first_error(None, errors, section) from None
    return values


class Keys:
    """Base of objects that hold the keys of one table of a project file, checked, in `values`."""

    section: ClassVar[type[BaseModel]]

    def __init__(self, **keys: Any) -> None:
        self.values = checked_keys(self.section, keys)

    def __repr__(self) -> str:
        return _shown(type(self).__name__, self.values)

    @classmethod
    def of(cls, keys: Mapping[str, Any]) -> Self:
        """Return an object with these keys alone, without the defaults of the class."""
        instance = cls.__new__(cls)
        instance.values = checked_keys(cls.section, keys)
        return instance


class Sheet(Keys):
    """The sheet of a bubble.

    Parameters
    ----------
    **keys
        Keys of [bubble.sheet], where `prior` and `misfit` are in mm.

    Raises
    ------
    InputError
        An unknown key, or a wrong value.
    """

    section = SheetSection

    def __init__(self, **keys: Unpack[SheetKeys]) -> None:
        super().__init__(**keys)


class Registration(Keys):
    """The registration of a bubble: which of its steps are given and not found from the data.

    Parameters
    ----------
    **keys
        Keys of [bubble.data.points.registration], with lengths in mm and angles in degrees.

    Raises
    ------
    InputError
        An unknown key, or a wrong value.
    """

    section = RegistrationSection

    def __init__(self, **keys: Unpack[RegistrationKeys]) -> None:
        super().__init__(**keys)


class Law(Keys):
    """The form of the moduli as functions of strain, and the bounds of the moduli.

    Parameters
    ----------
    form : str, class or object
        The name of a form, or a form of one's own: a subclass of `bubblefit.Form` or its object.
    **keys
        Keys of [law]: `bounds`, the [smallest, largest] values of E1, E2 and G12 in MPa, by default
        those of coated fabrics; `nu12`, `symmetry`, `strain_range`, `margin`, `closed_path`,
        `memory`. All other keys are settings of the form, such as `knots`.

    Raises
    ------
    InputError
        An unknown form or key, or a wrong value.
    """

    section = LawSection
    #: The form if it was given as a Python object or class; None if it has a name.
    form_object: Any = None

    def __init__(self, form: Any = "cubic", **keys: Unpack[LawKeys]) -> None:
        name = form
        if not isinstance(form, str):
            self.form_object = form
            name = form.__name__ if isinstance(form, type) else type(form).__name__
        elif form not in form_names():
            form_named(form, {}, [UNLIMITED] * 3)  # says which there are
        check_names(keys, [*LawSection.model_fields, *form_settings(name)])
        moduli = MODULI.get(keys.get("symmetry", "orthotropic"), BOUNDS)
        bounds = {modulus: BOUNDS[modulus] for modulus in moduli}
        super().__init__(**{"form": name, "bounds": bounds, **keys})


@dataclass(frozen=True, eq=False, repr=False)
class Definition:
    """A test as an object: the contents of its table in a project file, in mm, N and MPa.

    Attributes
    ----------
    kind : str
    section : mapping
        Keys of the table, with full paths of files.
    measured : tuple or None
        Data in memory as the records of the kind of test, one for each series (`Frame`,
        `LoadCurve`, ...). None if the section names files, or if there are no data.
    function : callable or None
        A function of the user's that serves as the objective of the test.
    """

    kind: str
    section: Mapping[str, Any]
    measured: tuple[Any, ...] | None = None
    function: Callable[..., Any] | None = None

    of_kind: ClassVar[str]
    #: Name of the first argument that takes data; None for a class that needs no data.
    data_argument: ClassVar[str | None] = None
    #: Keys of the table of data that also apply to arrays; all others say how files are read.
    keys_of_arrays: ClassVar[tuple[str, ...]] = ()

    def __post_init__(self) -> None:
        keys = dict(self.section)
        if callable(keys.get("objective")):
            object.__setattr__(self, "function", keys.pop("objective"))
        section = kind_named(self.kind).section
        try:
            keys = checked_keys(section, keys)
        except InputError as error:
            raise InputError(None, self.argument(error.field), error.problem) from None
        for key, problem in unit_doubts(section, keys, BASE_UNITS):
            raise InputError(None, self.argument(key), problem)
        if self.measured is not None:
            self._check_keys_of_data(table_below(keys, data_table(self.kind)))
        object.__setattr__(self, "section", keys)

    def _check_keys_of_data(self, table: Mapping[str, Any]) -> None:
        """Raise InputError if arrays are given with keys on reading files that contradict them."""
        for key, value in table.items():
            if key not in self.keys_of_arrays and value not in TRUE_OF_ARRAYS.get(key, ()):
                problem = "is of files, and arrays are given; leave it out"
                if key.endswith("_unit"):
                    problem = IN_BASE_UNITS
                raise InputError(None, key, problem)

    def __repr__(self) -> str:
        class_name = type(self).__name__
        if self.measured is None:
            return _shown(class_name, self.section)
        number = len(self.measured)
        records = type(self.measured[0]).__name__
        return f"{_shown(class_name, self.section)} with {number} {records} in memory"

    @property
    def name(self) -> str:
        """Return the name of the test, by default that of its kind."""
        return str(self.section.get("name", self.kind))

    @classmethod
    def of(cls, **section: Any) -> Self:
        """Return the test whose table in a project file has these keys, in mm, N and MPa."""
        return cls._made(cls.of_kind, section)

    @classmethod
    def _made(cls, *attributes: Any) -> Self:
        """Return an object with these attributes of `Definition`, without its own `__init__`."""
        instance = cls.__new__(cls)
        Definition.__init__(instance, *attributes)
        return instance

    def with_keys(self, **keys: Any) -> Definition:
        """Return the test with other values of some keys of its section."""
        return self._made(self.kind, {**self.section, **keys}, self.measured, self.function)

    def argument(self, field: str) -> str:
        """Return the name of the argument that sets a dotted key of the section."""
        return argument_of(field, data_table(self.kind))

    def place(self, fabric: Fabric, need_data: bool) -> ObjectPlace:
        """Return what the reading of the test needs: its name for errors, units, fabric, arrays.

        Raise InputError if data are needed and none are given; whether files exist is checked by
        the readers.
        """
        if need_data and self.data_argument is not None and not self.has_data:
            problem = "is needed, or `read` of files: without data a test is simulated, not fitted"
            raise InputError(self.name, self.data_argument, problem)
        return ObjectPlace(
            path=PYTHON,
            at=self.name,
            fabric=fabric,
            scales=BASE_UNITS,
            need_data=need_data,
            measured=self.measured,
            data_table=data_table(self.kind),
        )

    @property
    def has_data(self) -> bool:
        """Return whether the test has arrays, names files, or is computed."""
        keys = {
            *table_below(self.section, "data"),
            *table_below(self.section, data_table(self.kind)),
        }
        return self.measured is not None or not keys.isdisjoint(DATA_SOURCES)

    def write_data(self, folder: Path) -> Path:
        """Write the arrays as CSV files below a folder, and return the folder of these files.

        The name of that folder has a checksum of the arrays, so that no other data are overwritten.

        Raises
        ------
        OutputError
            A file cannot be written.
        """
        data_folder = self.data_folder(folder)
        for name, columns in array_files(self.measured or ()).items():
            write_text(data_folder / name, csv_text(columns()))
        return data_folder

    def data_folder(self, folder: Path) -> Path:
        """Return the folder for the files of the arrays, below `folder`."""
        arrays = [array for record in self.measured or () for array in arrays_of(record)]
        digest = arrays_checksum(arrays)[:8]
        return folder / f"{Output.of(Path(), self.name, True).prefix}{digest}"

    def section_with_files(self, folder: Path, relative_to: Path | None = None) -> dict[str, Any]:
        """Return the section with the names of the files that `write_data` writes.

        Parameters
        ----------
        folder : Path
            Folder below which `write_data` writes the files.
        relative_to : Path, optional
            Folder to which paths in the section are relative; by default they are full paths.
        """
        keys = {
            "folder": path_from(self.data_folder(folder), relative_to),
            "files": list(array_files(self.measured or ())),
        }
        if self.of_kind == "bubble":
            keys["format"] = "csv"  # saves the time to recognise the format of each file
        section = dict(self.section)
        for key, value in keys.items():
            section = _with_key(section, f"{data_table(self.kind)}.{key}", value)
        return section


def path_from(path: Path, folder: Path | None) -> str:
    """Return a path relative to a folder, or the full path if that is None."""
    return os.path.abspath(path) if folder is None else path.relative_to(folder).as_posix()


def definition_of(kind: str, section: Mapping[str, Any]) -> Definition:
    """Return the object of a test from its section, in the class of its kind."""
    classes = (Bubble, Strips, Biaxial, Cylinder, Deck)
    for definition_class in classes:
        if definition_class.of_kind == kind:
            return definition_class.of(**section)
    return Definition(kind, section)


class Bubble(Definition):
    """A bubble inflation test: a clamped disk under pressure, with its measured points.

    The x axis is along warp, y along fill, and z is up. A bubble without points can be simulated
    but not fitted.

    Parameters
    ----------
    points : (m, 3) array, (frames, m, 3) array, or a sequence of (m, 3) arrays, mm
        Positions without load, either the same for all frames or for each. Or a DataFrame of both
        positions and displacements, with columns x, y, z, dx, dy, dz and frame or pressure.
    displacements : (frames, m, 3) array, or a sequence of (m, 3) arrays, mm
        Displacements from the positions without load, in each frame; NaN for a lost point.
    pressures : (frames,) array, MPa
        Pressure of each frame, rising.
    radius : float or "clamp", mm
        Radius of the clamped edge; "clamp" finds it from points that were measured on the clamp.
    ellipse : mapping, optional
        For an elliptic edge, in place of the radius: the semi-axes `major` and `minor` in mm, and
        the `angle` in degrees.
    sheet : Sheet or mapping, optional
    registration : Registration or mapping, optional
        For points in the coordinates of a camera. `Registration()` finds all its steps.
    name : str
    **keys
        Keys of [[bubble]] and of [bubble.data.points]: `elements`, `noise` (mm), `nuisance` ...

    Raises
    ------
    InputError
        Names the argument whose shape, number or unit is wrong.
    """

    of_kind = "bubble"
    data_argument = "points"
    keys_of_arrays = (
        "registration",
        "filter",
        "correlation",
        "pressure",
        "coordinates",
        "camera_axes",
    )

    def __init__(
        self,
        points: Numbers | Table = None,
        displacements: Numbers = None,
        pressures: Numbers = None,
        *,
        radius: float | str | None = None,
        ellipse: Mapping[str, float] | None = None,
        sheet: Sheet | Mapping[str, Any] | None = None,
        registration: Registration | Mapping[str, Any] | None = None,
        name: str = "bubble",
        **keys: Unpack[BubbleKeys],
    ) -> None:
        if is_table(points):
            points, displacements, pressures = arrays_of_table(points, pressures)
        frames = None
        if points is not None or displacements is not None:
            frames = frames_of_arrays(points, displacements)
        arguments = {
            "pressures": rising_pressures(pressures, None if frames is None else len(frames)),
            "radius": radius,
            "ellipse": ellipse,
            "sheet": sheet,
            "name": name,
            "registration": registration,
        }
        section = _section_of("bubble", {**arguments, **keys})
        if "known_solution" not in section.setdefault("data", {}):
            section["data"] = {"points": {}, **section["data"]}
        super().__init__("bubble", section, frames)

    @classmethod
    def read(cls, files: Files, pressures: Numbers = None, **keys: Unpack[BubbleFileKeys]) -> Self:
        """Return the test with the data of files in any format, in the order of rising pressure.

        Parameters
        ----------
        files : path or pattern, or a sequence of them
            One file for each frame, or a single file of all frames.
        pressures : (frames,) array, MPa, optional
            Pressure of each frame; None if the key `pressure` says where the files have it.
        **keys
            Further arguments of `Bubble`.

        Raises
        ------
        InputError
            No such file, or a wrong argument.
        """
        loads = {} if pressures is None else {"pressures": rising_pressures(pressures, None)}
        return cls.of(**_section_of("bubble", {**keys, **loads, "files": file_names(files)}))

    @classmethod
    def heights(
        cls,
        pressures: Numbers,
        heights: Numbers,
        *,
        places: Numbers = None,
        specimens: Sequence[str | int] | None = None,
        moves_with_sheet: bool = False,
        **keys: Unpack[BubbleFileKeys],
    ) -> Self:
        """Return the test of a bubble without a camera, whose height was measured by gauges.

        Parameters
        ----------
        pressures : (n,) array, MPa
            In the order of the readings.
        heights : (n,) or (places, n) array, mm
            Above the sheet before the test, at one place or at several.
        places : (places, 2) array, mm, optional
            Coordinates of the gauges along warp and fill from the centre; the apex by default.
        specimens : sequence of n str or int, optional
            Specimen of each reading, where there are several.
        moves_with_sheet : bool
            Whether places are points of the sheet before the test, not those of still gauges.
        **keys
            Keys of [[bubble]]: `radius`, `elements`, `noise` (mm), `nuisance` ...

        Raises
        ------
        InputError
            Names the argument whose shape, number or unit is wrong.
        """
        values = {"pressure": pressures, "height": heights, "specimen": specimens}
        settings = {"places": places, "moves_with_sheet": moves_with_sheet}
        return cls._of_readings("heights", values, settings, keys)

    @classmethod
    def profiles(
        cls,
        pressures: Numbers,
        distances: Numbers,
        heights: Numbers,
        *,
        axes: Sequence[str] | None = None,
        direction_deg: float = 0.0,
        moves_with_sheet: bool = False,
        **keys: Unpack[BubbleFileKeys],
    ) -> Self:
        """Return the test of a bubble whose heights were measured along lines through its centre.

        Parameters
        ----------
        pressures, distances, heights : (n,) arrays, MPa, mm, mm
            A point each: the pressure, its place along the line from the centre, and its height.
        axes : sequence of n str, optional
            Line of each point: "x" (warp), "y" (fill), or degrees from the warp.
        direction_deg : float
            Direction of the one line without `axes`, degrees from the warp.
        moves_with_sheet : bool
            Whether distances are those of points of the sheet before the test.
        **keys
            Keys of [[bubble]].

        Raises
        ------
        InputError
            Names the argument whose shape, number or unit is wrong.
        """
        values = {"pressure": pressures, "coordinate": distances, "height": heights, "axis": axes}
        settings = {"direction_deg": direction_deg, "moves_with_sheet": moves_with_sheet}
        return cls._of_readings("profiles", values, settings, keys)

    @classmethod
    def apex(
        cls,
        pressures: Numbers,
        *,
        curvature_warp: Numbers = None,
        curvature_fill: Numbers = None,
        strain_warp: Numbers = None,
        strain_fill: Numbers = None,
        span: float | None = None,
        **keys: Unpack[BubbleFileKeys],
    ) -> Self:
        """Return the test of a bubble whose curvature or strain was measured at the apex.

        Parameters
        ----------
        pressures : (n,) array, MPa
            In the order of the readings.
        curvature_warp, curvature_fill : (n,) array, 1/mm, optional
            One over the radius of curvature, of either sign; not the a of z = a x^2.
        strain_warp, strain_fill : (n,) array, optional
            Engineering strains (0.01 is 1 %).
        span : float, mm, optional
            Length over which they are measured; a fifth of the radius unless given.
        **keys
            Keys of [[bubble]].

        Raises
        ------
        InputError
            Names the argument whose shape, number or unit is wrong.
        """
        values = {
            "pressure": pressures,
            "curvature_warp": curvature_warp,
            "curvature_fill": curvature_fill,
            "strain_warp": strain_warp,
            "strain_fill": strain_fill,
        }
        return cls._of_readings("apex", values, {"span": span}, keys)

    @classmethod
    def _of_readings(
        cls,
        table: str,
        values: Mapping[str, Any],
        settings: Mapping[str, Any],
        keys: Mapping[str, Any],
    ) -> Self:
        """Return the test with a table of readings whose values stand in its section."""
        listed = {key: np.asarray(v).tolist() for key, v in values.items() if v is not None}
        return cls.of(**keys, data={table: {**settings, "values": listed}})


class Strips(Definition):
    """Tensile tests of strips cut along warp, along fill and at an angle to the yarns (bias).

    Strips without curves can be simulated but not fitted, given the lengths of each direction:
    `Strips(width=25.0, warp={"gauge_length": 20.0, "final_length": 23.0})`.

    Parameters
    ----------
    curves : mapping or DataFrame
        By direction (warp, fill, bias, or the angle from the warp in degrees) a list of specimens,
        each a pair of arrays (elongation in mm, load in N) or an (n, 2) array of both; or a
        DataFrame with columns direction, specimen, elongation and load.
    width : float, mm
        Width of each strip.
    gauge : float or mapping, mm
        Gauge length, over which elongation is measured; by direction where lengths differ.
    name : str
    **keys
        Keys of [[strips]] and of [strips.data]: `match`, `increments`, `order` ...

    Raises
    ------
    InputError
        Names the argument whose shape, number or unit is wrong.
    """

    of_kind = "strips"
    data_argument = "curves"
    keys_of_arrays = ("until_largest_load", "order", "through_origin", "specimens")

    def __init__(
        self,
        curves: Mapping[str, Any] | Table = None,
        *,
        width: float | None = None,
        gauge: float | Mapping[str, float] | None = None,
        name: str = "strips",
        **keys: Unpack[StripsKeys],
    ) -> None:
        measured = None if curves is None else curves_of_arrays(curves)
        directions = dict.fromkeys(cut_of(curve.direction) for curve in measured or ())
        tables = _gauge_tables(gauge, keys, list(directions))
        section = _section_of("strips", {**keys, "width": width, "name": name, **tables})
        section.setdefault("data", {})
        super().__init__("strips", section, measured)

    @classmethod
    def read(
        cls,
        files: Files | Mapping[str, Files] | Mapping[float, Files],
        *,
        gauge: float | Mapping[str, float] | None = None,
        **keys: Unpack[StripsFileKeys],
    ) -> Self:
        """Return the test with the load curves of files.

        Parameters
        ----------
        files : path or pattern, a sequence of them, or either by direction, or by angle
        gauge : float or mapping, mm
            Gauge length, as in `Strips`.
        **keys
            Further arguments of `Strips`.

        Raises
        ------
        InputError
            No such file, or a wrong argument.
        """
        listed = _full_paths(files)
        directions = {*(files if isinstance(files, Mapping) else keys)} & {*DIRECTIONS}
        tables = _gauge_tables(gauge, keys, directions)
        names = files if isinstance(files, Mapping) else ()
        has_angles = any(not isinstance(name, str) for name in names)
        source = "directions" if has_angles else "files"
        return cls.of(**_section_of("strips", {**keys, **tables, source: listed}))


class Biaxial(Definition):
    """A biaxial test: a cruciform specimen loaded along warp and fill in several load ratios.

    Parameters
    ----------
    paths : mapping or DataFrame
        By load ratio ("1:1") an (n, 4) array or a DataFrame: loads along warp and fill in N/mm, and
        strains along warp and fill in mm/mm. Or one DataFrame of all readings, optionally with a
        column ratio.
    name : str
    **keys
        Keys of [[biaxial]] and of [biaxial.data]: `ratios`, `cycle`, `conditioning` ...

    Raises
    ------
    InputError
        Names the argument whose shape, number or unit is wrong.
    """

    of_kind = "biaxial"
    data_argument = "paths"
    columns: ClassVar[tuple[str, ...]] = BIAXIAL_COLUMNS

    def __init__(
        self,
        paths: Mapping[str, Any] | Table,
        *,
        name: str = "biaxial",
        **keys: Unpack[BiaxialKeys],
    ) -> None:
        section = _section_of("biaxial", {**keys, "name": name})
        section.setdefault("data", {})
        super().__init__("biaxial", section, biaxial_tables_of_arrays(paths))

    @classmethod
    def read(cls, files: Files | Mapping[str, Files], **keys: Unpack[BiaxialFileKeys]) -> Self:
        """Return the test with the data of files, also given by ratio; keys as in `Biaxial`."""
        return cls.of(**_section_of("biaxial", {**keys, "files": _full_paths(files)}))


class Cylinder(Definition):
    """An inflated cylinder in three-point bending, which is predicted and not fitted.

    Parameters
    ----------
    diameter : float, mm
    pressure : float, MPa
    curves : sequence
        Measured load curves, one per repetition: a pair of arrays (deflection in mm, load in N), an
        (n, 2) array of both, or a DataFrame.
    name : str
    **keys
        Keys of [[cylinder]] and of [cylinder.measured]: `span` (mm), `preload` (N) ...

    Raises
    ------
    InputError
        Names the argument whose shape, number or unit is wrong.
    """

    of_kind = "cylinder"
    keys_of_arrays = ("preload", "zero")

    def __init__(
        self,
        diameter: float,
        pressure: float,
        *,
        curves: Sequence[Any] = (),
        name: str = "cylinder",
        **keys: Unpack[CylinderKeys],
    ) -> None:
        arguments = {"diameter": diameter, "pressure": pressure, "name": name}
        section = _section_of("cylinder", {**keys, **arguments})
        super().__init__("cylinder", section, bending_curves_of_arrays(curves) or None)

    @classmethod
    def read(cls, files: Files, **keys: Unpack[CylinderFileKeys]) -> Self:
        """Return the test with measured repetitions in files; keys as in `Cylinder`."""
        return cls.of(**_section_of("cylinder", {**keys, "files": _full_paths(files)}))


class Deck(Definition):
    """An input deck of one's own for any finite element program, with what is compared.

    Parameters
    ----------
    template : path
        The deck as a Jinja template.
    parameters : mapping
        Unknowns of the deck by name, each with `bounds`, `unit` and `start`; "feasible" is a
        condition on them.
    compare : sequence of mappings
        What is compared: the keys of [[deck.compare]].
    program : str or sequence of str
        "calculix", "marc", or the words of a command.
    name : str
    **keys
        Further keys of [[deck]]: `result`, `files`, `timeout` ...

    Raises
    ------
    InputError
        An unknown key, a wrong value, or a missing file.
    """

    of_kind = "deck"

    def __init__(
        self,
        template: str | Path,
        parameters: Mapping[str, Any],
        compare: Sequence[Mapping[str, Any]],
        program: str | Sequence[str] = "calculix",
        name: str = "deck",
        **keys: Unpack[DeckKeys],
    ) -> None:
        section = {**keys, "name": name, "parameters": parameters, "program": program}
        section["template"] = os.path.abspath(template)
        section["compare"] = [
            {**comparison, "measured": _full_paths(comparison["measured"])}
            for comparison in compare
        ]
        super().__init__("deck", section)


def _gauge_tables(
    gauge: float | Mapping[str, float] | None,
    keys: Mapping[str, Any],
    directions: Sequence[str] | set[str],
) -> dict[str, Any]:
    """Return the table of each direction with its gauge length; none if `gauge` is None."""
    if gauge is None:
        return {}
    if not directions and not isinstance(gauge, Mapping):
        return {"gauge_length": gauge}
    lengths = gauge if isinstance(gauge, Mapping) else dict.fromkeys(directions, gauge)
    check_names(lengths, DIRECTIONS, "gauge.")
    return {d: {"gauge_length": length, **(keys.get(d) or {})} for d, length in lengths.items()}


def _full_paths(files: Files | Mapping[str, Files] | Mapping[float, Files]) -> Any:
    """Return full paths of files, as a mapping if they are given as one."""
    if isinstance(files, Mapping):
        return {str(name): file_names(group) for name, group in files.items()}
    return file_names(files)


def file_names(files: Files) -> list[str]:
    """Return full paths of files and of those that patterns match; raise InputError if none."""
    patterns = [files] if isinstance(files, (str, Path)) else list(files)
    paths, _ = frame_files([os.path.abspath(os.path.expanduser(name)) for name in patterns])
    for path in paths:
        if not is_file(path):
            raise InputError(None, "files", missing_file_reason(path))
    return list(map(str, paths))


def data_table(kind: str) -> str:
    """Return the dotted name of the table in which a kind of test names its files."""
    keys = kind_named(kind).folder_key.split() or [""]
    return keys[0].rpartition(".")[0]


def table_below(section: Mapping[str, Any], dotted: str) -> Mapping[str, Any]:
    """Return the table of a dotted name below a section; empty if there is none."""
    table = section
    for part in dotted.split(".") if dotted else ():
        table = table.get(part) or {}
    return table if isinstance(table, Mapping) else {}


def _section_of(kind: str, keys: Mapping[str, Any]) -> dict[str, Any]:
    """Return a section from flat keys: those of the table of data are put into that table."""
    dotted = data_table(kind)
    test_model = kind_named(kind).section
    data_model = model_of(test_model, dotted)
    if "pressure_unit" in keys:
        raise InputError(None, "pressure_unit", IN_BASE_UNITS)
    check_names(keys, [*test_model.model_fields, *data_model.model_fields])
    values = {key: value for key, value in keys.items() if value is not None}
    section = {key: value for key, value in values.items() if key in test_model.model_fields}
    for key in values.keys() - section.keys():
        section = _with_key(section, f"{dotted}.{key}", values[key])
    return section


def _with_key(table: Mapping[str, Any], dotted: str, value: Any) -> dict[str, Any]:
    """Return a table with the value of one more dotted key, in tables below it."""
    key, _, key_of_table = dotted.partition(".")
    if key_of_table:
        value = _with_key(table.get(key, {}), key_of_table, value)
    return {**table, key: value}


def _shown(class_name: str, keys: Mapping[str, Any]) -> str:
    """Return a call with keys and values as arguments in three lines; long lists are shortened."""
    short = reprlib.Repr()
    short.maxlevel = 3
    short.maxother = short.maxstring = 60
    arguments = ", ".join(f"{key}={short.repr(value)}" for key, value in keys.items())
    lines = textwrap.wrap(
        f"{class_name}({arguments})",
        100,
        subsequent_indent="  ",
        max_lines=3,
        placeholder=" ...)",
        break_long_words=False,
        break_on_hyphens=False,
    )
    return "\n".join(lines)
