"""Try every ccx of this machine on the bars."""

from __future__ import annotations

import os
import re
import subprocess
import tempfile
from pathlib import Path

from ...errors import BubblefitError, OutputError, SolverFailure
from ...files import render
from ..bars import BARS, INCREMENTS, TOLERANCE, bar_law, difference
from ..base import Diagnosis
from .executable import ADVICE, FOUND, NAMED, Executable, every_ccx
from .library import MATERIAL, STATE_VARIABLES, constants, law_files, material_library

SECONDS = 120.0
#: Corners of a bar, in the order of C3D8.
NODES = [(x, y, z) for z in (0, 1) for x, y in ((0, 0), (1, 0), (1, 1), (0, 1))]


def bar_deck() -> str:
    """Return the deck: every bar pulled along x, the fabric turned so that its direction lies
    there."""
    bars = [
        {
            "index": index,
            "elongation": bar.elongation,
            "constants": constants(
                bar_law(bar.model), angle=0.0 if bar.direction == "warp" else -90.0
            ),
        }
        for index, bar in enumerate(BARS)
    ]
    return render(
        "calculix/bars.inp.j2",
        bars=bars,
        nodes=NODES,
        increments=INCREMENTS,
        material=MATERIAL,
        states=STATE_VARIABLES,
    )


def prove(ccx: Path, library: Path | None = None, timeout: float = SECONDS) -> tuple[float, ...]:
    """Return the end stresses (MPa) of BARS by this ccx, each within TOLERANCE of Marc's.

    SolverFailure: no compiler, ccx does not end well, or a stress is wrong. OutputError: no
    temporary folder.
    """
    library = material_library() if library is None else library
    try:
        with tempfile.TemporaryDirectory(prefix="bubblefit-bars-") as folder:
            stresses = _run(ccx, library, Path(folder), timeout)
    except OSError as error:
        problem = f"cannot be used: {error.strerror}; choose another TMPDIR"
        raise OutputError(f"{tempfile.gettempdir()}: {problem}") from None
    for bar, stress in zip(BARS, stresses, strict=True):
        if not abs(stress / bar.stress - 1) < TOLERANCE:
            problem = f"{bar.model} {bar.direction} bar: {stress:.4g} MPa, not {bar.stress}"
            raise SolverFailure(f"{ccx} does not carry the law ({problem})", "calculix")
    return stresses


def _run(ccx: Path, library: Path, folder: Path, timeout: float) -> tuple[float, ...]:
    files = {"bars.inp": bar_deck()}
    for bar in BARS:
        files |= law_files(bar_law(bar.model))
    for name, text in files.items():
        (folder / name).write_text(text, encoding="utf-8")
    paths = [str(library.parent), os.environ.get("LD_LIBRARY_PATH", "")]
    search = os.pathsep.join(path for path in paths if path)
    variables = {**os.environ, "LD_LIBRARY_PATH": search, "OMP_NUM_THREADS": "1"}
    try:
        done = subprocess.run(
            [ccx, "bars"], cwd=folder, env=variables, timeout=timeout, stdin=subprocess.DEVNULL,
            stdout=subprocess.PIPE, stderr=subprocess.STDOUT,
        )  # fmt: skip
    except subprocess.TimeoutExpired:
        raise SolverFailure(f"{ccx}: four bars took more than {timeout:g} s", "calculix") from None
    except OSError as error:
        raise SolverFailure(f"{ccx} cannot be started: {error.strerror}", "calculix") from None
    tail = "\n".join(done.stdout.decode(errors="replace").splitlines()[-25:])
    printed = folder / "bars.dat"
    if done.returncode != 0 or not printed.is_file():
        problem = f"{ccx} did not end well on four bars"
        raise SolverFailure(problem, "calculix", done.returncode, tail)
    stresses = _end_stresses(printed.read_text(encoding="utf-8", errors="replace"))
    if len(stresses) != len(BARS):
        raise SolverFailure(f"{ccx} printed no end stresses", "calculix", done.returncode, tail)
    return stresses


def _end_stresses(text: str) -> tuple[float, ...]:
    """Return sxx (MPa) of the bars from a .dat file at the end of the step; empty without it."""
    found: dict[int, float] = {}
    for block in re.split(r"(?m)^\s*stresses ", text)[1:]:
        head, *rows = block.splitlines()
        time = re.search(r"time\s+(\S+)", head)
        if time is None or abs(float(time[1]) - 1) > 1e-6:
            continue
        for row in rows:
            numbers = row.split()
            # element, point, six components
            if len(numbers) == 8:
                found[int(numbers[0])] = float(numbers[2])
    return tuple(found[element] for element in sorted(found))


def diagnose(named: Path | str | None = None) -> list[Diagnosis]:
    """Return all there are (`named`: one more, by path).

    One that is not there at all is an entry without a path, expected only if it was named.
    """
    try:
        candidates = every_ccx(named)
    except BubblefitError as error:
        return [_absent(str(error), NAMED, True)]
    if not candidates:
        return [_absent(f"there is no ccx; {ADVICE}", "not found", False)]
    return [_tried(candidate) for candidate in candidates]


def _absent(advice: str, origin: str, expected: bool) -> Diagnosis:
    return Diagnosis("calculix", "", None, origin, expected, None, False, advice=advice)


def _tried(ccx: Executable) -> Diagnosis:
    expected = ccx.origin != FOUND
    usable, stresses, off, advice = False, None, None, ""
    if ccx.external is False:
        advice = f"cannot load material libraries; {ADVICE}"
    else:
        try:
            stresses = prove(ccx.path)
            usable, off = True, difference(stresses)
        except BubblefitError as error:
            advice = str(error).splitlines()[0]
    carries = {True: "yes", False: "no", None: "cannot be seen"}[ccx.external]
    return Diagnosis("calculix", ccx.version, ccx.path, ccx.origin, expected, ccx.external,
                     usable, stresses, off, advice, f"external materials: {carries}")  # fmt: skip
