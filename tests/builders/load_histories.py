"""Computed load histories of three cycles, good and faulty."""

import numpy as np

#: Straight branches of three cycles: strain kept after each, peak strain, load at the peak, N.
THREE_CYCLES = ((0.004, 0.010, 3000.0), (0.005, 0.010, 3000.0), (0.008, 0.016, 6000.0))
LOWEST_LOAD = 40.0


def load_history(points=40, cycles=THREE_CYCLES):
    """Return time, load and strain: up to each peak in a line and down to LOW in another."""
    load, strain = [LOWEST_LOAD], [0.0]
    for kept, top, peak in cycles:
        up, down = np.linspace(0, 1, points)[1:], np.linspace(1, 0, points)[1:]
        load += [
            *(LOWEST_LOAD + (peak - LOWEST_LOAD) * up),
            *(LOWEST_LOAD + (peak - LOWEST_LOAD) * down),
        ]
        strain += [*(strain[-1] + (top - strain[-1]) * up), *(kept + (top - kept) * down)]
    return 0.5 * np.arange(len(load)), np.array(load), np.array(strain)


def write_history(path, header, columns, separator=",", comma=False, end=""):
    rows = [
        separator.join(f"{value:.12g}" for value in row) + end for row in zip(*columns, strict=True)
    ]
    text = "\n".join(rows)
    path.write_text("\n".join(header) + "\n" + (text.replace(".", ",") if comma else text) + "\n")
    return path


def faulty_histories(folder):
    """Write histories of extensometers that are good, slip or drift; return the paths by fault."""
    time, load, strain = load_history()
    _, _, negative = load_history(cycles=(*THREE_CYCLES[:2], (0.0105, 0.016, 6000.0)))
    negative[-39:] -= np.linspace(0.0, 0.012, 39)  # the clips slide back at the third peak
    rest = np.arange(-20.0, 0.0, 0.5)
    drift = np.r_[rest, time] * 2e-5 + np.r_[0 * rest, strain]
    made_up = {
        "good": (time, load, strain),
        "negative": (time, load, negative),
        "lost": (time, load, strain - 4e-4 * (np.arange(len(strain)) > 85)),
        "drifting": (np.r_[rest, time], np.r_[LOWEST_LOAD + 0 * rest, load], drift),
    }
    return {
        name: write_history(folder / f"{name}.csv", ["time_s,load_N,strain"], columns)
        for name, columns in made_up.items()
    }
