"""What `bubblefit gauge` writes and says: a table of the gauge, or its load curve."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np

from ..errors import InputError
from ..experiments.curves import LoadCurve
from ..experiments.gauge import GaugeRecord, gauge_load_curve
from ..experiments.machine_loads import read_machine_loads, read_times
from ..experiments.tables import write_table
from ..writing import replacing

HEADER = ("frame", "file", "length_mm", "elongation_mm", "strain", "log_strain")


def loads_at_frames(record: GaugeRecord, options: Mapping[str, Any], name: str) -> LoadCurve:
    """The load curve of the gauge; by time where the frames' times are given, else by frame.

    name : of the specimen unless the options name it.

    Raises
    ------
    InputError : naming the file of loads or of times.
    """
    count = len(record.length)
    interval, times_file = options["frame_interval"], options["frame_times"]
    times = None if interval is None else interval * np.arange(count)
    if times_file is not None:
        with _naming("--frame-time-column"):
            times = read_times(times_file, options["frame_time_column"], decimal=options["decimal"])
        if len(times) != count:
            problem = f"expected one time for each of the {count} frames, got {len(times)}"
            raise InputError(times_file, "", problem)
    named = {"load": options["load_column"], "time": options["time_column"]}
    with _naming("--load-column" if times is None else "--load-column, --time-column"):
        machine = read_machine_loads(
            options["loads"],
            columns={quantity: column for quantity, column in named.items() if column is not None},
            timed=times is not None,
            load_unit=options["load_unit"],
            decimal=options["decimal"],
        )
    if times is None and len(machine.load) != count:
        problem = (
            f"expected one load for each of the {count} frames, got {len(machine.load)};"
            " --frame-times or --frame-interval pair by time"
        )
        raise InputError(options["loads"], "", problem)
    return gauge_load_curve(
        record,
        machine.load,
        direction=options["direction"],
        specimen=(options["specimen"] or name).strip(),
        frame_times=None if times is None else times + (options["time_offset"] or 0.0),
        load_times=machine.time,
        path=options["loads"],
    )


@contextmanager
def _naming(options: str) -> Iterator[None]:
    """Readers ask for their argument `columns`, and --columns means those of the frames."""
    try:
        yield
    except InputError as error:
        problem = error.problem.replace("with columns", f"with {options}")
        raise InputError(error.path, error.field, problem) from None


def gauge_result(
    files: Sequence[Path],
    record: GaugeRecord,
    curve: LoadCurve | None,
    out: Path,
    note: str | None,
) -> dict[str, Any]:
    """The outcome as plain data; frames by the names of their files."""
    seen = np.flatnonzero(np.isfinite(record.length))
    last = seen[np.argmax(record.length[seen])]
    used = seen if curve is None or curve.frame is None else curve.frame
    result: dict[str, Any] = {
        "command": "gauge",
        "out": str(out),
        "gauge_length_mm": record.reference_length,
        "longest": {
            "file": files[last].name,
            "length_mm": float(record.length[last]),
            "elongation_mm": float(record.elongation[last]),
            "strain": float(record.strain[last]),
            "log_strain": float(record.log_strain[last]),
        },
        "frames": len(files),
        "lost": [files[i].name for i in record.lost],
        "warnings": [*record.warnings, *([note] if note else [])],
    }
    if curve is not None:
        without = sorted({*seen.tolist()} - {*used.tolist()})
        result |= {
            "direction": curve.direction,
            "specimen": curve.specimen,
            "points": len(curve.load),
            "largest_load_N": float(curve.load.max()),
            "without_load": [files[i].name for i in without],
        }
    return result


def gauge_table(
    files: Sequence[Path],
    record: GaugeRecord,
    curve: LoadCurve | None,
    options: Mapping[str, Any],
    out: Path,
) -> None:
    """Write the table; without loads every frame has its row, with empty cells where lost.

    Raises
    ------
    OutputError : it cannot be written; what was there is still there.
    """
    frames = range(len(files)) if curve is None or curve.frame is None else curve.frame.tolist()
    columns = (record.length, record.elongation, record.strain, record.log_strain)
    rows: list[list[object]] = []
    for i in frames:
        values = [float(column[i]) for column in columns]
        rows.append([i, files[i].name, *(v if np.isfinite(v) else "" for v in values)])
    header = list(HEADER)
    if curve is not None:
        header += ["load_N", "specimen", "direction"]
        for row, load in zip(rows, curve.load, strict=True):
            row += [float(load), curve.specimen, curve.direction]
    ends = ["({:g}, {:g})".format(*options[name]) for name in ("lower", "upper")]
    about = (
        f"virtual strain gauge between {ends[0]} and {ends[1]} mm,"
        f" {record.reference_length:.6g} mm long in the reference state"
    )
    with replacing(out) as path:
        write_table(path, header, rows, about)


def _few(names: Sequence[str], most: int = 8) -> str:
    more = f" and {len(names) - most} more" if len(names) > most else ""
    return ", ".join(names[:most]) + more


def gauge_lines(result: Mapping[str, Any]) -> str:
    """The outcome in words."""
    end, length = result["longest"], f"{result['gauge_length_mm']:.5g}"
    lines = [
        f"gauge length {length} mm; {result['frames']} frames, lost in {len(result['lost'])}",
        f"elongation up to {end['elongation_mm']:.5g} mm: strain {end['strain']:.4g},"
        f" log strain {end['log_strain']:.4g}",
    ]
    if result["lost"]:
        lines.append(f"correlation lost: {_few(result['lost'])}")
    if "points" in result:
        if result["without_load"]:
            lines.append(f"left out, no load: {_few(result['without_load'])}")
        lines.append(f"{result['points']} points, loads up to {result['largest_load_N']:.5g} N")
        lines.append(
            f"in a project: [uniaxial.{result['direction']}] gauge_length = {length}, and"
            f" [uniaxial.data] files = [{Path(result['out']).name!r}]"
        )
    return "\n".join([*lines, f"written to {result['out']}"])
