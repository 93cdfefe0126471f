"""Files as Marc leaves them, for tests and for its stand-in: .t19 and .sts."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path

import numpy as np

Vectors = Mapping[str, np.ndarray]


def e13(value: float) -> str:
    """Fortran's E13.6: 0.123456E+01, and without the E when the exponent has three digits."""
    if not np.isfinite(value):
        return "NaN".rjust(13)
    if value == 0:
        return " 0.000000E+00"
    mantissa, exponent = f"{abs(value):.5E}".split("E")
    power = int(exponent) + 1
    sign, digits = "-" if value < 0 else " ", mantissa.replace(".", "")
    return f"{sign}0.{digits}E{power:+03d}" if abs(power) < 100 else f"{sign}0.{digits}{power:+04d}"


def records(values: Iterable, kind=e13) -> list[str]:
    fields = [kind(value) for value in values]
    return ["".join(fields[i : i + 6]) for i in range(0, len(fields), 6)]


def integers(*values: int) -> list[str]:
    return records(values, lambda value: f"{value:13d}")


def block(number: int, name: str, lines: Sequence[str]) -> list[str]:
    return [f"=beg={number} ({name})", *lines, "=end="]


def t19_head(points: np.ndarray, quads: np.ndarray, element: int = 139, title: str = "job") -> str:
    header = [0, len(points), len(quads), 6, 4, 9, 1, 0, 3, 4, 2, 0, 0, 14, *[0] * 16]
    lines = block(50100, "Analysis Title", [title])
    lines += block(50200, "Analysis Verification Data", integers(*header))
    lines += block(50600, "Element Variable Postcodes", [])
    rows = [r for n, q in enumerate(quads) for r in integers(n + 1, element, 4, *(q + 1))]
    lines += block(50700, "Element Connectivities", rows)
    rows = [f"{n + 1:13d}" + "".join(map(e13, p)) for n, p in enumerate(points)]
    lines += block(50800, "Nodal Coordinates", rows)
    lines += block(51301, "Set Definitions", integers(0))
    return "\n".join(lines) + "\n"


def t19_frame(number: int, time: float, vectors: Vectors) -> str:
    lines = ["****", *block(51600, "Loadcase Title", ["inflation"])]
    lines += block(51701, "Integer Increment Verification Data",
                   integers(0, number, 0, 1, 2, 0, 0, 1, 0, 0, 0, 0))  # fmt: skip
    lines += block(51801, "Real Increment Verification Data",
                   [*integers(24), *records([time, *[0.0] * 23])])  # fmt: skip
    rows = integers(len(vectors), 6)
    for name, values in vectors.items():
        rows.append(name.ljust(48))
        rows += integers(1, 0, 0, values.shape[1], 0, 0, -1, 0, 0, 0, 0, 0)
        rows += records(values.ravel())
    return "\n".join([*lines, *block(52401, "Nodal Results", rows), "----"]) + "\n"


def t19_text(points, quads, frames: Sequence[tuple[float, Vectors]], element=139, ended=True):
    """A post file: model, then (time, vectors by name) for each increment."""
    body = "".join(t19_frame(number, *frame) for number, frame in enumerate(frames))
    return t19_head(points, quads, element) + body + "++++\n" * ended


STS_HEAD = """1                       MARC  Version: Marc 2023.1

   date: Sat Nov 21 2026          time: 12:00:00
------------------------------------------------------------------------------------------
  load  |  inc  |cycl|sepa|cut |cycl|sepa|cut |remesh|time step|total time of the job  | disp
------------------------------------------------------------------------------------------
"""


def sts_line(case: int, number: int, total: int, step: float, time: float, *span: float) -> str:
    return (
        f"{case:6d}{number:8d}{3:6d}{0:5d}{0:5d}{total:7d}{0:5d}{0:5d}{0:5d}"
        f" {step:.5E} {time:.5E} {span[0]:.5E} {span[1]:.5E}\n"
    )


def sts_text(
    times: Sequence[float], number: int | None = 3004, increments: Sequence[int] | None = None
) -> str:
    text = STS_HEAD
    steps = np.diff(np.concatenate([[0.0], times]))
    for i, (time, step) in enumerate(zip(times, steps, strict=True)):
        inc = i + 1 if increments is None else increments[i]
        text += sts_line(1, inc, 3 * (i + 1), step, time, -1e-3, 2e-1)
    if number is not None:
        text += f"\n Job ends with exit number :    {number}\n total wall time:  3.11\n"
    return text


def bending_marc(folder: Path, model, frames, number=3004, increments=None) -> Path:
    """Write a run_marc that fills a cylinder well, and whose bending gives `frames` and ends so."""
    filled = frames[: len(model.inflation) + 1]
    for name, given, end in (("inflation", filled, 3004), ("bending", frames, number)):
        (folder / name).mkdir()
        text = t19_text(model.mesh.points, model.mesh.quads, given, ended=end == 3004)
        (folder / name / "job.t19").write_text(text)
        times = [time for time, _ in given[1:]]
        text = sts_text(times, end, increments if name == "bending" else None)
        (folder / name / "job.sts").write_text(text)
    path = folder / "run_marc"
    path.write_text(
        f"#!/bin/sh\nif grep -q '^contact' job.dat; then cp {folder}/bending/* .\n"
        f"else cp {folder}/inflation/* .; fi\n"
    )
    path.chmod(0o755)
    return path
