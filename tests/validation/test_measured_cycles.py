"""Validation: measured straps and cords against values by hand."""

import csv
import math
from itertools import pairwise

import pytest

from ..support.paths import ROOT


def by_hand(path, reference):
    with open(path, newline="") as stream:
        rows = [row for row in csv.DictReader(stream) if float(row["cycle"]) > 0]
    found, zero = [], None
    for number in sorted({int(row["cycle"]) for row in rows}):
        own = [(float(r["load_N"]), float(r["strain"])) for r in rows if int(r["cycle"]) == number]
        top = max(range(len(own)), key=lambda i: own[i][0])
        peak, up, down = own[top][0], own[: top + 1], own[top:]

        def passed(points):
            for (f, e), (g, d) in pairwise(points):
                if (f < reference) != (g < reference):
                    return e + (reference - f) / (g - f) * (d - e)
            return math.nan

        def slope(points, peak=peak):
            kept = [p for p in points if 0.4 * peak <= p[0] <= 0.9 * peak]
            n, sx, sy = len(kept), sum(e for _, e in kept), sum(f for f, _ in kept)
            sxy, sxx = sum(f * e for f, e in kept), sum(e * e for _, e in kept)
            return (n * sxy - sx * sy) / (n * sxx - sx * sx)

        start, end = passed(up), passed(down)
        zero = start if zero is None else zero
        above = [(reference, start), *(p for p in up if p[0] >= reference)]
        back = [*(p for p in down if p[0] >= reference), (reference, end)]
        area = [sum(0.5 * (f + g) * (d - e) for (f, e), (g, d) in pairwise(part))
                for part in (above, back)]  # fmt: skip
        found.append((end - zero, slope(up), slope(down), area[0] + area[1]))
    return found


def test_measured_straps_and_cords_equal_values_by_hand(shared_data, monkeypatch):
    monkeypatch.syspath_prepend(str(ROOT / "benchmarks"))
    import bench_cycles

    files = sorted((shared_data / "webbing").glob("*.csv"))
    assert len(files) >= 8
    for path in files:
        one = bench_cycles.evaluated(path)
        hand = by_hand(path, one.reference)
        assert len(hand) == len(one.values), path.name
        for v, values in zip(one.values, hand, strict=True):
            ours = v.permanent, v.EA_loading, v.EA_unloading, v.loss
            assert ours == pytest.approx(values, rel=0.02), (path.name, v.cycle.number)
