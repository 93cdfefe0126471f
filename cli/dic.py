"""`bubblefit dic sphere FILES...`: whether a camera sees lengths as they are."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import click
import numpy as np

from ..errors import InputError, OutputError
from ..readers.frames import FrameOptions, frame_files, read_frames
from ..readers.sections import LENGTH_UNITS
from ..readers.surfaces import Sphere, fit_sphere, points_of
from ..readers.tables import write_table
from ..writing import replacing
from .ending import tell
from .examples import examples
from .exits import exits
from .frame_arguments import check_out, columns_named, frame_options
from .usage import Suggesting

#: What a frame must hold; where it has displacements, too, they are added.
PLACES = ("x", "y", "z")


@click.group(
    "dic",
    cls=Suggesting,
    epilog=examples(
        'bubblefit dic sphere "ball/*.csv" --radius 50.02',
    ),
)
def command() -> None:
    """What image correlation is worth: tests of the camera itself."""


@command.command(
    "sphere",
    epilog=examples(
        'bubblefit dic sphere "ball/*.csv" --radius 50.02',
        "bubblefit dic sphere ball1.csv ball2.csv --out sphere.csv",
    ),
)
@click.argument("frames", nargs=-1, required=True)
@click.option(
    "--radius",
    type=click.FloatRange(min=0, min_open=True),
    help="Of the ball, mm: the deviation from it is told.",
)
@frame_options
@click.option(
    "--out", type=click.Path(path_type=Path), help="Table to write (CSV), and beside it a picture."
)
@click.option("--overwrite", is_flag=True, help="Replace the files of --out.")
@click.option("--json", "as_json", is_flag=True, help="Print the outcome as JSON on stdout.")
@exits
def sphere(frames: tuple[str, ...], out: Path | None, as_json: bool, **options: Any) -> None:
    """A ball through the points of each of the FRAMES (any format of DIC, or a quoted pattern).

    Least squares of the distances, points farther off than 4 robust standard deviations left out.
    Tells radius and centre with standard errors, the RMS distance, and with --radius how far the
    radius is from the ball's own.
    """
    files, note = frame_files(frames, "FRAMES")
    if out is not None:
        if out.suffix.lower() == ".png":
            raise OutputError(f"{out}: the table is a CSV; the picture is written beside it")
        for target in (out, out.with_suffix(".png")):
            check_out(target, files, options["overwrite"])
    try:
        asked = FrameOptions(
            PLACES,
            columns_named(options["columns"]),
            options["flag_column"],
            length_scale=LENGTH_UNITS[options["length_unit"]],
        )
        read = read_frames(files, asked, options["format"])
    except InputError as error:
        if error.path is not None:
            raise
        raise InputError(None, f"--{error.field.replace('_', '-')}", error.problem) from None
    names = [frame.path.name if frame.path else "" for frame in read]
    if len(read) > len(files):
        names = [f"{name}, frame {k + 1}" for k, name in enumerate(names)]
    found = [fit_sphere(points_of(frame), frame.path) for frame in read]
    rows = [_row(name, one, options["radius"]) for name, one in zip(names, found, strict=True)]
    result: dict[str, Any] = {"command": "dic sphere", "frames": rows}
    if options["radius"] is not None:
        off = np.array([row["deviation_percent"] for row in rows])
        result["radius_mm"] = options["radius"]
        result["mean_deviation_percent"] = float(np.abs(off).mean())
        result["worst_deviation_percent"] = float(off[np.argmax(np.abs(off))])
    # What a reader chose is said once, not for every frame.
    words = dict.fromkeys(str(one) for frame in read for one in frame.source.notes)
    for said in [*words, *([] if note is None else [str(note)])]:
        click.echo(f"note: {said}", err=True)
    if out is not None:
        _write(out, rows, names, found)
        result["out"] = [str(out), str(out.with_suffix(".png"))]
    tell(result, _lines(result), as_json)


def _row(name: str, one: Sphere, radius: float | None) -> dict[str, Any]:
    row: dict[str, Any] = {
        "frame": name,
        "points": int(one.kept.sum()),
        "left_out": one.left_out,
        "radius_mm": one.radius,
        "radius_error_mm": one.radius_error,
        **{f"{axis}_mm": float(v) for axis, v in zip("xyz", one.centre, strict=True)},
        **{f"{axis}_error_mm": float(v) for axis, v in zip("xyz", one.centre_error, strict=True)},
        "rms_mm": one.rms,
    }
    if radius is not None:
        row["deviation_percent"] = 100 * (one.radius / radius - 1)
    return row


def _lines(result: dict[str, Any]) -> list[str]:
    """A table for the terminal."""
    known = "radius_mm" in result
    head = ["frame", "points", "left out", "radius, mm", "+-", "centre, mm", "RMS, mm"]
    cells = [[*head, *(["off, %"] if known else [])]]
    for row in result["frames"]:
        centre = ", ".join(f"{row[f'{axis}_mm']:.2f}" for axis in "xyz")
        line = [row["frame"], str(row["points"]), str(row["left_out"]), f"{row['radius_mm']:.4f}"]
        line += [f"{row['radius_error_mm']:.2g}", centre, f"{row['rms_mm']:.2g}"]
        cells.append([*line, *([f"{row['deviation_percent']:+.2f}"] if known else [])])
    widths = [max(len(row[k]) for row in cells) for k in range(len(cells[0]))]
    lines = ["  ".join(c.rjust(w) for c, w in zip(row, widths, strict=True)) for row in cells]
    if known:
        lines.append(
            f"radius {result['radius_mm']:g} mm: off by {result['mean_deviation_percent']:.2f} % on"
            f" average, {result['worst_deviation_percent']:+.2f} % at worst"
        )
    if "out" in result:
        lines.append(f"written to {' and '.join(result['out'])}")
    return lines


def _write(
    out: Path, rows: Sequence[dict[str, Any]], names: Sequence[str], found: Sequence[Sphere]
) -> None:
    from ..reports.sphere import plot_spheres

    with replacing(out) as path:
        write_table(path, list(rows[0]), [list(row.values()) for row in rows])
    plot_spheres(
        out.with_suffix(".png"),
        [
            (f"{name}: {one.radius:.3f} mm", one.points, one.deviation, one.kept)
            for name, one in zip(names, found, strict=True)
        ],
    )
