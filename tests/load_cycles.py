"""Made load histories, good and faulty."""

import numpy as np

#: Straight branches of three cycles: strain kept after each, peak strain, load at the peak, N.
MADE = ((0.004, 0.010, 3000.0), (0.005, 0.010, 3000.0), (0.008, 0.016, 6000.0))
LOW = 40.0


def made(points=40, made=MADE):
    """Return time, load and strain: up to each peak in a line and down to LOW in another."""
    load, strain = [LOW], [0.0]
    for kept, top, peak in made:
        up, down = np.linspace(0, 1, points)[1:], np.linspace(1, 0, points)[1:]
        load += [*(LOW + (peak - LOW) * up), *(LOW + (peak - LOW) * down)]
        strain += [*(strain[-1] + (top - strain[-1]) * up), *(kept + (top - kept) * down)]
    return 0.5 * np.arange(len(load)), np.array(load), np.array(strain)


def write(path, header, columns, separator=",", comma=False, end=""):
    rows = [
        separator.join(f"{value:.12g}" for value in row) + end for row in zip(*columns, strict=True)
    ]
    text = "\n".join(rows)
    path.write_text("\n".join(header) + "\n" + (text.replace(".", ",") if comma else text) + "\n")
    return path


def faulty(folder):
    """Write histories of extensometers that are good, slip or drift; return the paths by fault."""
    time, load, strain = made()
    _, _, negative = made(made=(*MADE[:2], (0.0105, 0.016, 6000.0)))
    negative[-39:] -= np.linspace(0.0, 0.012, 39)  # the clips slide back at the third peak
    rest = np.arange(-20.0, 0.0, 0.5)
    drift = np.r_[rest, time] * 2e-5 + np.r_[0 * rest, strain]
    made_up = {
        "good": (time, load, strain),
        "negative": (time, load, negative),
        "lost": (time, load, strain - 4e-4 * (np.arange(len(strain)) > 85)),
        "drifting": (np.r_[rest, time], np.r_[LOW + 0 * rest, load], drift),
    }
    return {
        name: write(folder / f"{name}.csv", ["time_s,load_N,strain"], columns)
        for name, columns in made_up.items()
    }
