"""Commands for solvers and pages: `cache`, `doctor` and `report`."""

from __future__ import annotations

import os
import re
import sys
import tempfile
import time
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from ..errors import InputError, SolverFailure, check_one_of
from ..solvers.registry import command_line, diagnose, solver_names
from ..solvers.run_cache import OFF, VARIABLE, Entry, RunCache, run_cache
from .options import AS_JSON, with_options
from .terminal import FILE, command, show

if TYPE_CHECKING:
    from ..reports.content import Report
    from ..solvers.base import Diagnosis

BYTES = {"": 1, "B": 1, "kB": 10**3, "KB": 10**3, "MB": 10**6, "GB": 10**9, "TB": 10**12}
SECONDS = {"h": 3600.0, "d": 86400.0, "w": 604800.0}


@command(
    "cache", "bubblefit cache", "bubblefit cache --older 8w --prune 2GB", "bubblefit cache --clear"
)
@click.option("--folder", type=FILE, help="Of the runs, where a project names one of its own.")
@click.option("--clear", is_flag=True, help="Drop all runs.")
@click.option(
    "--prune", "size", metavar="SIZE", help="Drop what was used longest ago until SIZE is left."
)
@click.option("--older", metavar="AGE", help="Drop what was not used for so long: 12h, 30d, 8w.")
@click.option("--limit", metavar="SIZE", help="From now on drop runs beyond SIZE: 500MB, 5GB.")
@AS_JSON
def cache_command(folder: Path | None, limit: str | None, **options: Any) -> None:
    """Show or prune the cache of runs of CalculiX, Marc and solvers of plug-ins.

    A run that ended well is not repeated, in any project, where law, model, solver, settings,
    program and templates have the same content. The folder is bubblefit's own cache folder, [fit]
    cache of a project, or BUBBLEFIT_RUNS, which also turns the cache off: BUBBLEFIT_RUNS=off.
    """
    cache = run_cache() if folder is None else RunCache(folder)
    if cache is None:
        raise InputError(None, VARIABLE, f"is {OFF!r}: no runs are kept, name a folder instead")
    dropped = []
    if limit is not None:
        dropped += _limit(cache, limit)
    if options["clear"] or options["size"] is not None or options["older"] is not None:
        dropped += _prune(cache, options)
    entries = cache.entries()
    state = {
        "folder": str(cache.folder),
        "runs": len(entries),
        "bytes": sum(entry.size for entry in entries),
        "limit": cache.limit,
        "dropped": len(dropped),
        "dropped_bytes": sum(entry.size for entry in dropped),
        "used_first": entries[0].used if entries else None,
        "used_last": entries[-1].used if entries else None,
    }
    show(state, _cache_lines(state), options["as_json"])


def _limit(cache: RunCache, limit: str) -> list[Entry]:
    """Limit the size of the cache; return the runs that it drops."""
    entries = cache.entries()
    cache.set_limit(_size("--limit", limit))
    remaining = {entry.path for entry in cache.entries()}
    return [entry for entry in entries if entry.path not in remaining]


def _prune(cache: RunCache, options: Mapping[str, Any]) -> list[Entry]:
    """Drop runs as --clear, --prune and --older say; return them."""
    size = 0 if options["clear"] else None
    age = None
    if options["size"] is not None and not options["clear"]:
        size = _size("--prune", options["size"])
    if options["older"] is not None:
        age = _amount("--older", options["older"], SECONDS, "an age such as 12h, 30d or 8w")
    return cache.prune(size, age)


def _cache_lines(state: Mapping[str, Any]) -> list[str]:
    """Return the lines of the terminal about the cache."""
    size = _size_words(state["bytes"])
    limit = _size_words(state["limit"])
    lines = [f"{state['folder']}: {state['runs']} runs, {size} of at most {limit}"]
    if state["runs"]:
        oldest = _time_since(state["used_first"])
        newest = _time_since(state["used_last"])
        lines.append(f"last used between {oldest} and {newest} ago")
    if state["dropped"]:
        lines.append(f"dropped: {state['dropped']} runs, {_size_words(state['dropped_bytes'])}")
    return lines


def _size_words(size: int) -> str:
    """Return a size in bytes, with a unit."""
    unit = next((u for u in ("GB", "MB", "kB") if size >= BYTES[u]), "B")
    return f"{size / BYTES[unit]:.3g} {unit}"


def _time_since(used: float) -> str:
    """Return in words how long ago a time was; `used` is in seconds since the epoch."""
    seconds = max(0.0, time.time() - used)
    for unit, words in (("w", "weeks"), ("d", "days"), ("h", "hours")):
        if seconds >= 2 * SECONDS[unit]:
            return f"{seconds / SECONDS[unit]:.0f} {words}"
    return f"{seconds / 60:.0f} minutes"


def _size(option: str, text: str) -> int:
    """Return the size in bytes that the text of an option gives, such as 500MB."""
    return int(_amount(option, text, BYTES, "a size such as 500MB or 2GB"))


def _amount(option: str, text: str, units: Mapping[str, float], expected: str) -> float:
    """Return the amount that the text of an option gives: a number times its unit.

    Parameters
    ----------
    option : str
        Name of the option, for errors.
    text : str
        Value of the option, such as "30d".
    units : mapping of str to float
        Size of each unit.
    expected : str
        Words for what is expected, for errors.
    """
    amount = re.fullmatch(r"(\d+(?:\.\d+)?) ?(\w*)", text.strip())
    if amount is None or amount[2] not in units:
        raise InputError(None, option, f"expected {expected}, got {text!r}")
    return float(amount[1]) * units[amount[2]]


#: An option for each solver that has a program, to test that program.
_programs = with_options(
    *(click.option(f"--{o.name}", metavar=o.metavar, help=o.look) for o in command_line() if o.look)
)


@command("doctor", "bubblefit doctor", "bubblefit doctor --ccx /opt/ccx/bin/ccx --json")
@_programs
@click.option("--solver", metavar="NAME", help="A solver, such as a plug-in, that has to work.")
@click.option("--json", "as_json", is_flag=True, help="Print the findings on stdout as JSON.")
def doctor_command(solver: str | None, as_json: bool, **programs: str | None) -> None:
    """List every solver found and prove each with bars whose end stresses are published.

    Exit code 0 when the embedded solver works and so does every other one that was named (--ccx,
    BUBBLEFIT_CCX, --marc, BUBBLEFIT_MARC, --solver) or built (make calculix); 4 otherwise. A ccx
    or Marc that merely lies on the PATH, or a plug-in that is installed, is reported, but does not
    count.
    """
    check_one_of(solver, solver_names(), "--solver")
    solvers = diagnose(**programs)
    is_usable = all(diagnosis.usable for diagnosis in solvers if diagnosis.expected)
    if solver is not None:
        is_usable = is_usable and any(d.usable for d in solvers if d.name == solver)
    if as_json:
        show({"ok": is_usable, "solvers": solvers}, (), as_json)
    else:
        _print_solvers(solvers)
    if not is_usable:
        sys.exit(SolverFailure.exit_code)


def _print_solvers(solvers: Sequence[Diagnosis]) -> None:
    """Print what was found about every solver."""
    for diagnosis in solvers:
        click.echo(_solver_line(diagnosis))
        if diagnosis.advice:
            click.echo(f"{'':10}  {diagnosis.advice}")
    if not any(d.name == "calculix" and d.usable for d in solvers):
        click.echo("Fits work without CalculiX; it is the reference to check them against.")


def _solver_line(diagnosis: Diagnosis) -> str:
    """Return the line of the terminal about a solver."""
    path = diagnosis.path
    parts = [
        f"{diagnosis.name:10}  {'ok' if diagnosis.usable else 'NOT USABLE'}",
        f"version {diagnosis.version}" if diagnosis.version else "",
        f"{path} ({diagnosis.origin})" if path else diagnosis.origin,
        diagnosis.remark,
    ]
    if diagnosis.difference is not None:
        parts.append(f"bars within {100 * diagnosis.difference:.4f} % of Marc")
    return "  ".join(part for part in parts if part)


@command(
    "report",
    "bubblefit report out/fabric",
    "bubblefit report out/fabric --format pdf",
    "bubblefit report out/cubic out/spline --out both.html",
)
@click.argument("folders", type=FILE, nargs=-1, required=True, metavar="FOLDER [OTHER]")
@click.option(
    "--format",
    "kind",
    type=click.Choice(["html", "pdf"]),
    default="html",
    show_default=True,
    help="pdf: printed by a browser, where there is one.",
)
@click.option(
    "--out", type=FILE, help="The file.  [FOLDER/report.html; of two: FOLDER-beside-OTHER.html]"
)
@click.option(
    "--letterhead",
    type=FILE,
    help="Picture (PNG, JPEG), such as a logo, above the title with the laboratory of the project.",
)
def report_command(
    folders: tuple[Path, ...],
    kind: str,
    out: Path | None,
    letterhead: Path | None,
) -> None:
    """Make the page of an output folder again, or one of two folders side by side.

    The page is computed from the files of the folder alone: the same bytes but for the date. For
    a run that is not finished it shows the records so far.
    """
    from ..reports.html import PAGE, print_page, write_page
    from ..reports.run_pages import page_of_folder

    if len(folders) > 2:
        raise InputError(None, "FOLDER", f"give one folder or two, not {len(folders)}")
    for folder in folders:
        _check_folder(folder)
    if len(folders) == 1:
        base = folders[0]
        report = page_of_folder(base)
        usual = base / PAGE
    else:
        base, report, usual = _side_by_side(*folders)
    path = out or (usual if kind == "html" else usual.with_suffix(".pdf"))
    if kind == "html":
        write_page(base, report, path, letterhead)
    else:
        with tempfile.TemporaryDirectory() as temporary:
            page = write_page(base, report, Path(temporary) / PAGE, letterhead)
            print_page(page, path)
    click.echo(f"page: {path}")


def _check_folder(folder: Path) -> None:
    """Check that an output folder is there."""
    if folder.is_dir():
        return
    if folder.exists():
        raise InputError(folder, "", "is a file; name the output folder of a run")
    raise InputError(folder, "", "there is no such folder")


def _side_by_side(left: Path, right: Path) -> tuple[Path, Report, Path]:
    """Return the common folder of two output folders, their merged report, and its usual path."""
    from ..reports.content import side_by_side
    from ..reports.run_pages import page_of_folder

    reports = [page_of_folder(left), page_of_folder(right)]
    base = Path(os.path.commonpath([left.resolve(), right.resolve()]))
    names = [folder.resolve().relative_to(base).as_posix() for folder in (left, right)]
    if "." in names or names[0] == names[1]:
        raise InputError(right, "", "give two folders, neither within the other")
    report = side_by_side((names[0], reports[0]), (names[1], reports[1]))
    return base, report, Path(f"{left.resolve().name}-beside-{right.resolve().name}.html")
