"""The measured files of a test as it read them: what the record of a run says of its data."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Protocol, runtime_checkable

from ..data.frames import FrameSource


@dataclass(frozen=True, eq=False)
class DataFile:
    """A measured file and what became of its rows.

    Parameters
    ----------
    source : its format, columns and units, and what was chosen where it leaves a choice.
    used : how many of its rows count, None where that means nothing. dropped : how many do not, by
        why.
    """

    path: Path
    source: FrameSource
    used: int | None
    dropped: Mapping[str, int] = field(default_factory=dict)


@runtime_checkable
class OfFiles(Protocol):
    """What a prepared test, or one that is predicted, offers beside its protocol for the record."""

    def data_files(self) -> Sequence[DataFile]:
        """Its measured files in the order in which they count; none where data are computed."""


def files_of(test: object) -> tuple[DataFile, ...]:
    """The measured files of a test; none of one whose kind does not offer them."""
    return tuple(test.data_files()) if isinstance(test, OfFiles) else ()


def joined(parts: Iterable[DataFile]) -> list[DataFile]:
    """One a file, in the order of their first part: rows of several parts are added up."""
    by_path: dict[Path, list[DataFile]] = {}
    for part in parts:
        by_path.setdefault(part.path, []).append(part)
    return [
        DataFile(path, same[0].source, _used(same), _added(p.dropped for p in same))
        for path, same in by_path.items()
    ]


def _used(parts: Sequence[DataFile]) -> int | None:
    counts = [part.used for part in parts if part.used is not None]
    return sum(counts) if counts else None


def _added(each: Iterable[Mapping[str, int]]) -> dict[str, int]:
    total: dict[str, int] = {}
    for counts in each:
        for why, count in counts.items():
            total[why] = total.get(why, 0) + count
    return {why: count for why, count in total.items() if count}
