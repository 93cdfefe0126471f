"""`bubblefit gauge FRAMES...`: a virtual strain gauge through DIC frames of a strip test."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import click

from ..errors import OutputError
from ..experiments.gauge import virtual_strain_gauge
from ..experiments.gauge_frames import read_gauge_frames
from ..projects.schema import LENGTH_UNITS
from .frame_files import frame_files
from .gauge_options import check_options, column_names
from .gauge_results import gauge_lines, gauge_result, gauge_table, loads_at_frames
from .options import exits

FILE = click.Path(path_type=Path)


@click.command("gauge")
@click.argument("frames", nargs=-1, required=True)
@click.option(
    "--lower", type=float, nargs=2, required=True, metavar="X Y", help="One end, mm, undeformed."
)
@click.option(
    "--upper", type=float, nargs=2, required=True, metavar="X Y", help="The other end, mm."
)
@click.option("--out", type=FILE, required=True, help="The table to write (CSV).")
@click.option("--columns", metavar="x=..,..", help="Names in the files of x, y, z, dx, dy, dz.")
@click.option("--flag-column", metavar="NAME", help="Rows where it is not 0 are lost.")
@click.option(
    "--length-unit", type=click.Choice(list(LENGTH_UNITS)), default="mm", help="Of the files [mm]."
)
@click.option(
    "--max-gap",
    type=click.FloatRange(min=0, min_open=True),
    default=1.35,
    help="Longest edge between points, of the usual one [1.35]; 2.5 for scattered points.",
)
@click.option("--loads", type=FILE, help="The test machine's export.")
@click.option("--direction", metavar="NAME", help="Of the loads: warp, fill or bias.")
@click.option("--specimen", metavar="NAME", help="Of the loads [name of --out].")
@click.option("--load-column", metavar="NAME", help="Where it is not found by itself.")
@click.option("--load-unit", type=click.Choice(["N", "kN"]), help="Where the file names none.")
@click.option("--decimal", type=click.Choice([".", ","]), help="Mark in the loads and times.")
@click.option("--frame-times", type=FILE, help="Table of the frames' times: pairs loads by time.")
@click.option("--frame-time-column", metavar="NAME", help="Where it is not found by itself.")
@click.option(
    "--frame-interval",
    type=click.FloatRange(min=0, min_open=True),
    metavar="SECONDS",
    help="Between frames, the first at 0: pairs loads by time.",
)
@click.option(
    "--time-offset", type=float, metavar="SECONDS", help="Machine's clock less the frames' [0]."
)
@click.option("--time-column", metavar="NAME", help="Of the loads, where not found by itself.")
@click.option("--overwrite", is_flag=True, help="Replace the file of --out.")
@click.option("--json", "as_json", is_flag=True, help="Print the outcome as JSON on stdout.")
@exits
def command(frames: tuple[str, ...], out: Path, **options: Any) -> None:
    """Follow a virtual strain gauge through DIC FRAMES (CSV, in order; or a quoted pattern).

    Writes length, elongation, strain and logarithmic strain of each frame. With the machine's
    loads, one a frame or paired by time, a load curve that `uniaxial.data.files` of a project
    reads as it is; frames where correlation was lost, or without a load, are left out of it.
    """
    check_options(options)
    files, note = frame_files(frames)
    inputs = [*files, options["loads"], options["frame_times"]]
    if out.resolve() in [file.resolve() for file in inputs if file is not None]:
        raise OutputError(f"{out}: is one of the files to be read; choose another --out")
    if out.exists() and not options["overwrite"]:
        raise OutputError(f"{out}: is already there; use --overwrite or another --out")
    scale = LENGTH_UNITS[options["length_unit"]]
    read = read_gauge_frames(
        files, column_names(options["columns"]), options["flag_column"], length_scale=scale
    )
    record = virtual_strain_gauge(read, options["lower"], options["upper"], options["max_gap"])
    # At once: should the loads be refused, this may be why.
    for words in (*record.warnings, *([note] if note else [])):
        click.echo(f"warning: {words}", err=True)
    curve = loads_at_frames(record, options, out.stem) if options["loads"] else None
    result = gauge_result(files, record, curve, out, note)
    gauge_table(files, record, curve, options, out)
    click.echo(json.dumps(result, indent=1) if options["as_json"] else gauge_lines(result))
