"""Commands that evaluate measured data: `gauge`, `dic sphere`, `biaxial` and `cycles`."""

from __future__ import annotations

import re
import statistics
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from ..errors import InputError, OutputError
from ..lazy_modules import pandas as pd
from ..notes import note_lines
from ..readers.sections import LENGTH_UNITS
from ..storage.writing import replacing
from ..version import __version__
from . import options as common
from .options import check_out, columns_named, with_options
from .terminal import FILE, command, group, show, written_to

if TYPE_CHECKING:
    from ..experiments.biaxial import BiaxialTest
    from ..experiments.strips.gauge import PairedLoads
    from ..project.project import Project
    from ..readers.frames import Frame
    from ..readers.spheres import Sphere
    from ..runs.folder import Provenance

#: Arguments of `PairedLoads` that are options of `bubblefit gauge`.
LOAD_OPTIONS = (
    "direction",
    "specimen",
    "load_column",
    "load_unit",
    "load_format",
    "decimal",
    "frame_times",
    "frame_time_column",
    "frame_interval",
    "time_column",
    "time_offset",
)
POSITIVE = click.FloatRange(min=0, min_open=True)
OVERWRITE = click.option("--overwrite", is_flag=True, help="Replace the files of --out.")
AS_JSON = click.option("--json", "as_json", is_flag=True, help="Print the outcome as JSON.")
#: Pattern of the names of arguments in the library's errors that are options of the same name.
ARGUMENTS = "|".join(
    [
        *LOAD_OPTIONS,
        "columns",
        "max_gap",
        "flag_column",
        "format",
        "length_unit",
        "reference_load",
        "length",
        "width",
        "strain_unit",
    ]
)


#: Options for reading frames.
frame_options = with_options(
    click.option("--format", metavar="NAME", help="Of the frames; found by their content."),
    click.option("--columns", metavar="x=..,..", help="Names in the files, where not found."),
    click.option("--flag-column", metavar="NAME", help="Rows where it is not 0 are lost."),
    click.option(
        "--length-unit",
        type=click.Choice(list(LENGTH_UNITS)),
        default="mm",
        help="Of the files [mm].",
    ),
)


@command(
    "gauge",
    'bubblefit gauge "frames/*.csv" --lower 0 -50 --upper 0 50 --out gauge.csv',
    "bubblefit gauge f1.csv f2.csv --lower 0 -50 --upper 0 50 --out warp.csv"
    " --loads machine.csv --direction warp",
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
    type=POSITIVE,
    default=1.35,
    help="Longest edge between points, of the usual one [1.35]; 2.5 for scattered points.",
)
@click.option("--loads", type=FILE, help="The test machine's export.")
@click.option("--direction", metavar="NAME", help="Of the loads: warp, fill or bias.")
@click.option("--specimen", metavar="NAME", help="Of the loads [name of --out].")
@click.option("--load-column", metavar="NAME", help="Where it is not found by itself.")
@click.option(
    "--load-unit", type=click.Choice(["N", "kN", "lbf"]), help="Where the file names none."
)
@click.option("--load-format", metavar="NAME", help="Of the loads; found by their content.")
@click.option("--decimal", type=click.Choice([".", ","]), help="Mark in the loads and times.")
@click.option("--frame-times", type=FILE, help="Table of the frames' times: pairs loads by time.")
@click.option("--frame-time-column", metavar="NAME", help="Where it is not found by itself.")
@click.option(
    "--frame-interval",
    type=POSITIVE,
    metavar="SECONDS",
    help="Between frames, the first at 0: pairs loads by time.",
)
@click.option(
    "--time-offset", type=float, metavar="SECONDS", help="Machine's clock less the frames' [0]."
)
@click.option("--time-column", metavar="NAME", help="Of the loads, where not found by itself.")
@OVERWRITE
@AS_JSON
def gauge_command(frames: tuple[str, ...], out: Path, **options: Any) -> None:
    """Follow a virtual strain gauge through DIC FRAMES (CSV, in order; or a quoted pattern).

    Writes length, elongation, strain and logarithmic strain of each frame. With the machine's
    loads, one a frame or paired by time, a load curve that `strips.data.files` of a project
    reads as it is; frames where correlation was lost, or without a load, are left out of it.
    """
    from ..experiments.strips.gauge import GaugeTable, loads_at_frames, virtual_strain_gauge
    from ..readers.frames import QUANTITIES, frame_files

    with _naming_options():
        loads = _loads(options, out.stem)
        files, note = frame_files(frames, "FRAMES")
        check_out(out, [*files, options["loads"], options["frame_times"]], options["overwrite"])
        recording = _frames(files, options, QUANTITIES, planar=True)
        lower = options["lower"]
        upper = options["upper"]
        record = virtual_strain_gauge(recording, lower, upper, options["max_gap"])
        table = GaugeTable(_frame_names(recording), lower, upper, record, note=note)
        _print_notes(recording)  # before the loads, whose error may have this cause
        warnings = table.notes
        for warning in warnings:
            click.echo(f"warning: {warning.line}", err=True)
        if loads is not None:
            table = replace(table, curve=loads_at_frames(record, loads))
    table.write(out)
    result = {"command": "gauge", "out": str(out), **table.numbers()}
    notes = note_lines(note for note in table.notes if note not in warnings)
    show(result, [*_gauge_lines(result), *notes, f"written to {out}"], options["as_json"])


def _frames(
    files: Sequence[Path], options: Mapping[str, Any], quantities: tuple[str, ...], planar: bool
) -> Sequence[Frame]:
    """Read the frames of an image correlation.

    Parameters
    ----------
    files : sequence of Path
        Files of the frames in their order.
    options : mapping
        Values of `frame_options`.
    quantities : tuple of str
        Quantities to read, such as "x" or "dz".
    planar : bool
        Whether z and dz may be missing from the files.
    """
    from ..readers.frames import FrameOptions, read_frames

    scale = LENGTH_UNITS[options["length_unit"]]
    columns = columns_named(options["columns"])
    flags = options["flag_column"]
    reading = FrameOptions(quantities, columns, flags, length_scale=scale, planar=planar)
    return read_frames(files, reading, options["format"])


def _frame_names(recording: Sequence[Frame]) -> list[str]:
    """Return the names of the files of frames."""
    return [frame.path.name if frame.path else "" for frame in recording]


def _print_notes(recording: Sequence[Frame]) -> None:
    """Print the notes of the reader once, not for every frame."""
    for note in dict.fromkeys(note for frame in recording for note in frame.source.notes):
        click.echo(f"note: {note}", err=True)


def _loads(options: Mapping[str, Any], name: str) -> PairedLoads | None:
    """Return the loads that the options of `gauge` describe, None without --loads.

    `name` : name of the specimen, unless --specimen gives one.
    """
    from ..experiments.strips.gauge import PairedLoads

    settings = {key: options[key] for key in LOAD_OPTIONS if options[key] is not None}
    if options["loads"] is None:
        for key in sorted(settings):
            raise InputError(None, key, "means nothing without --loads")
        return None
    if "direction" not in settings:
        problem = "this option is missing; a load curve needs it: warp, fill or bias"
        raise InputError(None, "direction", problem)
    settings["format"] = settings.pop("load_format", None)
    return PairedLoads(options["loads"], **{"specimen": name, **settings})


@contextmanager
def _naming_options() -> Iterator[None]:
    """Make errors within the block name options of the command instead of library arguments."""
    try:
        yield
    except InputError as error:
        field = error.field
        problem = error.problem
        if error.path is None and re.fullmatch(rf"({ARGUMENTS})(, ({ARGUMENTS}))*", field):
            field = re.sub(ARGUMENTS, _option, field)
        problem = re.sub(r"\b(frame_times|frame_interval|\w+_column)\b", _option, problem)
        raise InputError(error.path, field, problem) from None


def _option(argument: re.Match[str]) -> str:
    """Return the option, such as --max-gap, of a matched argument, such as max_gap."""
    return f"--{argument[0].replace('_', '-')}"


def _gauge_lines(result: Mapping[str, Any]) -> list[str]:
    """Return the lines of the terminal about a virtual strain gauge."""
    end = result["longest"]
    length = f"{result['gauge_length_mm']:.5g}"
    lines = [
        f"gauge length {length} mm; {result['frames']} frames, lost in {len(result['lost'])}",
        f"elongation up to {end['elongation_mm']:.5g} mm: strain"
        f" {100 * end['strain']:.4g} %, log strain {100 * end['log_strain']:.4g} %",
    ]
    if result["lost"]:
        unnamed = f" and {len(result['lost']) - 8} more" if len(result["lost"]) > 8 else ""
        lines.append(f"correlation lost: {', '.join(result['lost'][:8])}{unnamed}")
    if "points" in result:
        lines.append(f"{result['points']} points, loads up to {result['largest_load_N']:.5g} N")
        lines.append(
            f"in a project: [strips.{result['direction']}] gauge_length = {length}, and"
            f" [strips.data] files = [{Path(result['out']).name!r}]"
        )
    return lines


@group("dic", 'bubblefit dic sphere "ball/*.csv" --radius 50.02')
def dic_command() -> None:
    """Test the camera of an image correlation itself."""


@command(
    "sphere",
    'bubblefit dic sphere "ball/*.csv" --radius 50.02',
    "bubblefit dic sphere ball1.csv ball2.csv --out sphere.csv",
)
@click.argument("frames", nargs=-1, required=True)
@click.option("--radius", type=POSITIVE, help="Of the ball, mm; the deviation from it is printed.")
@frame_options
@click.option("--out", type=FILE, help="Table to write (CSV), and beside it a picture.")
@OVERWRITE
@AS_JSON
def dic_sphere(frames: tuple[str, ...], out: Path | None, as_json: bool, **options: Any) -> None:
    """Fit a sphere to the points of each of the FRAMES (any format of DIC, or a quoted pattern).

    Minimises the squared distances without points farther off than 4 robust standard deviations.
    Prints radius and centre with standard errors, the RMS distance, and with --radius the
    deviation from the radius of the ball.
    """
    from ..readers.frames import frame_files
    from ..readers.spheres import fit_sphere, points_of

    files, note = frame_files(frames, "FRAMES")
    if out is not None:
        _check_sphere_files(out, files, options["overwrite"])
    with _naming_options():
        recording = _frames(files, options, ("x", "y", "z"), planar=False)
    names = _frame_names(recording)
    if len(recording) > len(files):
        names = [f"{name}, frame {k + 1}" for k, name in enumerate(names)]
    spheres = [fit_sphere(points_of(frame), frame.path) for frame in recording]
    radius = options["radius"]
    rows = [_sphere_row(name, s, radius) for name, s in zip(names, spheres, strict=True)]
    result: dict[str, Any] = {"command": "dic sphere", "frames": rows}
    if radius is not None:
        result |= _deviations(rows, radius)
    _print_notes(recording)
    if note is not None:
        click.echo(f"note: {note}", err=True)
    if out is not None:
        result["out"] = _write_spheres(out, rows, names, spheres)
    show(result, _sphere_lines(result), as_json)


def _check_sphere_files(out: Path, files: Sequence[Path], overwrite: bool) -> None:
    """Check that the table of `dic sphere` and its picture may be written."""
    if out.suffix.lower() == ".png":
        raise OutputError(f"{out}: the table is a CSV; the picture is written beside it")
    for target in (out, out.with_suffix(".png")):
        check_out(target, files, overwrite)


def _sphere_row(name: str, sphere: Sphere, radius: float | None) -> dict[str, Any]:
    """Return the row of a frame: radius and centre of the fitted sphere with standard errors.

    Where the radius of the ball, mm, is known, the row has the deviation from it, too.
    """
    centre = sphere.centre.tolist()
    errors = sphere.centre_error.tolist()
    row = {
        "frame": name,
        "points": int(sphere.is_used.sum()),
        "left_out": sphere.left_out,
        "radius_mm": sphere.radius,
        "radius_error_mm": sphere.radius_error,
    }
    row |= {f"{axis}_mm": value for axis, value in zip("xyz", centre, strict=True)}
    row |= {f"{axis}_error_mm": error for axis, error in zip("xyz", errors, strict=True)}
    row["rms_mm"] = sphere.rms
    if radius is not None:
        row["deviation_percent"] = 100 * (sphere.radius / radius - 1)
    return row


def _deviations(rows: Sequence[Mapping[str, Any]], radius: float) -> dict[str, float]:
    """Return the radius of the ball, and the mean and largest deviation of the frames from it."""
    deviations = [row["deviation_percent"] for row in rows]
    return {
        "radius_mm": radius,
        "mean_deviation_percent": statistics.fmean(map(abs, deviations)),
        "worst_deviation_percent": max(deviations, key=abs),
    }


def _write_spheres(
    out: Path, rows: Sequence[Mapping[str, Any]], names: Sequence[str], spheres: Sequence[Sphere]
) -> list[str]:
    """Write the table of the frames and their picture; return the names of the files."""
    from ..reports.bubbles import sphere_charts
    from ..reports.vega import save

    with replacing(out) as path:
        pd.DataFrame(rows).to_csv(path, index=False, lineterminator="\n")
    pictures = [
        (f"{name}: {sphere.radius:.3f} mm", sphere.points, sphere.deviation, sphere.is_used)
        for name, sphere in zip(names, spheres, strict=True)
    ]
    picture = out.with_suffix(".png")
    save(picture, sphere_charts(pictures))
    return [str(out), str(picture)]


def _sphere_lines(result: Mapping[str, Any]) -> list[str]:
    """Return the lines of the terminal about the spheres: a table, and the mean deviation."""
    has_radius = "radius_mm" in result
    columns = {
        "frame": "{frame}",
        "points": "{points}",
        "left out": "{left_out}",
        "radius, mm": "{radius_mm:.4f}",
        "+-": "{radius_error_mm:.2g}",
        "centre, mm": "{x_mm:.2f}, {y_mm:.2f}, {z_mm:.2f}",
        "RMS, mm": "{rms_mm:.2g}",
    }
    if has_radius:
        columns["off, %"] = "{deviation_percent:+.2f}"
    rows = [[form.format(**row) for form in columns.values()] for row in result["frames"]]
    table = [[*columns], *rows]
    widths = [max(map(len, column)) for column in zip(*table, strict=True)]
    lines = ["  ".join(c.rjust(w) for c, w in zip(row, widths, strict=True)) for row in table]
    if has_radius:
        lines.append(
            f"radius {result['radius_mm']:g} mm: off by {result['mean_deviation_percent']:.2f} % on"
            f" average, {result['worst_deviation_percent']:+.2f} % at worst"
        )
    if "out" in result:
        lines.append(f"written to {' and '.join(result['out'])}")
    return lines


dic_command.add_command(dic_sphere)


@command(
    "biaxial",
    "bubblefit biaxial project.toml",
    "bubblefit biaxial project.toml --paths 10 --free",
    "bubblefit biaxial project.toml --ratio 1:1 --ratio 2:1 --out out/two-ratios",
)
@common.PROJECT
@common.TESTS
@click.option(
    "--paths",
    type=click.Choice(["8", "10"]),
    default="8",
    show_default=True,
    help="Of five ratios: 10 with the strains of unloaded yarns, 8 without.",
)
@click.option(
    "--reciprocal/--free",
    default=True,
    show_default=True,
    help="Require nu_warp / E_fill = nu_fill / E_warp, or not.",
)
@click.option(
    "--minimise",
    type=click.Choice(["strain", "load"]),
    default="strain",
    show_default=True,
    help="The squares that are minimised.",
)
@click.option("--ratio", "ratios", multiple=True, metavar="W:F", help="Ratios; several.  [all]")
@common.out_option("out/NAME-biaxial")
@common.DATA
@common.OVERWRITE
@common.AS_JSON
def biaxial_command(**options: Any) -> None:
    """Evaluate linear constants per width (E, nu) of the biaxial tests of PROJECT.toml.

    Replaces each yarn's strain by a line over the larger load, then takes least squares. The
    results of all other choices of options are written beside. `bubblefit fit` fits a law of any
    form to the same tests, and `bubblefit export` turns it into such constants.
    """
    from ..experiments.biaxial import BiaxialTest
    from ..experiments.biaxial.evaluation import evaluate_test, lines_of, numbers_of
    from ..experiments.biaxial.paths import canonical_ratio
    from ..materials.designers import Options
    from ..project.project import read_project
    from ..reports.run_pages import write_constants
    from ..runs.folder import Store

    project = read_project(options["project"], common.data_folders(options["data"]))
    named = project.chosen(list(options["tests"]) or "biaxial", fitted=True)
    tests = [test for test in named if isinstance(test, BiaxialTest)]
    ratios = tuple(map(canonical_ratio, options["ratios"]))
    choices = Options(
        unloaded=options["paths"] == "10",
        reciprocal=options["reciprocal"],
        minimise=options["minimise"],
        ratios=ratios,
    )
    evaluations = [evaluate_test(test, choices) for test in tests]
    folder = common.result_folder(options, "biaxial")
    write_constants(project, evaluations, _provenance(project, tests), folder)
    result = {
        "command": "biaxial",
        "title": project.title,
        "version": __version__,
        "tests": {evaluation.test: numbers_of(evaluation) for evaluation in evaluations},
    }
    Store(folder).finish(result)
    lines = [line for evaluation in evaluations for line in lines_of(evaluation)]
    notes = note_lines(note for evaluation in evaluations for note in evaluation.notes)
    for evaluation in evaluations:
        notes += evaluation.verdict.lines
    show(result, [*lines, *notes, written_to(folder)], options["as_json"])


def _provenance(project: Project, tests: Sequence[BiaxialTest]) -> Provenance:
    """Return the origin of constants of biaxial tests, which no solver computed."""
    from ..experiments.biaxial.prepared import PreparedBiaxial
    from ..runs.folder import Provenance, data_rows, this_run

    data = data_rows((test.name, PreparedBiaxial(test)) for test in tests)
    run = this_run(common.command_line())
    return Provenance(project.path, project.written.text, None, data, {}, [run])


@command(
    "cycles",
    "bubblefit cycles strap.csv --reference-load 178",
    "bubblefit cycles warp*.csv --length 200 --width 50 --out out/conditioning",
)
@click.argument("files", nargs=-1, required=True, type=FILE)
@click.option(
    "--reference-load",
    type=POSITIVE,
    metavar="N",
    help="Load at which permanent strains are read; every branch has to pass it"
    " [above the highest load at which a branch begins or ends].",
)
@click.option(
    "--length",
    type=POSITIVE,
    metavar="MM",
    help="That the elongation is of, where a file has no strain.",
)
@click.option("--width", type=POSITIVE, metavar="MM", help="For stiffness per width, N/mm.")
@click.option("--load-unit", type=click.Choice(["N", "kN", "lbf"]), help="Where a file names none.")
@click.option("--strain-unit", type=click.Choice(["%", "mm/mm"]), help="Where a file names none.")
@click.option("--decimal", type=click.Choice([".", ","]), help="Mark in the numbers.")
@click.option(
    "--fit",
    "is_fitted",
    is_flag=True,
    help="Fit a law with a memory; predict cycles from the others.",
)
@common.out_option("out/cycles")
@common.OVERWRITE
@common.AS_JSON
def cycles_command(
    files: tuple[Path, ...],
    out: Path | None,
    overwrite: bool,
    as_json: bool,
    is_fitted: bool,
    **options: Any,
) -> None:
    """Evaluate the load histories of FILES, a specimen each, as test machines export them.

    Prints for each cycle the strain kept at the reference load, the tangent stiffness between 40
    and 90 % of its peak on loading and unloading, and the energy lost. Writes cycles.csv,
    loops.csv (every reading), holds.csv (creep and relaxation), cycles.png and report.html, with
    --fit memory.csv and left-out.csv. Slip and drift of an extensometer are noted.
    """
    from ..experiments.cycles.evaluation import cycles
    from ..reports.run_pages import write_cycles

    folder = common.reserved_folder(out or Path("out/cycles"))
    check_out(folder / "cycles.csv", files, overwrite)
    with _naming_options():
        evaluation = cycles(files, **options)
    result = write_cycles(evaluation, folder, is_fitted=is_fitted)
    lines = [*evaluation.lines(), *(evaluation.fit_lines() if is_fitted else [])]
    lines += [*note_lines(evaluation.notes), *evaluation.verdict.lines, written_to(folder)]
    show(result, lines, as_json)
