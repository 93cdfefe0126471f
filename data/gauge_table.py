"""What a virtual strain gauge showed, as a table and as numbers."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from ..notes import Note, NoteKind, as_note, rows
from ..writing import replacing
from .curves import LoadCurve
from .gauge import GaugeRecord

if TYPE_CHECKING:
    import pandas as pd


@dataclass(frozen=True, eq=False)
class GaugeTable:
    """A gauge through the frames of a test, with the machine's loads where there are any.

    Parameters
    ----------
    files : names of the frames, one each.
    lower, upper : (x, y) mm of the ends in the reference state.
    record : of the gauge.
    curve : its loads; frames where correlation was lost, or without a load, are not in it.
    note : what looks unmeant in the order of the frames.
    """

    files: Sequence[str]
    lower: tuple[float, float]
    upper: tuple[float, float]
    record: GaugeRecord
    curve: LoadCurve | None = None
    note: str | None = None

    @property
    def notes(self) -> list[Note]:
        """Lost ends of the gauge, the order of the frames, frames that have no load."""
        notes = [*self.record.warnings, *([as_note(self.note)] if self.note else [])]
        if without := self.without_load:
            words = f"{len(without)} of {len(self.files)} frames have a length and no load; they "
            words += f"are left out: {', '.join(without)}"
            notes.append(Note(NoteKind.NO_LOAD, words))
        return notes

    @property
    def without_load(self) -> list[str]:
        """Files of the frames that the load curve leaves out, though the gauge has a length."""
        if self.curve is None:
            return []
        seen = np.flatnonzero(np.isfinite(self.record.length))
        return [self.files[i] for i in sorted({*seen.tolist()} - {*self._used().tolist()})]

    def frame(self) -> pd.DataFrame:
        """A row a frame, NaN where the gauge was lost; with loads only the frames of the curve."""
        import pandas as pd

        record, curve = self.record, self.curve
        rows = np.arange(len(self.files)) if curve is None else self._used()
        table = pd.DataFrame(
            {
                "frame": rows,
                "file": [self.files[i] for i in rows],
                "length_mm": record.length[rows],
                "elongation_mm": record.elongation[rows],
                "strain": record.strain[rows],
                "log_strain": record.log_strain[rows],
            }
        )
        if curve is not None:
            table["load_N"] = curve.load
            table["specimen"], table["direction"] = curve.specimen, curve.direction
        return table

    def write(self, path: Path | str) -> None:
        """Write the table with its notes; with loads, strips of a project read it as a curve.

        Raises
        ------
        OutputError : it cannot be written; what was there is still there.
        """
        ends = [f"({x:g}, {y:g})" for x, y in (self.lower, self.upper)]
        about = (
            f"# virtual strain gauge between {ends[0]} and {ends[1]} mm,"
            f" {self.record.reference_length:.6g} mm long in the reference state\n"
        )
        # A line each, whatever the names of the files hold.
        about += "".join(f"# note: {' '.join(note.split())}\n" for note in self.notes)
        with replacing(path) as temporary, open(temporary, "w", encoding="utf-8") as stream:
            stream.write(about)
            self.frame().to_csv(stream, index=False, lineterminator="\n")

    def numbers(self) -> dict[str, Any]:
        """The outcome as plain data; frames by the names of their files."""
        record, curve = self.record, self.curve
        seen = np.flatnonzero(np.isfinite(record.length))
        last = seen[np.argmax(record.length[seen])]
        numbers: dict[str, Any] = {
            "gauge_length_mm": record.reference_length,
            "longest": {
                "file": self.files[last],
                "length_mm": float(record.length[last]),
                "elongation_mm": float(record.elongation[last]),
                "strain": float(record.strain[last]),
                "log_strain": float(record.log_strain[last]),
            },
            "frames": len(self.files),
            "lost": [self.files[i] for i in record.lost],
            "warnings": [note.line for note in self.notes],
            "notes": rows(self.notes),
        }
        if curve is not None:
            numbers |= {
                "direction": curve.direction,
                "specimen": curve.specimen,
                "points": len(curve.load),
                "largest_load_N": float(curve.load.max()),
                "without_load": self.without_load,
            }
        return numbers

    def _used(self) -> NDArray[np.intp]:
        """The frames (points,) of the curve."""
        if self.curve is None or self.curve.frame is None:
            return np.flatnonzero(np.isfinite(self.record.length))
        return self.curve.frame
