"""What fits without single parts foretell: computed, or as an interrupted run has written it."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

from ..fits.setup import FitSetup, fingerprints
from ..notes import Note, NoteKind
from .held_out import HeldOut
from .left_out import Part, foretold, name_of
from .marked import mark_of, read_marked, write_marked


def recorded(
    setup: FitSetup,
    parts: Sequence[Part],
    starts: int,
    folder: Path | None,
    file: str,
    tell: Callable[[str | None], None],
) -> list[HeldOut]:
    """How the fit without each part does there, as it was written where it was fitted before.

    folder, file : where each part is written as it ends, None where nothing is. tell : hears of
    each part that ended, and time pass.
    """
    mark = _mark(setup, parts, starts)
    ended = {} if folder is None else _written(folder / file, mark)
    known = {k: ended[name_of(setup, part)] for k, part in enumerate(parts)
             if name_of(setup, part) in ended}  # fmt: skip
    missing = [k for k in range(len(parts)) if k not in known]
    for event in foretold(setup, parts, missing, starts) if missing else ():
        if event is not None:
            number, judged = event
            known[number] = judged
            if folder is not None:
                _write(folder, file, mark, [known[k] for k in sorted(known)])
        tell(None if event is None else f"without {name_of(setup, parts[event[0]])}")
    return [known[k] for k in range(len(parts))]


def _mark(setup: FitSetup, parts: Sequence[Part], starts: int) -> str:
    """Of everything that the errors depend on."""
    names = [name_of(setup, part) for part in parts]
    content = {**fingerprints(setup, setup.problem()), "parts": names, "starts": starts}
    return mark_of(content)


def _write(folder: Path, file: str, mark: str, judged: Sequence[HeldOut]) -> None:
    folder.mkdir(parents=True, exist_ok=True)
    write_marked(folder, file, mark, {"parts": [_plain(one) for one in judged]})


def _written(path: Path, mark: str) -> dict[str, HeldOut]:
    """By name of the part; nothing where it is of something else, or no record at all."""
    judged = read_marked(path, mark, lambda told: [_judged(row) for row in told["parts"]])
    return {one.test: one for one in judged or ()}


def _plain(one: HeldOut) -> dict[str, Any]:
    notes = [{"kind": note.kind, "words": str(note), "of": note.of} for note in one.notes]
    return {"part": one.test, "error": one.error, "rms": dict(one.rms), "units": dict(one.units),
            "notes": notes}  # fmt: skip


def _judged(row: Mapping[str, Any]) -> HeldOut:
    notes = tuple(Note(NoteKind(n["kind"]), n["words"], n["of"]) for n in row["notes"])
    return HeldOut(row["part"], row["error"], row["rms"], row["units"], notes)
