"""Readers of what explicit programs are given: *MAT_FABRIC with its curves, Radioss' functions."""

import re

import numpy as np

from ..materials.cases import fixed_columns


def read_k(text):
    """Fields of *MAT_FABRIC by name, and curves by number, sliced by column."""
    blocks, names = {}, {}
    for line in text.splitlines():
        if line.startswith("*"):
            blocks.setdefault(line, []).append([])
            last = blocks[line][-1]
        elif not line.startswith("$"):
            last.append(line)
    (material,) = blocks["*MAT_FABRIC_TITLE"]
    cards = (
        "mid ro ea eb - prba prab", "gab - - cse el prl lratio damp",
        "aopt flc fac ela lnrc form fvopt tsrfac", "- rgbrth a0ref a1 a2 a3 x0 x1",
        "v1 v2 v3 - - - beta isrefg", "lca lcb lcab lcua lcub lcuab rl",
        "lcaa lcbb h dt - ecoat scoat tcoat",
    )  # fmt: skip
    assert len(material) == (8 if "       -14" in material[3] else 7)
    for fields, line in zip(map(str.split, cards), material[1:], strict=False):
        assert len(line) == 10 * len(fields)
        for name, cell in zip(fields, fixed_columns(line, [10] * len(fields)), strict=True):
            assert (name == "-") == (cell.strip() == "")
            names[name] = float(cell.strip() or 0)
    curves = {}
    for title, head, *rows in blocks["*DEFINE_CURVE_TITLE"]:
        assert title.removesuffix(" biaxial") in ("warp", "fill", "shear")
        number, _, scale, _, offset, *_ = map(float, fixed_columns(head, [10] * 7))
        assert scale == 1 and offset == 0
        curves[int(number)] = np.array(
            [[float(v) for v in fixed_columns(row, [20, 20])] for row in rows]
        )
    return names, curves


def read_functions(text):
    found, last = {}, None
    for line in text.splitlines():
        if line.startswith("/FUNCT/"):
            last = found.setdefault(int(line.removeprefix("/FUNCT/")), [])
        elif last is not None and re.fullmatch(r"[ \d.E+-]{40}", line):
            last.append([float(v) for v in fixed_columns(line, [20, 20])])
    return {number: np.array(rows) for number, rows in found.items()}
