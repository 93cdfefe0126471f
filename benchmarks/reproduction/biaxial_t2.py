"""Compare published constants of a glass/PTFE fabric with ours, from a file of its test.

Usage: biaxial_t2.py FILE: ratio, n_w, n_f, eps_w, eps_f (kN/m, %) of test T2 of Uhlemann et al.,
"Effects on elastic constants of technical membranes applying the evaluation methods of
MSAJ/M-02-1995", Structural Membranes 2011, which is not part of this repository. Exit code 1 where
an E (kN/m) is off by more than 4 % or a nu by more than 0.02, by five choices, 2 to 30 kN/m.
"""

import argparse
import sys
from pathlib import Path

from bubblefit.experiments.biaxial.data import cycles_of, evaluated_paths, read_biaxial_table
from bubblefit.materials.designers import Options, evaluate, line_of

LOWEST, HIGHEST = 2.0, 30.0
#: Published: E_x t, E_y t (kN/m), nu_xy, nu_yx, S (%^2) by options.
PUBLISHED = {
    "8 paths, reciprocal": (Options(False, True), (1292.0, 816.0, 0.57, 0.90, 32.72)),
    "8 paths, free": (Options(False, False), (1188.0, 864.0, 0.73, 0.69, 23.09)),
    "10 paths, reciprocal": (Options(True, True), (914.0, 610.0, 0.83, 1.24, 637.19)),
    "10 paths, free": (Options(True, False), (860.0, 634.0, 0.94, 1.08, 625.49)),
    "1:1 and 1:2 only": (
        Options(False, True, ratios=("1:1", "1:2")), (1336.0, 824.0, 0.60, 0.97, 4.42),
    ),
}  # fmt: skip
E_WITHIN, NU_WITHIN = 0.04, 0.02


def lines_of_file(path):
    table = read_biaxial_table(path)
    paths = evaluated_paths([table], cycles_of([table], [None]))
    cut = [one.between(LOWEST, HIGHEST) for one in paths]
    return [line_of(one.ratio, one.load, one.since) for one in cut]


def compared(lines):
    """Of each choice: its name, published, ours, whether ours is near enough."""
    found = []
    for name, (options, published) in PUBLISHED.items():
        one = evaluate(lines, options)
        c = one.constants
        ours = (c.warp, c.fill, c.nu_warp, c.nu_fill, one.squares)
        near = all(abs(a / b - 1) <= E_WITHIN for a, b in zip(ours[:2], published[:2], strict=True))
        near &= all(abs(a - b) <= NU_WITHIN for a, b in zip(ours[2:4], published[2:4], strict=True))
        found.append((name, published, ours, near))
    return found


def main():
    parser = argparse.ArgumentParser(description=(__doc__ or "").replace("%", "%%"))
    parser.add_argument("file", type=Path)
    rows = compared(lines_of_file(parser.parse_args().file))
    for name, published, ours, near in rows:
        for who, values in (("published", published), ("ours", ours)):
            e_x, e_y, nu_xy, nu_yx, squares = values
            print(f"{name:22s}{who:10s}{e_x:7.0f}{e_y:7.0f}{nu_xy:7.2f}{nu_yx:7.2f}{squares:9.2f}"
                  f"{'' if near or who == 'published' else '  missed'}")  # fmt: skip
    sys.exit(0 if all(near for *_, near in rows) else 1)


if __name__ == "__main__":
    main()
