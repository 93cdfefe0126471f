"""Builders of the tests of readers: exports, frames, MAT-files."""

import struct
from pathlib import Path

import numpy as np
from bubblefit.readers.curves import LoadCurve, read_load_curves
from bubblefit.readers.frames import FrameOptions, FrameRows, frame_of

EIGHT_POINTS = np.array([[1.0, 2, 0.5], [4, -5, 0.25], [7, 8, -1], [0, 3, 0], [2, 2, 1], [3, 1, 1]])
TWO_FRAMES = [(EIGHT_POINTS, 0.01 * EIGHT_POINTS[:, [1, 0, 2]] + 0.02)]


def mat_file(body: bytes, kind: int = 14) -> bytes:
    head = b"MATLAB 5.0 MAT-file".ljust(124) + b"\x00\x01IM"
    return head + struct.pack("<II", kind, len(body)) + body


def mat_part(kind: int, body: bytes) -> bytes:
    return struct.pack("<II", kind, len(body)) + body + b"\0" * (-len(body) % 8)


def mat_variable(kind: int, shape: list[int], rest: bytes) -> bytes:
    flags, name = mat_part(6, struct.pack("<II", kind, 0)), mat_part(1, b"X")
    return flags + mat_part(5, struct.pack(f"<{len(shape)}i", *shape)) + name + rest


def mat_doubles(*numbers: float) -> bytes:
    return mat_part(9, struct.pack(f"<{len(numbers)}d", *numbers))


def mat_fields(length: int, names: bytes) -> bytes:
    return mat_part(5, struct.pack("<i", length)) + mat_part(1, names)


def written_file(folder: Path, text: str) -> Path:
    path = folder / "made-up.csv"
    path.write_text(text)
    return path


def read_export(path: Path, text: str, encoding: str = "utf-8", **options) -> tuple[LoadCurve, ...]:
    path.write_bytes(text.encode(encoding))
    return read_load_curves(path, **{"direction": "warp", **options})


#: ZwickRoell testXpert: properties with value and unit, tabs, quoted names and units.
TESTXPERT = """\
"Probenkennung 2"\t"Kette_3"
"Messlänge Standardweg"\t80\t"mm"
"Prüfgeschwindigkeit"\t300\t"mm/min"
"Vorkraft"\t2\t"N"
"Prüfzeit"\t"Standardkraft"\t"Standardweg"\t"Dehnung"
"s"\t"N"\t"mm"\t"%"
0,0\t-0,02\t-0,01\t0
0,1\t100,5\t0,25\t0,3
"""
FRAME_PATH, PLAIN_OPTIONS = Path("a.csv"), FrameOptions()
#: Of three rows; the last one is zero throughout.
FRAME_VALUES = {
    "x": np.array([1.0, 2.0, 0.0]), "y": np.array([3.0, 4.0, 0.0]), "z": np.array([5.0, 6.0, 0.0]),
    "dx": np.array([0.1, 0.2, 0.0]), "dy": np.array([0.3, 0.4, 0.0]),
    "dz": np.array([0.5, 0.6, 0.0]),
}  # fmt: skip
FRAME_NAMES = {name: name.upper() for name in FRAME_VALUES}


def frame_of_values(values=FRAME_VALUES, units=None, options=PLAIN_OPTIONS, **rows):
    names = {name: name.upper() for name in values}
    return frame_of(FrameRows(values, names, units or {}, **rows), options, FRAME_PATH, "f")
