"""`bubblefit cache`: runs of other programs that are kept, how many, where; and fewer of them."""

from __future__ import annotations

import re
import time
from pathlib import Path
from typing import Any

import click

from ..errors import InputError
from .arguments import AS_JSON, PATH
from .ending import tell
from .examples import examples
from .exits import exits

BYTES = {"": 1, "B": 1, "KB": 10**3, "MB": 10**6, "GB": 10**9, "TB": 10**12}
SECONDS = {"h": 3600.0, "d": 86400.0, "w": 604800.0}


@click.command(
    "cache",
    epilog=examples(
        "bubblefit cache",
        "bubblefit cache --older 8w --prune 2GB",
        "bubblefit cache --clear",
    ),
)
@click.option("--folder", type=PATH, help="Of the runs, where a project names one of its own.")
@click.option("--clear", is_flag=True, help="Drop all runs.")
@click.option(
    "--prune", "size", metavar="SIZE", help="Drop what was used longest ago until SIZE is left."
)
@click.option("--older", metavar="AGE", help="Drop what was not used for so long: 12h, 30d, 8w.")
@click.option("--limit", metavar="SIZE", help="From now on drop runs beyond SIZE: 500MB, 5GB.")
@AS_JSON
@exits
def command(
    folder: Path | None,
    clear: bool,
    size: str | None,
    older: str | None,
    limit: str | None,
    as_json: bool,
) -> None:
    """Runs of CalculiX, Marc and solvers of plug-ins that ended well, kept for all projects.

    The same run (law, model, solver, settings, program and templates by their content) is not made
    again. The folder is bubblefit's own cache folder, [fit] cache of a project, or BUBBLEFIT_RUNS,
    which also turns it off: BUBBLEFIT_RUNS=off.
    """
    from ..solvers.run_cache import OFF, VARIABLE, RunCache, run_cache

    cache = run_cache() if folder is None else RunCache(folder)
    if cache is None:
        raise InputError(None, VARIABLE, f"is {OFF!r}: no runs are kept, name a folder instead")
    gone = []
    if limit is not None:
        before = cache.entries()
        cache.set_limit(_bytes("--limit", limit))
        left = {entry.path for entry in cache.entries()}
        gone += [entry for entry in before if entry.path not in left]
    if clear or size is not None or older is not None:
        least = 0 if clear else None if size is None else _bytes("--prune", size)
        gone += cache.prune(least, None if older is None else _seconds(older))
    entries = cache.entries()
    told: dict[str, Any] = {
        "folder": str(cache.folder),
        "runs": len(entries),
        "bytes": sum(entry.size for entry in entries),
        "limit": cache.limit,
        "dropped": len(gone),
        "dropped_bytes": sum(entry.size for entry in gone),
        "used_first": entries[0].used if entries else None,
        "used_last": entries[-1].used if entries else None,
    }
    tell(told, _lines(told), as_json)


def _lines(told: dict[str, Any]) -> list[str]:
    runs, size, limit = told["runs"], _words(told["bytes"]), _words(told["limit"])
    lines = [f"{told['folder']}: {runs} runs, {size} of at most {limit}"]
    if runs:
        first, last = (_ago(told[name]) for name in ("used_first", "used_last"))
        lines.append(f"last used between {first} and {last} ago")
    if told["dropped"]:
        lines.append(f"dropped: {told['dropped']} runs, {_words(told['dropped_bytes'])}")
    return lines


def _words(size: int) -> str:
    unit = next((u for u in ("GB", "MB", "kB") if size >= BYTES[u.upper()]), "B")
    return f"{size / BYTES[unit.upper()]:.3g} {unit}"


def _ago(used: float) -> str:
    seconds = max(0.0, time.time() - used)
    for unit, words in (("w", "weeks"), ("d", "days"), ("h", "hours")):
        if seconds >= 2 * SECONDS[unit]:
            return f"{seconds / SECONDS[unit]:.0f} {words}"
    return f"{seconds / 60:.0f} minutes"


def _bytes(option: str, text: str) -> int:
    found = re.fullmatch(r"(\d+(?:\.\d+)?) ?([kKMGT]?B?)", text.strip())
    unit = "" if found is None else found[2].upper()
    if found is None or (unit and unit != "B" and not unit.endswith("B")):
        raise InputError(None, option, f"expected a size such as 500MB or 2GB, got {text!r}")
    return int(float(found[1]) * BYTES[unit])


def _seconds(text: str) -> float:
    found = re.fullmatch(r"(\d+(?:\.\d+)?) ?([hdw])", text.strip())
    if found is None:
        raise InputError(None, "--older", f"expected an age such as 12h, 30d or 8w, got {text!r}")
    return float(found[1]) * SECONDS[found[2]]
