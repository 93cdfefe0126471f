"""Files of biaxial tests, computed with a law: cycles of each ratio, loaded and unloaded."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from bubblefit.materials.biaxial_patch import biaxial_response
from bubblefit.materials.designers import shares
from bubblefit.materials.law import HypoelasticLaw

FIVE_RATIOS = ("1:1", "2:1", "1:2", "1:0", "0:1")
THICKNESS = 0.8
#: A law that bends: its moduli go by a third over the strains of the tests.
BENT_LAW = HypoelasticLaw(
    [0, 0, 0, 30, 2e5, -3e4, 2e3, 600, 4e5, -5e4, 3e3, 900], 0.24, [0.07, 0.07, 0.1]
)
HEAD = 'ratio,"n_w, kN/m","n_f, kN/m","eps_w, %","eps_f, %"'


def load_cycle(lowest: float = 2.0, highest: float = 30.0, rows: int = 30) -> np.ndarray:
    down = np.linspace(highest, lowest, rows // 2 + 2)[1:-1]
    return np.concatenate([np.linspace(lowest, highest, rows), down])


def biaxial_rows(law, ratios=FIVE_RATIOS, cycles=1, kept=0.0, **options):
    """Ratio, loads (kN/m), strains (%) row by row; kept : % of strain that every cycle leaves."""
    rows, count = [], 0
    for ratio in ratios:
        for _ in range(cycles):
            loads = np.outer(load_cycle(**options), shares(ratio))
            strain = 100 * biaxial_response(law, loads, THICKNESS).elongation + kept * count
            rows += [(ratio, *n, *e) for n, e in zip(loads.tolist(), strain.tolist(), strict=True)]
            count += 1
    return rows


def write_biaxial_rows(path: Path, rows: Sequence[Sequence[object]], head: str = HEAD) -> Path:
    lines = [",".join(x if isinstance(x, str) else repr(float(x)) for x in row) for row in rows]
    path.write_text("\n".join([head, *lines]) + "\n")
    return path


def biaxial_project(folder: Path, test="", form="cubic", file="test.csv") -> Path:
    path = folder / "project.toml"
    path.write_text(
        f'[fabric]\nname = "made"\nthickness = {THICKNESS}\n[units]\nmodulus = "MPa"\n'
        f'[law]\nform = "{form}"\nnu12 = 0.24\nstrain_range = [0.07, 0.07, 0.1]\n'
        "[law.bounds]\nE1 = [100, 3000]\nE2 = [100, 3000]\nG12 = [1, 300]\n"
        f'[[biaxial]]\n{test}\n[biaxial.data]\nfiles = ["{file}"]\n[fit]\nstarts = 1\n'
    )
    return path
