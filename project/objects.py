"""Tests, sheets and laws as objects: what the tables of a project file say, in mm, N and MPa.

`Bubble(points, displacements, pressures, radius=100.0)` is what [[bubble]] says with the data in
memory; `Bubble.read(files, ...)` names files, `Bubble.of(radius=..., data={...})` says each key as
the file does. Keywords are the keys of [[bubble]] and of the table of its data. Arrays become plain
files where a project is put together, so that all that follows (registration, doubts, provenance,
worker processes) is the same for both.
"""

from __future__ import annotations

import atexit
import csv
import hashlib
import io
import json
import os
import re
import shutil
import tempfile
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, ClassVar, Self, TypeAlias

import numpy as np
from numpy.typing import NDArray
from pydantic import BaseModel, ValidationError

from ..errors import InputError, did_you_mean
from ..experiments.bubble.section import RegistrationSection, SheetSection
from ..experiments.output import Output
from ..experiments.registry import kind_named
from ..experiments.sections import Scales
from ..materials.forms.base import UNLIMITED, form_named, form_names, form_settings
from ..readers.curves import DIRECTIONS, read_load_curves
from ..readers.frames import QUANTITIES, frame_files
from ..readers.sections import first_error, model_of, unit_doubts
from ..storage.reading import is_file, missing_file_reason
from ..storage.writing import output_errors, write_text
from .schema import LawSection

Array: TypeAlias = NDArray[np.float64]
#: Numbers as users have them: arrays, lists, or one array a frame; a pandas DataFrame.
Numbers: TypeAlias = Any
Table: TypeAlias = Any
#: Files by name or by pattern.
Files: TypeAlias = str | Path | Sequence[str | Path]

#: In place of the file of a project that is made from objects.
PYTHON = Path("python")
#: Bounds of coated fabrics as `bubblefit init` writes them, MPa.
BOUNDS = {"E1": [20.0, 2000.0], "E2": [20.0, 1000.0], "G12": [1.0, 200.0]}
#: Units of objects.
BASE_UNITS = Scales(1.0, 1.0, 1.0, "MPa", "MPa", "mm")


def plain(value: Any) -> Any:
    """Return what TOML and JSON can say: without None, arrays as lists, paths as text."""
    if isinstance(value, Keys):
        return value.said
    if isinstance(value, Mapping):
        return {str(k): plain(v) for k, v in value.items() if v is not None}
    if isinstance(value, (list, tuple)):
        return [plain(v) for v in value]
    if isinstance(value, (np.ndarray, np.generic)):
        return value.tolist()
    return str(value) if isinstance(value, Path) else value


def checked_keys(section: type[BaseModel], said: Mapping[str, Any]) -> dict[str, Any]:
    """Return what a table says as plain values; InputError names the wrong key."""
    values: dict[str, Any] = plain(said)
    try:
        section.model_validate(values)
    except ValidationError as errors:
        raise first_error(None, errors, section) from None
    return values


class Keys:
    """Keys of one table of a project file, checked as they are given; `said` holds them."""

    section: ClassVar[type[BaseModel]]

    def __init__(self, **said: Any) -> None:
        self.said = checked_keys(self.section, said)

    def __repr__(self) -> str:
        return f"{type(self).__name__}({_words(self.said)})"

    @classmethod
    def of(cls, said: Mapping[str, Any]) -> Self:
        """Return the keys as they are said, without values of our own."""
        made = cls.__new__(cls)
        made.said = checked_keys(cls.section, said)
        return made


class Sheet(Keys):
    """The sheet of a bubble: the keys of [bubble.sheet]; prior and misfit in mm."""

    section = SheetSection


class Registration(Keys):
    """Steps of a registration that are given: the keys of [bubble.data.points.registration]."""

    section = RegistrationSection


class Law(Keys):
    """The form of the moduli, and their bounds: the keys of [law].

    form : a name, or a class or an object of one's own. bounds : [least, largest] of E1, E2 and G12
    in MPa, those of coated fabrics unless given. Keywords beside nu12, strain_range, margin and
    closed_path are settings of the form, such as knots.
    """

    section = LawSection

    own_form: Any = None

    def __init__(self, form: Any = "cubic", **said: Any) -> None:
        if not isinstance(form, str):
            self.own_form, form = form, getattr(form, "__name__", type(form).__name__)
        elif form not in form_names():
            form_named(form, {}, [UNLIMITED] * 3)  # says which there are
        _check_names(said, [*LawSection.model_fields, *form_settings(form)])
        super().__init__(**{"form": form, "bounds": BOUNDS, **said})


#: A file whose content is in memory: the argument that it is of, and its text.
Held: TypeAlias = tuple[str, str]


def held(argument: str, columns: Mapping[str, Sequence[Any]]) -> Held:
    """Return a table by columns as a file; every number in full."""
    out = io.StringIO()
    lines = csv.writer(out, lineterminator="\n")
    lines.writerow(columns)
    lines.writerows(zip(*columns.values(), strict=True))
    return argument, out.getvalue()


@dataclass(frozen=True, eq=False, repr=False)
class Definition:
    """A test as its table [[kind]] of a project file says it, in mm, N and MPa.
    section : the keys of the table, files by full paths. files : that stand in the section by name
    and are held in memory. function : an objective of one's own, in place of a name. InputError:
    names the key that is wrong."""

    kind: str
    section: Mapping[str, Any]
    files: Mapping[str, Held] = field(default_factory=dict)
    function: Callable[..., Any] | None = None
    of_kind: ClassVar[str]

    def __post_init__(self) -> None:
        said = dict(self.section)
        if callable(said.get("objective")):
            object.__setattr__(self, "function", said.pop("objective"))
        section = kind_named(self.kind).section
        try:
            said = checked_keys(section, said)
        except InputError as error:
            raise InputError(None, self.argument(error.field), error.problem) from None
        for key, problem in unit_doubts(section, said, BASE_UNITS):
            raise InputError(None, self.argument(key), problem)
        object.__setattr__(self, "section", said)

    def __repr__(self) -> str:
        return f"{type(self).__name__}({_words(self.section)})"

    @property
    def name(self) -> str:
        """Return the name of the test, that of its kind where none is given."""
        return str(self.section.get("name", self.kind))

    @classmethod
    def of(cls, **section: Any) -> Self:
        """Return the test whose table says this, key by key."""
        made = cls.__new__(cls)
        Definition.__init__(made, cls.of_kind, section)
        return made

    def with_keys(self, **keys: Any) -> Definition:
        """Return the test with other values of some keys of its section."""
        made = object.__new__(type(self))
        Definition.__init__(made, self.kind, {**self.section, **keys}, self.files, self.function)
        return made

    def argument(self, field: str) -> str:
        """Return the argument that a dotted key of the section stands for."""
        return field.removeprefix(f"{_data_table(self.kind)}.").removeprefix("data.")

    @property
    def prefix(self) -> str:
        """Return the beginning of the name of the folder of its files."""
        return Output.of(Path(), self.name, True).prefix

    def placed(self, folder: Path, beside: Path | None = None) -> dict[str, Any]:
        """Return the section with its files written below a folder; raises OutputError.
        The name of their folder tells data apart, so that nothing else is written over. beside :
        the folder from which the section names it."""
        if not self.files:
            return dict(self.section)
        texts = {name: text for name, (_, text) in self.files.items()}
        digest = hashlib.sha256("".join(texts.values()).encode()).hexdigest()[:8]
        own = folder / f"{self.prefix}{digest}"
        for name, text in texts.items():
            write_text(own / name, text)
        said = str(own) if beside is None else own.relative_to(beside).as_posix()
        return _with(self.section, f"{_data_table(self.kind)}.folder", said)


def definition_of(kind: str, section: Mapping[str, Any]) -> Definition:
    """Return the definition of a section in mm, N and MPa, of its kind's own class."""
    ours: Sequence[type[Definition]] = (Bubble, Strips, Biaxial, Cylinder)
    own = next((one for one in ours if one.of_kind == kind), None)
    return Definition(kind, section) if own is None else own.of(**section)


class Bubble(Definition):
    """A bubble inflation test: a clamped disk, its points in each frame."""

    of_kind = "bubble"

    def __init__(
        self,
        points: Numbers | Table,
        displacements: Numbers = None,
        pressures: Numbers = None,
        *,
        radius: float | str | None = None,
        ellipse: Mapping[str, float] | None = None,
        sheet: Sheet | Mapping[str, Any] | None = None,
        registration: Registration | Mapping[str, Any] | None = None,
        name: str = "bubble",
        **keys: Any,
    ) -> None:
        """Make the test from arrays; x is warp, y is fill, z is up, and NaN a lost point.

        points : (m, 3), or (frames, m, 3), or an array a frame, mm, without load. displacements :
        (frames, m, 3), or an array a frame, mm. pressures : (frames,) MPa, rising. Or a DataFrame
        with columns x y z dx dy dz and frame or pressure. radius : mm of the clamped edge, or
        "clamp" where its points are seen. keys : of [[bubble]] and of [bubble.data.points].
        InputError names the argument.
        """
        if hasattr(points, "columns"):
            points, displacements, pressures = _frames_of(points, pressures)
        moved = _per_frame("displacements", displacements)
        rest = _per_frame("points", points, len(moved))
        loads = _pressures(pressures, len(moved))
        files = {}
        for k, (at, by) in enumerate(zip(rest, moved, strict=True)):
            if at.shape != by.shape:
                problem = f"expected {at.shape} as the points of the frame, got {by.shape}"
                raise InputError(None, f"displacements[{k}]", problem)
            whole = np.isfinite(at[:, :2]).all(axis=1) & np.isfinite(by).all(axis=1)
            if not whole.any():
                raise InputError(None, f"displacements[{k}]", "every point is lost (NaN)")
            table = np.column_stack([at, by]).T.tolist()
            columns = {f"{q} [mm]": v for q, v in zip(QUANTITIES, table, strict=True)}
            argument = f"points and displacements, frame {k}"
            files[f"frame-{k + 1:03d}.csv"] = held(argument, columns)
        data = {"files": list(files), "format": "csv", "registration": registration}
        said = {"pressures": loads, "radius": radius, "ellipse": ellipse, "sheet": sheet}
        section = _sorted("bubble", {**said, "name": name, **data, **keys})
        super().__init__("bubble", section, files)

    @classmethod
    def read(cls, files: Files, pressures: Numbers = None, **keys: Any) -> Self:
        """Return the test of files of any reader, in the order of rising pressure.

        files : paths or patterns, one a frame or all in one. pressures : (frames,) MPa; none where
        the keyword pressure says where they stand. keys : as of `Bubble`.
        """
        if pressures is not None:
            keys["pressures"] = _pressures(pressures, None)
        return cls.of(**_sorted("bubble", {**keys, "files": file_names(files)}))


class Strips(Definition):
    """Cut strips pulled along warp, fill and across the yarns."""

    of_kind = "strips"

    def __init__(
        self,
        curves: Mapping[str, Any] | Table,
        *,
        width: float | None = None,
        gauge: float | Mapping[str, float] | None = None,
        name: str = "strips",
        **keys: Any,
    ) -> None:
        """Make the test from load curves.

        curves : by direction (warp, fill, bias) a list of specimens, each (elongation mm, load N)
        or (n, 2); or a DataFrame with columns direction, specimen, elongation and load. width : mm
        of the strip. gauge : mm, the length over which elongation is measured; by direction where
        they differ. keys : of [[strips]] and of [strips.data]. InputError names the argument.
        """
        rows = _curve_rows(curves)
        if not rows:
            raise InputError(None, "curves", "expected one curve at least, got none")
        names = ("direction", "specimen", "elongation (mm)", "load (N)")
        files = {
            "curves.csv": held("curves", dict(zip(names, zip(*rows, strict=True), strict=True)))
        }
        tables = _gauges(gauge, keys, {row[0] for row in rows})
        said = {"width": width, "name": name, "files": list(files), **tables}
        super().__init__("strips", _sorted("strips", {**keys, **said}), files)

    @classmethod
    def read(
        cls,
        files: Files | Mapping[str, Files],
        *,
        gauge: float | Mapping[str, float] | None = None,
        **keys: Any,
    ) -> Self:
        """Return the test of files of load curves, or of files by direction; keys : as above."""
        listed = _listed(files)
        here = set(files if isinstance(files, Mapping) else keys)
        here &= {*DIRECTIONS}
        if isinstance(listed, list) and not here and isinstance(gauge, (int, float)):
            names = (
                "columns",
                "load_unit",
                "length_unit",
                "comment",
                "decimal",
                "format",
                "width",
                "sheet",
            )
            how = {name: keys[name] for name in names if name in keys}
            known = dict.fromkeys(DIRECTIONS, gauge)
            every = [read_load_curves(one, gauge_length=known, **how) for one in listed]
            here = {curve.direction for own in every for curve in own}
        return cls.of(**_sorted("strips", {**keys, **_gauges(gauge, keys, here), "files": listed}))


class Biaxial(Definition):
    """A cruciform loaded along warp and fill in several ratios."""

    of_kind = "biaxial"
    columns = ("warp_load", "fill_load", "warp_strain", "fill_strain")

    def __init__(
        self, paths: Mapping[str, Any] | Table, *, name: str = "biaxial", **keys: Any
    ) -> None:
        """Make the test from loads and strains.

        paths : by ratio ("1:1") an array (n, 4) or a DataFrame: loads along warp and fill in N/mm,
        strains along warp and fill as shares; or one DataFrame of all, perhaps with a column ratio.
        keys : of [[biaxial]] and of [biaxial.data]. InputError names the argument.
        """
        tables = {"": paths} if hasattr(paths, "columns") else paths
        if not isinstance(tables, Mapping):
            problem = f"expected arrays by ratio, or a table, got {type(paths).__name__}"
            raise InputError(None, "paths", problem)
        names = (
            "warp load (N/mm)",
            "fill load (N/mm)",
            "warp strain (mm/mm)",
            "fill strain (mm/mm)",
        )
        files = {}
        listed = {}
        for k, (ratio, table) in enumerate(tables.items(), start=1):
            at = f"paths[{ratio!r}]" if ratio else "paths"
            columns = dict(zip(names, _values(at, table, self.columns).tolist(), strict=True))
            if hasattr(table, "columns") and "ratio" in table.columns:
                columns["ratio"] = table["ratio"].tolist()
            files[f"path-{k}.csv"] = held(at, columns)
            listed[ratio] = [f"path-{k}.csv"]
        said = {"name": name, "files": listed.get("", listed)}
        super().__init__("biaxial", _sorted("biaxial", {**keys, **said}), files)

    @classmethod
    def read(cls, files: Files | Mapping[str, Files], **keys: Any) -> Self:
        """Return the test of files, or of files by ratio; keys : as of `Biaxial`."""
        return cls.of(**_sorted("biaxial", {**keys, "files": _listed(files)}))


class Cylinder(Definition):
    """An inflated cylinder in three-point bending, to be predicted."""

    of_kind = "cylinder"

    def __init__(
        self,
        diameter: float,
        pressure: float,
        *,
        curves: Sequence[Any] = (),
        name: str = "cylinder",
        **keys: Any,
    ) -> None:
        """Make the test; diameter in mm, pressure in MPa.

        curves : one a measured repetition, (deflection mm, load N), (n, 2) or a DataFrame. keys :
        of [[cylinder]] and of [cylinder.measured]. InputError names the argument.
        """
        files = {}
        for k, curve in enumerate(curves):
            found = _values(f"curves[{k}]", curve, ("deflection", "load")).tolist()
            columns = dict(zip(("deflection (mm)", "load (N)"), found, strict=True))
            files[f"curve-{k + 1}.csv"] = held(f"curves[{k}]", columns)
        said = {"diameter": diameter, "pressure": pressure, "name": name}
        data = {"files": list(files)} if files else {}
        super().__init__("cylinder", _sorted("cylinder", {**keys, **said, **data}), files)

    @classmethod
    def read(cls, files: Files, **keys: Any) -> Self:
        """Return the test with measured repetitions in files; keys : as of `Cylinder`."""
        return cls.of(**_sorted("cylinder", {**keys, "files": _listed(files)}))


def _frames_of(table: Table, pressures: Numbers) -> tuple[list[Array], list[Array], Numbers]:
    """Return places, displacements and pressures of a DataFrame, frame by frame."""
    by = "pressure" if "frame" not in table.columns else "frame"
    _check_columns("points", table, [by, *(q for q in QUANTITIES if q != "z")])
    groups = [own for _, own in table.groupby(by, sort=by == "pressure")]
    if pressures is None and "pressure" in table.columns:
        pressures = [own["pressure"].iloc[0] for own in groups]
    whole = [own.assign(z=own["z"] if "z" in own else np.nan) for own in groups]
    places, moved = (
        [own[list(names)].to_numpy(dtype=float) for own in whole]
        for names in (QUANTITIES[:3], QUANTITIES[3:])
    )
    return places, moved, pressures


def _per_frame(argument: str, value: Numbers, frames: int | None = None) -> list[Array]:
    """Return (m, 3) mm of every frame; one array stands for each of so many frames."""
    shape = "(m, 3) or (frames, m, 3)" if frames is not None else "(frames, m, 3)"
    try:
        whole = np.asarray(value, dtype=float)
        parts = list(whole) if whole.ndim == 3 else [whole] * (frames or 1)
    except (TypeError, ValueError):
        try:
            parts = [np.asarray(one, dtype=float) for one in value]
        except (TypeError, ValueError):
            problem = f"expected numbers {shape}, got {type(value).__name__}"
            raise InputError(None, argument, problem) from None
    if not parts or any(p.ndim != 2 or p.shape[1] != 3 for p in parts):
        got = str([*dict.fromkeys(p.shape for p in parts)])[1:60].rstrip("]")
        raise InputError(None, argument, f"expected {shape}, got {got}")
    if frames is not None and len(parts) != frames:
        problem = f"expected as many frames as displacements, {frames}, got {len(parts)}"
        raise InputError(None, argument, problem)
    if any(np.isinf(p).any() for p in parts):
        raise InputError(None, argument, "expected finite numbers, or NaN for a lost point")
    return parts


def _pressures(value: Numbers, frames: int | None) -> list[float]:
    """Return rising pressures in MPa, as many as frames."""
    found = numbers("pressures", value)
    if found.ndim != 1 or frames not in (None, len(found)):
        expected = "(frames,)" if frames is None else f"{(frames,)}, one a frame"
        raise InputError(None, "pressures", f"expected {expected}, got {found.shape}")
    for k, pressure in enumerate(found):
        if not pressure > 0:
            problem = f"expected MPa above 0, got {pressure:g}; leave the frame without load out"
            raise InputError(None, f"pressures[{k}]", problem)
        if k and not pressure > found[k - 1]:
            problem = f"expected rising pressures, got {pressure:g} after {found[k - 1]:g}"
            raise InputError(None, f"pressures[{k}]", problem)
    return [float(p) for p in found]


def numbers(argument: str, value: Numbers) -> Array:
    """Return a value as an array; InputError names the argument."""
    try:
        return np.asarray(value, dtype=float)
    except (TypeError, ValueError):
        problem = f"expected numbers, got {repr(value)[:40]}"
        raise InputError(None, argument, problem) from None


def _curve_rows(curves: Any) -> list[tuple[Any, ...]]:
    """Return rows (direction, specimen, elongation, load) of curves by direction, or a table."""
    names = ("elongation", "load")
    if hasattr(curves, "columns"):
        _check_columns("curves", curves, ("direction", *names))
        which = "specimen" if "specimen" in curves.columns else "direction"
        return [tuple(row) for row in curves[["direction", which, *names]].to_numpy().tolist()]
    if not isinstance(curves, Mapping):
        problem = (
            f"expected curves by {', '.join(DIRECTIONS)}, or a table, got {type(curves).__name__}"
        )
        raise InputError(None, "curves", problem)
    _check_names(curves, DIRECTIONS, "curves.")
    rows: list[tuple[Any, ...]] = []
    for group, given in curves.items():
        frame = hasattr(given, "columns") or isinstance(given, tuple)
        one = frame or getattr(given, "ndim", 0) == 2  # else a list of curves
        for k, curve in enumerate([given] if one else given):
            at = f"curves.{group}[{k}]"
            found = _values(at, curve, names).T.tolist()
            rows += [(group, f"{group} {k + 1}", *values) for values in found]
    return rows


def _values(at: str, table: Table, names: Sequence[str]) -> Array:
    """Return (names, n) finite numbers of an array (n, names), a DataFrame, or arrays in a row."""
    if hasattr(table, "columns"):
        _check_columns(at, table, names)
        table = table[list(names)].to_numpy()
    found = numbers(at, table)
    found = found.T if isinstance(table, np.ndarray) else found
    if found.ndim != 2 or len(found) != len(names) or not np.isfinite(found).all():
        expected = f"finite numbers ({', '.join(names)}), each (n,)"
        raise InputError(None, at, f"expected {expected}, got shape {found.shape}")
    return found


def _check_columns(at: str, table: Table, names: Iterable[str]) -> None:
    if lost := [name for name in names if name not in table.columns]:
        there = ", ".join(map(str, table.columns))
        raise InputError(None, at, f"expected a column {lost[0]}; the table has: {there}")


def _gauges(
    gauge: float | Mapping[str, float] | None,
    keys: Mapping[str, Any],
    here: Iterable[str],
) -> dict[str, Any]:
    """Return the tables of directions with the length of their gauge, where it is given."""
    if gauge is None:
        return {}
    lengths = gauge if isinstance(gauge, Mapping) else dict.fromkeys(here, gauge)
    _check_names(lengths, DIRECTIONS, "gauge.")
    return {d: {"gauge_length": own, **(keys.get(d) or {})} for d, own in lengths.items()}


def _listed(files: Files | Mapping[str, Files]) -> Any:
    """Return full paths of files, by name where they are given by name."""
    if isinstance(files, Mapping):
        return {name: file_names(own) for name, own in files.items()}
    return file_names(files)


def file_names(files: Files) -> list[str]:
    """Return full paths of files or patterns; InputError where there is none."""
    given = [files] if isinstance(files, (str, Path)) else list(files)
    full = [os.path.abspath(os.path.expanduser(one)) for one in given]
    found, _ = frame_files(full)
    for file in found:
        if not is_file(file):
            raise InputError(None, "files", missing_file_reason(file))
    return list(map(str, found))


def _data_table(kind: str) -> str:
    """Return the dotted name of the table that says the files of a kind of test."""
    return kind_named(kind).folder_key.rpartition(".")[0]


def _sorted(kind: str, said: Mapping[str, Any]) -> dict[str, Any]:
    """Return a section: keys of the table of its data go there, all others into the test's own."""
    at = _data_table(kind)
    outer = kind_named(kind).section
    inner = model_of(outer, at)
    _check_names(said, [*outer.model_fields, *inner.model_fields])
    own = {k: v for k, v in said.items() if v is not None}
    section = {k: v for k, v in own.items() if k in outer.model_fields}
    for key in own.keys() - section.keys():
        section = _with(section, f"{at}.{key}", own[key])
    return section


def _with(table: Mapping[str, Any], dotted: str, value: Any) -> dict[str, Any]:
    """Return the table with one more key, in tables below it."""
    first, _, rest = dotted.partition(".")
    return {**table, first: _with(table.get(first, {}), rest, value) if rest else value}


def _check_names(said: Iterable[str], known: Sequence[str], at: str = "") -> None:
    for key in said:
        if key not in known:
            problem = f"unknown{did_you_mean(key, known) or ';'} known here: {', '.join(known)}"
            raise InputError(None, f"{at}{key}", problem)


def _words(said: Mapping[str, Any]) -> str:
    return ", ".join(f"{key}={repr(value)[:60]}" for key, value in said.items())


SCRATCH = "bubblefit-arrays-"


def scratch_folder() -> Path:
    """Return a new folder for arrays of a project without one; removed when Python ends."""
    folder = tempfile.mkdtemp(prefix=SCRATCH)
    atexit.register(shutil.rmtree, folder, ignore_errors=True)
    return Path(folder)


def with_kept_arrays(content: Any, folder: Path) -> Any:
    """Return plain values that name files of arrays below a folder, where they will last."""
    text = json.dumps(content)
    for root in set(re.findall(rf'"([^"]*{SCRATCH}[^"/\\]*)', text)):
        with output_errors(folder):
            shutil.copytree(json.loads(f'"{root}"'), folder / "data", dirs_exist_ok=True)
        text = text.replace(root, json.dumps(os.path.abspath(folder / "data"))[1:-1])
    return json.loads(text)


@contextmanager
def arguments_named(made: Sequence[Definition]) -> Iterator[None]:
    """Let InputErrors of a project made from objects name the argument, not a key or a file."""
    try:
        yield
    except InputError as error:
        if error.path == PYTHON:
            key = re.match(r"(\w+)\[(\d+)\]\.?(.*)", error.field)
            own = [one for one in made if key and one.kind == key[1]]
            if key and int(key[2]) < len(own):
                test = own[int(key[2])]
                raise InputError(test.name, test.argument(key[3]), error.problem) from None
            raise InputError(None, error.field.removeprefix("fit."), error.problem) from None
        file = Path(error.path or "")
        for test in made:
            if file.name in test.files and file.parent.name.startswith(test.prefix):
                at = ", ".join(filter(None, (test.files[file.name][0], error.field)))
                raise InputError(test.name, at, error.problem) from None
        raise
