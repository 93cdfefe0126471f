"""Does this ccx carry the law? Four bars whose end stresses another program has published."""

from __future__ import annotations

import os
import re
import subprocess
import tempfile
from dataclasses import dataclass
from pathlib import Path

import jinja2
import numpy as np

from ...errors import OutputError, SolverFailure
from ...materials.law import HypoelasticLaw
from .library import MATERIAL, STATE_VARIABLES, constants, material_library

TEMPLATES = Path(__file__).parent.parent.parent / "templates" / "calculix"
#: Relative. The integral of the published coefficients (5 digits) is within 6e-5 of every stress.
TOLERANCE = 1e-4
INCREMENTS = 100
SECONDS = 120.0
#: Corners of a bar, in the order of C3D8.
NODES = [(x, y, z) for z in (0, 1) for x, y in ((0, 0), (1, 0), (1, 1), (0, 1))]


@dataclass(frozen=True)
class Bar:
    """A uniaxial test of Valmex 7318 computed with MSC Marc.

    modulus: E of log strain, constant term first, GPa; elongation: engineering strain at the
    end; stress: Marc's end stress, MPa. Source: the published models of the uniaxial tests
    (Composite Structures, 2017).
    """

    model: str
    direction: str
    modulus: tuple[float, float, float, float]
    elongation: float
    stress: float


BARS = (
    Bar("direct", "warp", (0.80335, -20.444, 217.66, -589.2), 0.16516831, 62.677),
    Bar("direct", "fill", (0.07528, 1.07347, -0.82337, 0.0), 0.26079895, 42.855),
    Bar("inverse", "warp", (0.80877, -20.725, 225.88, -575.28), 0.16516831, 71.912),
    Bar("inverse", "fill", (0.07624, 1.14164, 0.75244, 0.0), 0.26079895, 51.448),
)


def bar_law(model: str) -> HypoelasticLaw:
    """The law of a published model; the shear modulus (20 MPa) plays no part in a bar."""
    of = {bar.direction: bar.modulus for bar in BARS if bar.model == model}
    gigapascal = (0.0, 0.0, 0.0, 0.02, *of["fill"][::-1], *of["warp"][::-1])
    return HypoelasticLaw(1e3 * np.array(gigapascal))


def bar_deck() -> str:
    """The deck: every bar pulled along x, the fabric turned so that its direction lies there."""
    environment = jinja2.Environment(
        loader=jinja2.FileSystemLoader(TEMPLATES), undefined=jinja2.StrictUndefined
    )
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
    return environment.get_template("bars.inp.j2").render(
        bars=bars,
        nodes=NODES,
        increments=INCREMENTS,
        material=MATERIAL,
        states=STATE_VARIABLES,
    )


def prove(ccx: Path, library: Path | None = None, timeout: float = SECONDS) -> tuple[float, ...]:
    """End stresses (MPa) of BARS by this ccx, each within TOLERANCE of Marc's.

    Raises
    ------
    SolverFailure : no compiler, ccx does not end well, or a stress is wrong.
    OutputError : no temporary folder.
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
    (folder / "bars.inp").write_text(bar_deck(), encoding="utf-8")
    paths = [str(library.parent), os.environ.get("LD_LIBRARY_PATH", "")]
    search = os.pathsep.join(path for path in paths if path)
    variables = {**os.environ, "LD_LIBRARY_PATH": search, "OMP_NUM_THREADS": "1"}
    try:
        done = subprocess.run(
            [ccx, "bars"],
            cwd=folder,
            env=variables,
            stdin=subprocess.DEVNULL,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            timeout=timeout,
        )
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
    """sxx (MPa) of the bars from a .dat file at the end of the step; empty when it is not there."""
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
