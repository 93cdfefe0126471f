"""Conversion of a user's arrays and DataFrames to the records that readers make of files."""

import csv
import io
from collections.abc import Callable, Iterable, Mapping, Sequence
from functools import partial
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from ..errors import InputError, did_you_mean
from ..readers.bending import BendingCurve, bending_file_name
from ..readers.curves import CURVES_FILE, DIRECTIONS, LoadCurve, direction_named
from ..readers.frames import QUANTITIES, Frame, FrameSource, frame_file_name
from ..readers.machine_tables import BiaxialTable

Array: TypeAlias = NDArray[np.float64]
#: Numbers as users have them: arrays, lists, or a list with one array per frame; and DataFrames.
Numbers: TypeAlias = Any
Table: TypeAlias = Any
#: The columns of a file by their names.
Columns: TypeAlias = Mapping[str, Sequence[Any]]

#: Names of the columns of an array of a biaxial test, in their order.
BIAXIAL_COLUMNS = ("warp_load", "fill_load", "warp_strain", "fill_strain")


def csv_text(columns: Columns) -> str:
    """Return the text of a CSV file with these columns, numbers with all their digits."""
    out = io.StringIO()
    lines = csv.writer(out, lineterminator="\n")
    lines.writerow(columns)
    lines.writerows(zip(*columns.values(), strict=True))
    return out.getvalue()


def is_table(value: Any) -> bool:
    """Return whether a value is a pandas DataFrame."""
    return hasattr(value, "columns")


def numbers(argument: str, value: Numbers) -> Array:
    """Return a copy of a value as an array of floats; raise InputError naming the argument."""
    try:
        return np.array(value, dtype=float)
    except (TypeError, ValueError):
        problem = f"expected numbers, got {repr(value)[:40]}"
        raise InputError(None, argument, problem) from None


def check_names(names: Iterable[str], allowed: Sequence[str], at: str = "") -> None:
    """Raise InputError for a name that is not allowed; the message puts `at` before the name."""
    for name in names:
        if name not in allowed:
            hint = did_you_mean(name, allowed) or ";"
            problem = f"unknown{hint} known here: {', '.join(allowed)}"
            raise InputError(None, f"{at}{name}", problem)


def _check_columns(argument: str, table: Table, names: Iterable[str]) -> None:
    """Raise InputError if a DataFrame lacks one of these columns."""
    missing = [name for name in names if name not in table.columns]
    if missing:
        present = ", ".join(map(str, table.columns))
        raise InputError(
            None, argument, f"expected a column {missing[0]}; the table has: {present}"
        )


def _columns(argument: str, table: Table, names: Sequence[str]) -> Array:
    """Return the named columns as (names, n) finite numbers, of an array, table or sequence."""
    if is_table(table):
        _check_columns(argument, table, names)
        table = table[list(names)].to_numpy()
    values = numbers(argument, table)
    if isinstance(table, np.ndarray):
        values = values.T
    if values.ndim != 2 or len(values) != len(names) or not np.isfinite(values).all():
        expected = f"finite numbers ({', '.join(names)}), each (n,)"
        raise InputError(None, argument, f"expected {expected}, got shape {values.shape}")
    return values


def arrays_of(record: Frame | LoadCurve | BiaxialTable | BendingCurve) -> list[Array]:
    """Return the arrays of a record, of which a checksum is made."""
    if isinstance(record, Frame):
        return [record.points, record.displacement]
    if isinstance(record, LoadCurve):
        return [record.elongation, record.load]
    if isinstance(record, BiaxialTable):
        return [record.load, record.strain]
    return [record.deflection, record.load]


def array_files(records: Sequence[Any]) -> dict[str, Callable[[], Columns]]:
    """Return, by name of the file to write, the function that gives its columns."""
    files: dict[str, Callable[[], Columns]] = {}
    for number, record in enumerate(records):
        if isinstance(record, LoadCurve):
            return {CURVES_FILE: partial(_columns_of_curves, records)}
        if isinstance(record, Frame):
            files[frame_file_name(number)] = partial(_columns_of_frame, record)
        elif isinstance(record, BiaxialTable):
            files[record.name] = partial(_columns_of_biaxial, record)
        else:
            files[bending_file_name(record)] = partial(_columns_of_bending, record)
    return files


# Bubbles ----------------------------------------------------------------------------------------


def frames_of_arrays(points: Numbers, displacements: Numbers) -> tuple[Frame, ...]:
    """Return the frames of a bubble from arrays of its points and displacements.

    Parameters
    ----------
    points : (m, 3) array, (frames, m, 3) array, or a sequence of (m, 3) arrays, mm
        Positions without load; a single (m, 3) array holds for all frames.
    displacements : (frames, m, 3) array, or a sequence of (m, 3) arrays, mm
        Displacements from there in each frame; NaN for a lost point.

    Raises
    ------
    InputError
        Shapes do not belong to each other, numbers are not finite, or a frame has no point.
    """
    displacements_by_frame = _per_frame("displacements", displacements)
    count = len(displacements_by_frame)
    points_by_frame = _per_frame("points", points, count)
    frames = []
    for k, displacement in enumerate(displacements_by_frame):
        argument = f"displacements[{k}]"
        position = points_by_frame[k]
        if position.shape != displacement.shape:
            expected = f"{position.shape} as the points of the frame"
            raise InputError(None, argument, f"expected {expected}, got {displacement.shape}")
        values = np.hstack([position[:, :2], displacement])
        if not np.isfinite(values).all(axis=1).any():
            raise InputError(None, argument, "every point is lost (NaN)")
        frames.append(Frame(position, displacement, number=float(k)))
    return tuple(frames)


def _per_frame(argument: str, value: Numbers, frames: int | None = None) -> list[Array]:
    """Return the (m, 3) array (mm) of every frame; a single one is repeated `frames` times.

    Parameters
    ----------
    value
        array_like (frames, m, 3) or (m, 3), mm, which the user gives as this argument.
    """
    shape = "(frames, m, 3)" if frames is None else "(m, 3) or (frames, m, 3)"
    try:
        arrays = _list_of_arrays(value, frames or 1)
    except (TypeError, ValueError):
        problem = f"expected numbers {shape}, got {type(value).__name__}"
        raise InputError(None, argument, problem) from None
    if not arrays or any(array.shape[1:] != (3,) for array in arrays):
        shapes = str([*dict.fromkeys(array.shape for array in arrays)])[1:60].rstrip("]")
        raise InputError(None, argument, f"expected {shape}, got {shapes}")
    if frames not in (None, len(arrays)):
        problem = f"expected as many frames as displacements, {frames}, got {len(arrays)}"
        raise InputError(None, argument, problem)
    if np.isinf(np.concatenate(arrays)).any():
        raise InputError(None, argument, "expected finite numbers, or NaN for a lost point")
    return arrays


def _list_of_arrays(value: Numbers, frames: int) -> list[Array]:
    """Return one array per frame; raise TypeError or ValueError if `value` has no arrays."""
    try:
        stacked = np.array(value, dtype=float)
    except (TypeError, ValueError):  # the frames have different numbers of points
        return [np.array(array, dtype=float) for array in value]
    return list(stacked) if stacked.ndim == 3 else [stacked] * frames


def arrays_of_table(table: Table, pressures: Numbers) -> tuple[list[Array], list[Array], Numbers]:
    """Return points, displacements and pressures of a DataFrame, frame by frame.

    Parameters
    ----------
    table : DataFrame
        Columns x, y, dx, dy, dz and optionally z (mm), and a column frame or pressure (MPa) that
        tells the frames apart.
    pressures : (frames,) array, MPa, or None
        Pressure of each frame; None takes those of the column.
    """
    key = "pressure" if "frame" not in table.columns else "frame"
    _check_columns("points", table, [key, *(q for q in QUANTITIES if q != "z")])
    groups = [rows for _, rows in table.groupby(key, sort=key == "pressure")]
    if pressures is None and "pressure" in table.columns:
        pressures = [rows["pressure"].iloc[0] for rows in groups]
    points = []
    displacements = []
    for rows in groups:
        if "z" not in rows:
            rows = rows.assign(z=np.nan)
        points.append(rows[list(QUANTITIES[:3])].to_numpy(dtype=float))
        displacements.append(rows[list(QUANTITIES[3:])].to_numpy(dtype=float))
    return points, displacements, pressures


def rising_pressures(value: Numbers, frames: int | None) -> list[float]:
    """Return pressures (MPa) as floats; raise InputError unless they rise, one for each frame.

    Parameters
    ----------
    value
        array_like (frames,), MPa, which the user gives.
    """
    pressures = numbers("pressures", value)
    if pressures.ndim != 1 or frames not in (None, len(pressures)):
        expected = "(frames,)" if frames is None else f"{(frames,)}, one a frame"
        raise InputError(None, "pressures", f"expected {expected}, got {pressures.shape}")
    for k, pressure in enumerate(pressures):
        if not pressure > 0:
            problem = f"expected MPa above 0, got {pressure:g}; leave the frame without load out"
            raise InputError(None, f"pressures[{k}]", problem)
        if k and not pressure > pressures[k - 1]:
            problem = f"expected rising pressures, got {pressure:g} after {pressures[k - 1]:g}"
            raise InputError(None, f"pressures[{k}]", problem)
    return [float(pressure) for pressure in pressures]


def _columns_of_frame(frame: Frame) -> Columns:
    """Return the columns of a CSV file with a frame: points and displacements in mm."""
    table = np.hstack([frame.points, frame.displacement]).T.tolist()
    return {f"{quantity} [mm]": v for quantity, v in zip(QUANTITIES, table, strict=True)}


# Load curves ------------------------------------------------------------------------------------


def curves_of_arrays(curves: Mapping[str, Any] | Table) -> tuple[LoadCurve, ...]:
    """Return the load curves of strips from arrays or a DataFrame.

    Parameters
    ----------
    curves : mapping or DataFrame
        By direction a list of specimens, each a pair of arrays (elongation in mm, load in N) or an
        (n, 2) array of both; or a DataFrame with columns direction, elongation, load and
        optionally specimen.

    Raises
    ------
    InputError
        There is no curve, a direction is unknown, or a number is not finite.
    """
    names = ("elongation", "load")
    if is_table(curves):
        specimens = _curves_of_table(curves, names)
    elif isinstance(curves, Mapping):
        check_names([name for name in curves if isinstance(name, str)], DIRECTIONS, "curves.")
        specimens = [
            _load_curve(direction_named(name, None, "curves"), f"{name} {k + 1}", *values)
            for name, group in curves.items()
            for k, values in enumerate(_specimens(f"curves.{name}", group, names))
        ]
    else:
        problem = (
            f"expected curves by {', '.join(DIRECTIONS)}, or a table, got {type(curves).__name__}"
        )
        raise InputError(None, "curves", problem)
    if not specimens:
        raise InputError(None, "curves", "expected one curve at least, got none")
    return tuple(specimens)


def _curves_of_table(table: Table, names: Sequence[str]) -> list[LoadCurve]:
    """Return the curves of a DataFrame, in the order of its rows."""
    _check_columns("curves", table, ("direction", *names))
    specimen_column = "specimen" if "specimen" in table.columns else "direction"
    elongation, load = _columns("curves", table, names)
    labels = [
        (direction_named(str(direction), None, "curves.direction"), str(specimen))
        for direction, specimen in table[["direction", specimen_column]].to_numpy().tolist()
    ]
    curves = []
    for direction, specimen in dict.fromkeys(labels):
        rows = [row for row, label in enumerate(labels) if label == (direction, specimen)]
        curves.append(_load_curve(direction, specimen, elongation[rows], load[rows]))
    return curves


def _specimens(argument: str, group: Any, names: Sequence[str]) -> list[Array]:
    """Return elongation (mm) and load (N) of each specimen of a direction, as (2, n) arrays."""
    is_single = is_table(group) or isinstance(group, tuple) or getattr(group, "ndim", 0) == 2
    specimens = [group] if is_single else group
    return [_columns(f"{argument}[{k}]", curve, names) for k, curve in enumerate(specimens)]


def _load_curve(direction: str, specimen: str, elongation: Array, load: Array) -> LoadCurve:
    """Return the record of a load curve given as arrays, elongation in mm and load in N."""
    columns = {"elongation": "elongation (mm)", "load": "load (N)"}
    columns |= {"specimen": "specimen", "direction": "direction"}
    source = FrameSource("arrays", columns, {"elongation": "mm", "load": "N"})
    return LoadCurve(direction, specimen, elongation, load, None, source=source)


def _columns_of_curves(curves: Sequence[LoadCurve]) -> Columns:
    """Return the columns of the single CSV file of all load curves."""
    columns: dict[str, list[Any]] = {"direction": [], "specimen": []}
    columns |= {"elongation (mm)": [], "load (N)": []}
    for curve in curves:
        count = len(curve.load)
        columns["direction"] += [curve.direction] * count
        columns["specimen"] += [curve.specimen] * count
        columns["elongation (mm)"] += curve.elongation.tolist()
        columns["load (N)"] += curve.load.tolist()
    return columns


# Biaxial tests ----------------------------------------------------------------------------------


def _tables_by_ratio(paths: Mapping[str, Any] | Table) -> Mapping[str, Any]:
    """Return tables by load ratio, "" where one table has all; refuse ratios that are no text."""
    if is_table(paths):
        return {"": paths}
    if not isinstance(paths, Mapping):
        problem = f"expected arrays by ratio, or a table, got {type(paths).__name__}"
        raise InputError(None, "paths", problem)
    for ratio in paths:
        if not (isinstance(ratio, str) and ratio):
            problem = f"expected load ratios warp:fill as text, such as '2:1', got {ratio!r}"
            raise InputError(None, "paths", problem)
    return paths


def biaxial_tables_of_arrays(paths: Mapping[str, Any] | Table) -> tuple[BiaxialTable, ...]:
    """Return the records of a biaxial test from arrays or a DataFrame.

    Parameters
    ----------
    paths : mapping or DataFrame
        By load ratio warp:fill, a str such as "2:1", an (n, 4) array or a DataFrame with the loads
        along warp and fill (N/mm) and the strains along warp and fill (mm/mm); or one DataFrame of
        all readings, optionally with a column ratio.

    Raises
    ------
    InputError
        A table has other columns, a number that is not finite, or a ratio that is no text.
    """
    tables = _tables_by_ratio(paths)
    records = []
    columns = {name.replace("_", " "): name for name in BIAXIAL_COLUMNS}
    units = {name: "N/mm" if name.endswith("load") else "mm/mm" for name in columns}
    for k, (ratio, table) in enumerate(tables.items(), start=1):
        argument = f"paths[{ratio!r}]" if ratio else "paths"
        values = _columns(argument, table, BIAXIAL_COLUMNS).T
        ratios = (ratio,) * len(values) if ratio else None
        if ratios is None and "ratio" in table.columns:
            ratios = tuple(map(str, table["ratio"]))
        records.append(
            BiaxialTable(
                path=None,
                load=values[:, :2],
                strain=values[:, 2:],
                ratio=ratios,
                lines=np.arange(len(values)),
                source=FrameSource("arrays", columns, units),
                argument=argument,
                name=f"path-{k}.csv",
            )
        )
    return tuple(records)


def _columns_of_biaxial(table: BiaxialTable) -> Columns:
    """Return the columns of a CSV file with a biaxial table, with ratios if it has them."""
    values = np.hstack([table.load, table.strain]).T.tolist()
    columns = dict(
        zip(
            ("warp load (N/mm)", "fill load (N/mm)", "warp strain (mm/mm)", "fill strain (mm/mm)"),
            values,
            strict=True,
        )
    )
    if table.ratio is not None:
        columns["ratio"] = table.ratio
    return columns


# Cylinders --------------------------------------------------------------------------------------


def bending_curves_of_arrays(curves: Sequence[Any]) -> tuple[BendingCurve, ...]:
    """Return the measured load curves of a bent cylinder from arrays, one per repetition.

    Parameters
    ----------
    curves : sequence
        Each repetition as a pair of arrays (deflection in mm, load in N), as an (n, 2) array of
        both, or as a DataFrame.

    Raises
    ------
    InputError
        A curve has a number that is not finite, or fewer than two readings.
    """
    columns = {"deflection": "deflection (mm)", "load": "load (N)"}
    source = FrameSource("arrays", columns, {"deflection": "mm", "load": "N"})
    repetitions = []
    for k, curve in enumerate(curves):
        argument = f"curves[{k}]"
        deflection, load = _columns(argument, curve, ("deflection", "load"))
        if len(load) < 2:
            raise InputError(None, argument, f"expected two or more readings, got {len(load)}")
        repetitions.append(BendingCurve(f"curve-{k + 1}", deflection, load, source=source))
    return tuple(repetitions)


def _columns_of_bending(curve: BendingCurve) -> Columns:
    """Return the columns of a CSV file with the load curve of one repetition."""
    return {"deflection (mm)": curve.deflection.tolist(), "load (N)": curve.load.tolist()}
