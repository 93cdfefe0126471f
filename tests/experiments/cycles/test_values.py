"""experiments/cycles/values.py: values of cycles and holds."""

import numpy as np
import pytest
from bubblefit import cycles
from bubblefit.experiments.cycles.values import matched_rows
from bubblefit.readers.histories import find_cycles, find_holds, read_history

from ...builders.load_histories import LOWEST_LOAD, THREE_CYCLES, load_history, write_history

LBF, INCH = 4.4482216152605, 25.4


def test_straight_branches_have_their_slopes_and_areas(plain_history_file):
    found = cycles(plain_history_file, reference_load=100.0).histories[0]
    start, zero = 0.0, 0.010 * (100.0 - LOWEST_LOAD) / (3000.0 - LOWEST_LOAD)
    assert [v.cycle.number for v in found.values] == [1, 2, 3]
    for v, (kept, top, peak) in zip(found.values, THREE_CYCLES, strict=True):
        up, down = (peak - LOWEST_LOAD) / (top - start), (peak - LOWEST_LOAD) / (top - kept)
        permanent = kept + (100.0 - LOWEST_LOAD) / down - zero
        mean = 0.5 * (peak + 100.0)
        work, back = ((peak - 100.0) / slope * mean for slope in (up, down))
        values = v.EA_loading, v.EA_unloading, v.secant_loading, v.secant_unloading
        assert values == pytest.approx((up, down, up, down), rel=1e-9)
        assert (v.permanent, v.top) == pytest.approx((permanent, top - zero), rel=1e-9)
        assert (v.work, v.loss) == pytest.approx((work, work - back), rel=1e-9)
        # The loop is narrowest at one end of the levels at which it is measured.
        widths = [
            kept - start + (level - LOWEST_LOAD) * (1 / down - 1 / up)
            for level in (max(0.2 * peak, 100.0), 0.95 * peak)
        ]
        assert v.crossing == pytest.approx(min(widths), abs=1e-9)
        start = kept
    table = cycles(plain_history_file, width=50.0).table
    assert table["EA_loading_N_per_mm"][0] == pytest.approx((3000 - LOWEST_LOAD) / 0.010 / 50)
    assert table["loading_N_per_s"][0] == pytest.approx(2 * (3000 - LOWEST_LOAD) / 39)


@pytest.mark.parametrize("machine", ["instron", "zwick", "mts"])
def test_history_does_not_depend_on_machine_and_units(plain_history_file, tmp_path, machine):
    time, load, strain = load_history()
    path = tmp_path / f"{machine}.csv"
    if machine == "instron":
        head = ['"Total Time (s)","Cycle Elapsed Time (s)","Position (in)","Load (lbf)",'
                '"Strain(8800:Extensometer) (in/in)",']  # fmt: skip
        columns = (time, time % 7, 300 / INCH * strain, load / LBF, strain)
        write_history(path, head, columns, end=",")
    elif machine == "zwick":
        head = ["Prüfzeit;Standardkraft;Standardweg;Feindehnung", "s;kN;mm;%"]
        write_history(path, head, (time, load / 1e3, 300 * strain, 100 * strain), ";", comma=True)
    else:
        head = ["Running Time\tAxial Force\tAxial Displacement\tAxial Strain",
                "(s)\t(kN)\t(mm)\t(mm/mm)"]  # fmt: skip
        write_history(path, head, (time, load / 1e3, 300 * strain, strain), "\t")
    one, other = read_history(plain_history_file), read_history(path)
    np.testing.assert_allclose(other.load, one.load, rtol=1e-9)
    np.testing.assert_allclose(other.strain, one.strain, atol=1e-12)
    np.testing.assert_allclose(other.time, time)
    np.testing.assert_allclose(other.travel, 300 * strain, atol=1e-9)
    assert other.measured == "extensometer"


def test_load_that_only_falls_has_no_hold(tmp_path):
    fall = np.linspace(1.0, 0.0, 20)
    columns = (np.arange(20.0), 2000 * fall, 0.03 * fall)
    path = write_history(tmp_path / "falls.csv", ["time_s,load_N,strain"], columns)
    history = read_history(path)
    assert find_holds(history, find_cycles(history.load)) == []


def test_hold_gives_creep_per_decade(tmp_path):
    time, load, strain = load_history(points=80, cycles=THREE_CYCLES[:1])
    top = int(np.argmax(load))
    since = np.arange(1, 401) * 0.5
    creep = strain[top] + 1e-4 * np.log10(1 + since / 0.01)
    joined = (
        np.r_[time[: top + 1], time[top] + since, time[top + 1 :] + since[-1]],
        np.r_[load[: top + 1], np.full(400, load[top]), load[top + 1 :]],
        np.r_[strain[: top + 1], creep, strain[top + 1 :] + creep[-1] - strain[top]],
    )
    path = write_history(tmp_path / "held.csv", ["time_s,load_N,strain"], joined)
    history = read_history(path)
    (hold,) = find_holds(history, find_cycles(history.load))
    assert hold.position == "top"
    row = cycles(path).holds.iloc[0]
    assert row["strain_per_decade"] == pytest.approx(1e-4, rel=0.05)
    assert row["load_N_per_decade"] == pytest.approx(0.0, abs=1e-9)
    assert row["duration_s"] == pytest.approx(200.0, rel=0.05)


def test_stable_cycle_is_the_first_that_repeats(tmp_path):
    several = ((0.004, 0.010, 3000.0), (0.0048, 0.0102, 3000.0), (0.0049, 0.01025, 3000.0),
               (0.00492, 0.01026, 3000.0), (0.00493, 0.010262, 3000.0))  # fmt: skip
    path = write_history(
        tmp_path / "five.csv", ["time_s,load_N,strain"], load_history(cycles=several)
    )
    assert cycles(path).histories[0].stable_cycle == 4
    assert cycles(path).table["state"].tolist() == ["first", "", "", "conditioned", ""]


def test_rates_are_those_of_the_ramps_with_a_hold_and_a_clock_of_whole_seconds(tmp_path):
    """1,000 N in 20 s up and down, with 30 s at the top, read ten times a second."""
    time = np.arange(0.0, 70.0, 0.1)
    load = np.interp(time, [0.0, 20.0, 50.0, 70.0], [0.0, 1000.0, 1000.0, 0.0])
    strain = 1e-5 * load + np.interp(time, [20.0, 50.0], [0.0, 2e-3])
    head = ["Time (s),Load (N),Strain (mm/mm)"]
    for name, clock in (("tenths", time), ("seconds", np.floor(time + 1e-6))):
        path = write_history(tmp_path / f"{name}.csv", head, (clock, load, strain))
        found = cycles(path, reference_load=10.0)
        assert found.table["loading_N_per_s"][0] == pytest.approx(50.0, rel=0.1)
        assert found.table["unloading_N_per_s"][0] == pytest.approx(50.0, rel=0.1)
        (hold,) = found.holds.to_dict("records")
        assert hold["at"] == "top" and hold["duration_s"] == pytest.approx(30.0, abs=1.5)
        assert np.isfinite(hold["strain_per_decade"])


def test_rows_between_crossings_of_the_reference_load_are_matched(plain_history_file):
    (evaluated,) = cycles(plain_history_file, reference_load=100.0).histories
    load = evaluated.history.load
    first, last = matched_rows(evaluated)
    assert load[first - 1] < 100.0 <= load[first]
    assert load[last] >= 100.0 > load[last + 1] and last > np.argmax(load)
