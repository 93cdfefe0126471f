"""Evaluate the load cycles of all files of a folder of cyclic tensile tests.

Prints a line a cycle: permanent strain at the reference load, stiffness (kN) between 40 and 90 % of
the peak on loading and unloading, energy lost (J/m); and the files whose extensometer slipped. The
reference load of a file is the first multiple of --step that lies 25 % above the highest load at
which one of its branches begins or ends; the published evaluation has multiples of 20 lbf.
"""

import math
from pathlib import Path

import numpy as np
from bubblefit.errors import BubblefitError
from bubblefit.experiments.cycles.evaluation import SLIP, evaluate_history
from bubblefit.experiments.cycles.values import lower_end
from bubblefit.readers.histories import find_cycles, read_history
from common import SHARED, start_on

#: N in 20 lbf.
STEP = 20 * 4.4482216152605
ABOVE = 1.25


def evaluated(path, step=STEP):
    """Return the evaluation of a file at its reference load."""
    history = read_history(path)
    low = ABOVE * lower_end(history.load, find_cycles(history.load))
    return evaluate_history(history, step * math.ceil(low / step))


def is_history(path):
    """Return whether a file is a table of load and strain over time, by its row of names."""
    with open(path, encoding="utf-8-sig", errors="replace") as stream:
        head = next((line for line in stream if not line.startswith("#")), "").casefold()
    return "load" in head and "strain" in head and "time" in head


def main(*, data=str(SHARED / "webbing"), step=STEP):
    """Evaluate the files of a folder; step: N, of reference loads."""
    slipped, kinds = {}, {}
    for path in sorted(Path(data).rglob("*.csv")):
        if not is_history(path):
            continue
        name = path.relative_to(data)
        try:
            one = evaluated(path, step)
        except BubblefitError as error:
            print(f"{name}: not evaluated: {error}")
            continue
        print(f"{name}: reference load {one.reference:.1f} N")
        for v in one.values:
            print(
                f"{name} cycle {v.cycle.number}: permanent strain {v.permanent:.5f}, EA loading "
                f"{1e-3 * v.EA_loading:.1f} kN, EA unloading {1e-3 * v.EA_unloading:.1f} kN, loss "
                f"{v.loss:.3f} J/m"
            )
        words = [str(note) for note in one.notes if note.kind == SLIP]
        if words:
            slipped[name] = words
        kinds[name] = one.values
    for name, words in slipped.items():
        print(f"slip: {name}: {'; '.join(words)}")
    if kinds:
        loss = [v.loss / v.work for values in kinds.values() for v in values]
        print(f"{len(kinds)} files, {len(loss)} cycles, {len(slipped)} files with slip or its "
              f"suspicion; median loss {100 * np.nanmedian(loss):.0f} % of the work")  # fmt: skip


if __name__ == "__main__":
    start_on(main)
