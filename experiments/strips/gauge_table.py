"""Write the table of a virtual strain gauge, which a strip test can read as a load curve."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...lazy_modules import pandas as pd
from ...notes import Note, NoteKind, as_note, note_records
from ...readers.curves import LoadCurve
from ...solvers.base import Array
from ...storage.writing import replacing
from .gauge import GaugeRecord

#: The kind of note on frames that the load curve leaves out.
NO_LOAD = NoteKind("frames without load")


def _columns(record: GaugeRecord) -> dict[str, Array]:
    """Return the values (frames,) of a record by the names of their columns in a table."""
    return {
        "length_mm": record.length,
        "elongation_mm": record.elongation,
        "strain": record.strain,
        "log_strain": record.log_strain,
    }


@dataclass(frozen=True, eq=False)
class GaugeTable:
    """A gauge through the frames of a test, with the machine's loads where there are any.

    Attributes
    ----------
    files : sequence of str
        Names of the frames' files.
    lower, upper : (float, float), mm
        x and y of the ends in the reference state.
    record : GaugeRecord
        Length and strain of the gauge in each frame.
    curve : LoadCurve or None
        Load over elongation, of the frames that have both.
    note : str or None
        Remark on the order of the frames.
    """

    files: Sequence[str]
    lower: tuple[float, float]
    upper: tuple[float, float]
    record: GaugeRecord
    curve: LoadCurve | None = None
    note: str | None = None

    @property
    def notes(self) -> list[Note]:
        """Return warnings: lost ends of the gauge, order of the frames, frames without load."""
        notes = list(self.record.warnings)
        if self.note:
            notes.append(as_note(self.note))
        without_load = self.without_load
        if without_load:
            count = f"{len(without_load)} of {len(self.files)} frames"
            words = f"{count} have a length and no load; they are left out: "
            notes.append(Note(NO_LOAD, words + ", ".join(without_load)))
        return notes

    @property
    def without_load(self) -> list[str]:
        """Return the files of frames with a length that the load curve leaves out."""
        if self.curve is None:
            return []
        frames = {*self._measured_frames().tolist()} - {*self._used_frames().tolist()}
        return [self.files[frame] for frame in sorted(frames)]

    def frame(self) -> pd.DataFrame:
        """Return a DataFrame, one row for each frame; with loads, for each frame of the curve."""
        curve = self.curve
        frames = np.arange(len(self.files)) if curve is None else self._used_frames()
        table = pd.DataFrame({"frame": frames, "file": [self.files[frame] for frame in frames]})
        for name, values in _columns(self.record).items():
            table[name] = values[frames]
        if curve is not None:
            table["load_N"] = curve.load
            table["specimen"] = curve.specimen
            table["direction"] = curve.direction
        return table

    def write(self, path: Path | str) -> None:
        """Write the table as CSV after its notes; with loads, a strip test can read it."""
        ends = [f"({x:g}, {y:g})" for x, y in (self.lower, self.upper)]
        title = (
            f"virtual strain gauge between {ends[0]} and {ends[1]} mm,"
            f" {self.record.reference_length:.6g} mm long in the reference state"
        )
        # Each note stays on one line, even if a file name has a line break.
        lines = [title, *(f"note: {' '.join(note.split())}" for note in self.notes)]
        with replacing(path) as temporary, open(temporary, "w", encoding="utf-8") as stream:
            stream.writelines(f"# {line}\n" for line in lines)
            self.frame().to_csv(stream, index=False, lineterminator="\n")

    def numbers(self) -> dict[str, Any]:
        """Return the results as plain data for JSON; frames are named by their files."""
        record = self.record
        curve = self.curve
        measured = self._measured_frames()
        longest = measured[np.argmax(record.length[measured])]
        columns = {name: float(values[longest]) for name, values in _columns(record).items()}
        numbers: dict[str, Any] = {
            "gauge_length_mm": record.reference_length,
            "longest": {"file": self.files[longest], **columns},
            "frames": len(self.files),
            "lost": [self.files[frame] for frame in record.lost_frames],
            "warnings": [note.line for note in self.notes],
            "notes": note_records(self.notes),
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

    def _measured_frames(self) -> NDArray[np.intp]:
        """Return the indices of the frames in which the gauge has a length."""
        return np.flatnonzero(np.isfinite(self.record.length))

    def _used_frames(self) -> NDArray[np.intp]:
        """Return the indices of the frames of the curve, else of all frames with a length."""
        if self.curve is None or self.curve.frame is None:
            return self._measured_frames()
        return self.curve.frame
