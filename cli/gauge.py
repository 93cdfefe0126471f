"""`bubblefit gauge FRAMES...`: a virtual strain gauge through DIC frames of a strip test."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import Any

import click

from ..errors import InputError
from ..experiments.strips.gauge import (
    GaugeTable,
    PairedLoads,
    loads_at_frames,
    virtual_strain_gauge,
)
from ..notes import lines as note_lines
from ..readers.frames import QUANTITIES, FrameOptions, frame_files, read_frames
from ..readers.sections import LENGTH_UNITS
from .ending import tell
from .examples import examples
from .exits import exits
from .frame_arguments import check_out, columns_named, frame_options

FILE = click.Path(path_type=Path)
#: Options that say something of the loads, by the name of the argument.
OF_LOADS = tuple(
    "direction specimen load_column load_unit load_format decimal frame_times frame_time_column"
    " frame_interval time_column time_offset".split()
)
#: Arguments that are options of the same name.
ARGUMENTS = "|".join([*OF_LOADS, "columns", "max_gap", "flag_column", "format", "length_unit"])


@click.command(
    "gauge",
    epilog=examples(
        'bubblefit gauge "frames/*.csv" --lower 0 -50 --upper 0 50 --out gauge.csv',
        "bubblefit gauge f1.csv f2.csv --lower 0 -50 --upper 0 50 --out warp.csv"
        " --loads machine.csv --direction warp",
    ),
)
@click.argument("frames", nargs=-1, required=True)
@click.option(
    "--lower", type=float, nargs=2, required=True, metavar="X Y", help="One end, mm, undeformed."
)
@click.option(
    "--upper", type=float, nargs=2, required=True, metavar="X Y", help="The other end, mm."
)
@click.option("--out", type=FILE, required=True, help="The table to write (CSV).")
@frame_options
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
@click.option("--load-format", metavar="NAME", help="Of the loads; found by their content.")
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
    loads, one a frame or paired by time, a load curve that `strips.data.files` of a project
    reads as it is; frames where correlation was lost, or without a load, are left out of it.
    """
    with _naming_options():
        loads = _loads(options, out.stem)
        files, note = frame_files(frames, "FRAMES")
        check_out(out, [*files, options["loads"], options["frame_times"]], options["overwrite"])
        asked = FrameOptions(
            QUANTITIES,
            columns_named(options["columns"]),
            options["flag_column"],
            length_scale=LENGTH_UNITS[options["length_unit"]],
            planar=True,
        )
        read = read_frames(files, asked, options["format"])
        lower, upper = options["lower"], options["upper"]
        record = virtual_strain_gauge(read, lower, upper, options["max_gap"])
        names = [frame.path.name if frame.path else "" for frame in read]
        table = GaugeTable(names, lower, upper, record, note=note)
        # At once: should the loads be refused, this may be why.
        for words in dict.fromkeys(note for frame in read for note in frame.source.notes):
            click.echo(f"note: {words}", err=True)
        said = table.notes
        for one in said:
            click.echo(f"warning: {one.line}", err=True)
        if loads is not None:
            table = replace(table, curve=loads_at_frames(record, loads))
    table.write(out)
    result = {"command": "gauge", "out": str(out), **table.numbers()}
    more = [note for note in table.notes if note not in said]
    tell(result, [*_lines(result), *note_lines(more), f"written to {out}"], options["as_json"])


def _loads(options: Mapping[str, Any], name: str) -> PairedLoads | None:
    """What the options say of the loads; None without loads. `name` : of the specimen."""
    given = {key: options[key] for key in OF_LOADS if options[key] is not None}
    if options["loads"] is None:
        for key in sorted(given):
            raise InputError(None, key, "means nothing without --loads")
        return None
    if "direction" not in given:
        problem = "this option is missing; a load curve needs it: warp, fill or bias"
        raise InputError(None, "direction", problem)
    given["format"] = given.pop("load_format", None)
    return PairedLoads(options["loads"], **{"specimen": name, **given})


@contextmanager
def _naming_options() -> Iterator[None]:
    """Arguments that are wrong are told by the names of the options."""
    try:
        yield
    except InputError as error:
        field, problem = error.field, error.problem
        if error.path is None and re.fullmatch(rf"({ARGUMENTS})(, ({ARGUMENTS}))*", field):
            field = re.sub(ARGUMENTS, _option, field)
        problem = re.sub(r"\b(frame_times|frame_interval|\w+_column)\b", _option, problem)
        raise InputError(error.path, field, problem) from None


def _option(found: re.Match[str]) -> str:
    return f"--{found[0].replace('_', '-')}"


def _lines(result: Mapping[str, Any]) -> list[str]:
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
        lines.append(f"{result['points']} points, loads up to {result['largest_load_N']:.5g} N")
        lines.append(
            f"in a project: [strips.{result['direction']}] gauge_length = {length}, and"
            f" [strips.data] files = [{Path(result['out']).name!r}]"
        )
    return lines


def _few(names: Sequence[str], most: int = 8) -> str:
    more = f" and {len(names) - most} more" if len(names) > most else ""
    return ", ".join(names[:most]) + more
