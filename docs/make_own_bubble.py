"""The pictures of docs/how-to/own-bubble-test.md: a test whose answer is known, seen by a camera.

python docs/make_own_bubble.py FOLDER    # writes the test there, fits it, draws into docs/pictures

A bubble is computed with the known solution of the example, seen from anywhere (turned by 12
degrees, tilted by 3, 600 mm away) with 0.02 mm of noise and some rejected points, and written as
VIC-3D exports it. Everything else is what a user does.
"""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path
from typing import Any

import bubblefit as bf
import numpy as np
from bubblefit.experiments.registry import kind_named
from bubblefit.runs.law_setup import law_of
from bubblefit.solvers.membrane.solver import MembraneSolver
from PIL import Image
from scipy.interpolate import CloughTocher2DInterpolator
from scipy.spatial.transform import Rotation

HERE = Path(__file__).resolve().parent
EXAMPLE = HERE.parent / "examples" / "bubble-known-solution" / "project.toml"
PICTURES = {"registration.png": "own-registration.png", "heights.png": "own-heights.png"}
TURN = Rotation.from_euler("zx", [12.0, 3.0], degrees=True).as_matrix()
SHIFT = np.array([3.0, -4.0, 600.0])
NOISE, REJECTED, SPACING = 0.02, 0.02, 7.0  # mm, of all points, mm
KPA = (22, 59, 97, 132, 186, 251, 300)
WIDTH = 900  # of a picture, pixels


def write_frames(folder: Path) -> None:
    """One CSV a pressure."""
    text = EXAMPLE.read_text().replace("elements = 800", "elements = 1800")
    (folder / "computed.toml").write_text(text.replace('"quarter"', '"full"'))
    project = bf.read_project(folder / "computed.toml")
    test = project.tests["bubble"]
    law = law_of(project, [test.reach])
    computed: Any = kind_named(test.kind).prepare(test, law, MembraneSolver)
    draw = np.random.default_rng(1)
    x, y = (a.ravel() for a in np.meshgrid(*[np.arange(-95, 96, SPACING)] * 2))
    places = np.column_stack([x, y])[np.hypot(x, y) < 97]
    for field in computed.fields:
        moved = CloughTocher2DInterpolator(field.points, field.displacement)(places)
        moved += draw.normal(0.0, NOISE, moved.shape)
        z = draw.normal(0.0, NOISE, len(places))
        flat = np.column_stack([places, z]) @ TURN.T + SHIFT
        sigma = np.where(draw.random(len(places)) < REJECTED, -1.0, 0.004)
        table = np.column_stack([flat, moved @ TURN.T, sigma])
        table[sigma < 0, :6] = 0.0
        kpa = round(1e3 * field.pressure)
        names = ",".join(f'"{q} [mm]"' for q in "XYZUVW") + ',"sigma [pixel]"'
        path = folder / "data" / f"step_{KPA.index(kpa):02d}_{kpa}kPa.csv"
        path.parent.mkdir(exist_ok=True)
        np.savetxt(path, table, "%.5f", ", ", header=names, comments="")


def write_project(folder: Path) -> Path:
    """What `bubblefit init --own` writes, with the four changes of the document."""
    run(folder, "init", ".", "--own", "--bubble", "1", "--thickness", "0.81", "--pressures",
        ",".join(map(str, KPA)))  # fmt: skip
    path = folder / "project.toml"
    text = path.read_text()
    pattern = 'pattern = "bubble1_{index:02d}.csv"\nindices = [0, 1, 2, 3, 4, 5, 6]'
    for old, new in (
        (pattern, 'files = ["*.csv"]'),
        ("# [bubble.data.points.pressure]", "[bubble.data.points.pressure]"),
        ("# from_name", "from_name"),
        ("# [bubble.data.points.registration]", "[bubble.data.points.registration]"),
        ("# [bubble.sheet]\n# surface", "[bubble.sheet]\nsurface"),
    ):
        assert text.count(old) == 1, old
        text = text.replace(old, new)
    path.write_text(text)
    return path


def run(folder: Path, *arguments: str) -> None:
    """The command, as a user types it."""
    print("bubblefit", *arguments)
    subprocess.run([sys.executable, "-m", "bubblefit", *arguments], cwd=folder, check=True)


def main() -> None:
    folder = Path(sys.argv[1])
    folder.mkdir(parents=True, exist_ok=True)
    write_frames(folder)
    write_project(folder)
    run(folder, "check", "project.toml", "--out", "check")
    run(folder, "fit", "project.toml", "--out", "out", "--starts", "3", "--overwrite")
    for source, name in PICTURES.items():
        picture = Image.open(folder / "out" / source)
        size = WIDTH, round(WIDTH * picture.height / picture.width)
        small = picture.convert("RGB").resize(size).quantize(64)
        small.save(HERE / "pictures" / name, optimize=True)


if __name__ == "__main__":
    main()
