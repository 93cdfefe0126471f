"""`bubblefit cache`, `doctor`, `report` and `verify`: the upkeep of runs, solvers and pages."""

from __future__ import annotations

import json
import os
import re
import sys
import tempfile
import time
from collections.abc import Mapping, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

import click

from ..errors import InputError, SolverFailure, check_one_of
from ..materials.card import read_card
from ..materials.exports.base import Option, options_of, write_export
from ..notes import note_records
from ..reports.content import beside
from ..reports.html import PAGE, print_page, write_page
from ..reports.run_pages import page_of_folder
from ..runs.verification import SUBJECTS, Number, verify
from ..solvers.base import Diagnosis
from ..solvers.exports import FORMATS
from ..solvers.registry import command_line, diagnose, solver_names
from ..solvers.run_cache import OFF, VARIABLE, RunCache, run_cache
from .options import AS_JSON, with_options
from .terminal import FILE, WORSE, command, show

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
    gone = []
    if limit is not None:
        before = cache.entries()
        cache.set_limit(int(_amount("--limit", limit, BYTES, "a size such as 500MB or 2GB")))
        left = {entry.path for entry in cache.entries()}
        gone += [entry for entry in before if entry.path not in left]
    clear = options["clear"]
    size = options["size"]
    older = options["older"]
    if clear or size is not None or older is not None:
        least = 0 if clear else None
        age = None
        if size is not None and not clear:
            least = int(_amount("--prune", size, BYTES, "a size such as 500MB or 2GB"))
        if older is not None:
            age = _amount("--older", older, SECONDS, "an age such as 12h, 30d or 8w")
        gone += cache.prune(least, age)
    entries = cache.entries()
    state: dict[str, Any] = {
        "folder": str(cache.folder),
        "runs": len(entries),
        "bytes": sum(entry.size for entry in entries),
        "limit": cache.limit,
        "dropped": len(gone),
        "dropped_bytes": sum(entry.size for entry in gone),
        "used_first": entries[0].used if entries else None,
        "used_last": entries[-1].used if entries else None,
    }
    used = _words(state["bytes"])
    most = _words(cache.limit)
    lines = [f"{cache.folder}: {len(entries)} runs, {used} of at most {most}"]
    if entries:
        first = _ago(entries[0].used)
        last = _ago(entries[-1].used)
        lines.append(f"last used between {first} and {last} ago")
    if gone:
        lines.append(f"dropped: {len(gone)} runs, {_words(state['dropped_bytes'])}")
    show(state, lines, options["as_json"])


def _words(size: int) -> str:
    unit = next((u for u in ("GB", "MB", "kB") if size >= BYTES[u]), "B")
    return f"{size / BYTES[unit]:.3g} {unit}"


def _ago(used: float) -> str:
    seconds = max(0.0, time.time() - used)
    for unit, words in (("w", "weeks"), ("d", "days"), ("h", "hours")):
        if seconds >= 2 * SECONDS[unit]:
            return f"{seconds / SECONDS[unit]:.0f} {words}"
    return f"{seconds / 60:.0f} minutes"


def _amount(option: str, text: str, units: Mapping[str, float], such: str) -> float:
    found = re.fullmatch(r"(\d+(?:\.\d+)?) ?(\w*)", text.strip())
    if found is None or found[2] not in units:
        raise InputError(None, option, f"expected {such}, got {text!r}")
    return float(found[1]) * units[found[2]]


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
    found = diagnose(**programs)
    good = all(one.usable for one in found if one.expected)
    if solver is not None:
        good = good and any(one.usable for one in found if one.name == solver)
    if as_json:
        solvers = [{**asdict(one), "path": one.path and str(one.path)} for one in found]
        click.echo(json.dumps({"ok": good, "solvers": solvers}, indent=1))
    else:
        for one in found:
            click.echo(_solver_line(one))
            if one.advice:
                click.echo(f"{'':10}  {one.advice}")
        if not any(one.name == "calculix" and one.usable for one in found):
            click.echo("Fits work without CalculiX; it is the reference to check them against.")
    if not good:
        sys.exit(SolverFailure.exit_code)


def _solver_line(one: Diagnosis) -> str:
    state = "ok" if one.usable else "NOT USABLE"
    where = f"{one.path} ({one.origin})" if one.path else one.origin
    words = [f"{one.name:10}  {state}", f"version {one.version}" if one.version else "", where]
    words.append(one.remark)
    if one.difference is not None:
        words.append(f"bars within {100 * one.difference:.4f} % of Marc")
    return "  ".join(word for word in words if word)


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
def report_command(folders: tuple[Path, ...], kind: str, out: Path | None) -> None:
    """Make the page of an output folder again, or one of two folders side by side.

    The page is computed from the files of the folder alone: the same bytes but for the date. For
    a run that is not finished it shows the records so far.
    """
    if len(folders) > 2:
        raise InputError(None, "FOLDER", f"give one folder or two, not {len(folders)}")
    for folder in folders:
        if not folder.is_dir():
            if folder.exists():
                raise InputError(folder, "", "is a file; name the output folder of a run")
            raise InputError(folder, "", "there is no such folder")
    reports = [page_of_folder(folder) for folder in folders]
    if len(folders) == 1:
        base = folders[0]
        report = reports[0]
        usual = folders[0] / PAGE
    else:
        base = Path(os.path.commonpath([folder.resolve() for folder in folders]))
        names = [folder.resolve().relative_to(base).as_posix() for folder in folders]
        if "." in names or names[0] == names[1]:
            raise InputError(folders[1], "", "give two folders, neither within the other")
        report = beside((names[0], reports[0]), (names[1], reports[1]))
        plain = [folder.resolve().name for folder in folders]
        usual = Path(f"{plain[0]}-beside-{plain[1]}.html")
    path = out or (usual if kind == "html" else usual.with_suffix(".pdf"))
    if kind == "html":
        write_page(base, report, path)
    else:
        with tempfile.TemporaryDirectory() as place:
            print_page(write_page(base, report, Path(place) / PAGE), path)
    click.echo(f"page: {path}")


COLUMNS = f"{'':58}{'ours':>12}  {'theirs':>12}       {'off':>10}  {'allowed':>9}  source"


@command("verify", "bubblefit verify", "bubblefit verify --subject bars --subject hencky")
@click.option(
    "--subject",
    "subjects",
    multiple=True,
    metavar="NAME",
    help=f"One of: {', '.join(SUBJECTS)}.  [all]",
)
@click.option(
    "--data",
    type=Path,
    metavar="FOLDER",
    help="Measured strips (valmex7318_load_gauge.csv), for Table 3.1's R^2.",
)
@click.option("--json", "as_json", is_flag=True, help="Print the numbers on stdout as JSON.")
def verify_command(subjects: Sequence[str], data: Path | None, as_json: bool) -> None:
    """Compare with published numbers and closed forms. Takes a few minutes.

    Exit code 1 when a number is further off than its model, mesh or figure allows. CalculiX takes
    part where `bubblefit doctor` finds a usable one.
    """

    heads = iter([COLUMNS])

    def saw(subject: str, some: Sequence[Number]) -> None:
        for head in heads:  # once
            click.echo(head)
        if not some:
            click.echo(f"{subject}: not here (bubblefit doctor says why), nothing compared")
        for one in some:
            factor, unit = (1.0, one.unit) if one.absolute else (100.0, "%")
            click.echo(
                f"{one.what:58}{one.ours:12.6g}  {one.theirs:12.6g} {one.unit:5}"
                f"{factor * one.deviation:+10.4f} {unit:2}{factor * one.allowed:8.4g}  {one.source}"
                f"{'' if one.met else '   MISSED'}"
            )

    if as_json:
        found = verify(subjects or None, data=data)
        click.echo(json.dumps(found.result, indent=1))
    else:
        found = verify(subjects or None, data=data, saw=saw)
        count = len(found.result["numbers"])
        missed = found.missed
        names = "; ".join(one.what for one in missed)
        said = f"{len(missed)} of {count} missed: {names}"
        click.echo(said if missed else f"all {count} numbers are met")
    if found.missed:
        sys.exit(WORSE)


def _values(known: Option) -> click.ParamType:
    if known.choices:
        return click.Choice(known.choices)
    least = known.least if known.above is None else known.above
    if known.kind is int:
        return click.IntRange(None if least is None else int(least))
    return click.FloatRange(least, known.most, min_open=known.above is not None)


#: The options of all formats.
format_options = with_options(
    *(
        click.option(f"--{name.replace('_', '-')}", type=_values(known), help=known.help)
        for name, known in options_of(FORMATS.values()).items()
    )
)


@command(
    "export",
    "bubblefit export out/fabric/material.toml --format marc",
    "bubblefit export material.toml --format calculix --out for-ccx --force",
)
@click.argument("card", type=FILE)
@click.option("--format", "name", type=click.Choice(list(FORMATS)), required=True)
@click.option(
    "--out", type=FILE, help="File or folder to write to [CARD-FORMAT.* here]; others go beside it."
)
@click.option("--force", is_flag=True, help="Write over files that are there.")
@format_options
@click.option("--json", "as_json", is_flag=True, help="Print what was written as JSON.")
def export_command(
    card: Path, name: str, out: Path | None, force: bool, as_json: bool, **options: Any
) -> None:
    """Write the material of CARD (a material.toml) for another program.

    Each file begins with the parts of the law that the target keeps, those it loses, and those to
    be confirmed there; the same is printed. See `bubblefit docs exports`.
    """
    given = {option: value for option, value in options.items() if value is not None}
    FORMATS[name].check(given)
    material = read_card(card)
    try:
        export = FORMATS[name].export(material, **given)
    except InputError as error:
        raise InputError(card, error.field, error.problem) from None
    default = f"{card.stem}-{name}"
    first, *others = export.files
    target = Path(default + first) if out is None else out
    if target.is_dir():
        target = target / (default + first)
    paths = [target, *(target.with_suffix(suffix) for suffix in others)]
    if len(set(paths)) < len(paths):
        problem = f"{', '.join(others)} is what another file ends in; use {first}"
        raise InputError(None, "--out", f"{target}: {problem}")
    for path in paths:
        if path.exists() and path.samefile(card):
            raise InputError(None, "--out", f"{path} is the card itself; name another file")
    write_export(export, paths, force)
    files = [str(path) for path in paths]
    said: dict[str, Any] = {"carries": export.says.carries, "loses": export.says.loses}
    said |= {"confirm": export.says.confirm, "notes": note_records(export.says.notes)}
    lines = [*export.says.lines(), f"written to {', '.join(files)}"]
    show({"files": files, "format": name, **said}, lines, as_json)
