"""Result files of CalculiX, as it writes them."""

import struct
from pathlib import Path

import numpy as np

POINTS = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [2, 0, 0], [2, 1, 0]], float)
QUADS = [(1, 2, 3, 4), (2, 5, 6, 3)]


def frd_frames(count):
    random = np.random.default_rng(3)
    return [
        (float(i + 1), random.normal(size=(6, 3)), random.normal(size=(6, 8))) for i in range(count)
    ]


def write_frd(path, given, flag, end=True, skip=()):
    out = bytearray(b"    1C\n    1UUSER\n")

    def rows(values):
        for n, row in enumerate(values, 1):
            if flag == 1:
                for first in range(0, len(row), 6):
                    head = f" -1{n:10d}" if first == 0 else " -2" + 10 * " "
                    out.extend(
                        (head + "".join(f"{v:12.5E}" for v in row[first : first + 6])).encode()
                    )
                    out.extend(b"\n")
            else:
                out.extend(struct.pack(f"<i{len(row)}{'f' if flag == 2 else 'd'}", n, *row))
        if flag == 1:
            out.extend(b" -3\n")

    binary = flag > 1
    place = 3 if binary else 1
    out.extend(f"    2C{'':18}{6:12d}{place:38d}\n".encode())
    flag, results = place, flag
    rows(POINTS)
    out.extend(f"    3C{'':18}{2:12d}{place:38d}\n".encode())
    for n, quad in enumerate(QUADS, 1):
        if binary:
            out.extend(struct.pack("<8i", n, 9, 0, 1, *quad))
        else:
            out.extend(f" -1{n:10d}{9:5d}{0:5d}{1:5d}\n -2".encode())
            out.extend("".join(f"{i:10d}" for i in quad).encode() + b"\n")
    if not binary:
        out.extend(b" -3\n")
    flag = results
    for step, (time, *fields) in enumerate(given, 1):
        if step in skip:
            continue
        for name, values in zip(("DISP", "SDV"), fields, strict=True):
            out.extend(f"    1PSTEP{'':14}{step:12d}{7:12d}{step:12d}\n".encode())
            head = f"  100CL{step + 100:5d}{time:12.9f}{len(values):12d}{'':20}{0:2d}{step:5d}"
            out.extend(f"{head:73}{flag:2d}\n".encode())
            extra = name == "DISP"
            out.extend(f" -4  {name:8}{values.shape[1] + extra:5d}{1:5d}\n".encode())
            for k in range(values.shape[1]):
                out.extend(f" -5  D{k + 1:<7}{1:5d}{2:5d}{k + 1:5d}{0:5d}\n".encode())
            if extra:
                out.extend(f" -5  ALL     {1:5d}{2:5d}{0:5d}{0:5d}{1:5d}ALL\n".encode())
            rows(values)
    if end:
        out.extend(b" 9999\n")
    Path(path).write_bytes(out)
    return path
