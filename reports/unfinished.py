"""The page of a folder that has no result yet: what its records say so far."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

from ..errors import InputError
from ..runs.folder import DIGITS, PROVENANCE, RESULT, RUN, RUNS, Store
from ..runs.starts import HISTORY, STARTS, RunningFiles
from .content import PAGE_DATA, Facts, Part, Report, Section, Table, Words, read_page_data

UNFINISHED = (
    "Unfinished: there is no result yet, only what was recorded so far; --resume goes on with it."
)


def page_of_folder(folder: Path) -> Report:
    """The page of an output folder: of its page.json, else of what its records say so far.

    Raises
    ------
    InputError : nothing of bubblefit is in the folder, or what is there is damaged or of a version
        that wrote no page.json.
    """
    if (folder / PAGE_DATA).exists():
        return read_page_data(folder)
    if (folder / RESULT).exists():
        problem = f"has a result but no {PAGE_DATA}: an older version wrote it; run it again"
        raise InputError(folder, "", problem)
    within = _folders_within(folder)
    if not (folder / RUN).exists() and not within:
        raise InputError(folder, "", f"is no output folder: neither {PAGE_DATA} nor {RUN} is there")
    return Report(
        title=_title(folder),
        summary=UNFINISHED,
        sections=[
            Section("So far", [*_starts(folder), *_runs(folder), *within]),
            Section("The record", _record(folder)),
        ],
    )


def _title(folder: Path) -> str:
    project = _provenance(folder).get("project", {})
    named = project.get("file") if isinstance(project, dict) else None
    return f"{Path(str(named)).name if named else folder.resolve().name}: unfinished"


def _starts(folder: Path) -> list[Part]:
    """How many starts ended, and how; nothing of a folder that holds no fit."""
    if not (folder / STARTS).exists():
        return []
    records = RunningFiles(Store(folder), (), ()).finished()
    rows: list[list[object]] = [
        [r.number, r.mesh, r.objective, r.analyses, r.status] for r in records
    ]
    history = folder / HISTORY
    lines = history.read_text(encoding="utf-8", errors="replace").count("\n")
    facts: list[tuple[str, object]] = [
        ("starts that ended", len({r.number for r in records})),
        ("analyses", max(lines - 1, 0)),
    ]
    header = ["start", "mesh", "objective", "analyses", "how it ended"]
    return [Facts(facts), *([Table("Starts", header, rows, text=(1, 4))] if rows else [])]


def _runs(folder: Path) -> list[Part]:
    """How many predictions are kept."""
    kept = [path for path in (folder / RUNS).glob("*.npz") if not path.name.startswith(".")]
    return [Facts([("runs that ended", len(kept))])] if kept else []


def _folders_within(folder: Path) -> list[Part]:
    """The fits of a study, a folder each, and how far they are."""
    rows: list[list[object]] = []
    for path in sorted(folder.glob("*/")):
        if (path / RESULT).exists():
            rows.append([path.name, "finished"])
        elif (path / RUN).exists():
            rows.append([path.name, "unfinished"])
    return [Table("Fits within", ["folder", "how far"], rows, text=(1,))] if rows else []


def _provenance(folder: Path) -> dict[str, Any]:
    """What the results are to come from; empty where that is not told or damaged."""
    try:
        content = json.loads((folder / PROVENANCE).read_text(encoding="utf-8"))
    except (OSError, ValueError):
        return {}
    return content if isinstance(content, dict) else {}


def _record(folder: Path) -> list[Part]:
    content = _provenance(folder)
    if not content:
        return [Words(["Nothing is recorded of what this is of."])]
    rows: list[list[object]] = [["project file", str(content.get("project", {}).get("file", ""))]]
    for run in content.get("runs", []):
        rows.append(["command", " ".join(map(str, run.get("command_line") or ["Python"]))])
        rows.append(["begun", str(run.get("date", ""))])
    rows += [
        [f"data: {row.get('name')}", f"sha256 {str(row.get('sha256', ''))[:DIGITS]} …"]
        for row in content.get("data", [])
    ]
    return [Table("What it is of", ["", ""], rows, text=(1,))]
