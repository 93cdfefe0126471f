"""Field: mistakes that people make in load curves of strips, and good curves."""

from dataclasses import replace

import numpy as np
import pytest

from ..experiments.strips.cases import (
    BROKEN,
    ENDS,
    GAUGE,
    GOOD_CURVES,
    GOOD_FILL,
    GOOD_WARP,
    THICKNESS,
    WIDTH,
    changed_curve,
    read_strips,
    strip_doubt_names,
    strip_doubts_of,
    strip_of_curves,
)

STILL = np.minimum(GOOD_CURVES["bias"].elongation, 7.0)
TRAPS = {
    "percent for mm": (
        changed_curve("bias", elongation=100 * GOOD_CURVES["bias"].elongation / GAUGE),
        {"bias": 100 * ENDS["bias"] / GAUGE},
        ("elongation-unit", True, "not a strain"),
    ),
    "strain for mm": (
        changed_curve("fill", elongation=GOOD_FILL.elongation / GAUGE / 1000),
        {"fill": ENDS["fill"] / GAUGE / 1000},
        ("elongation-unit", True, "gauge lengths"),
    ),
    "exchanged columns": (
        changed_curve("warp", elongation=GOOD_WARP.load, load=GOOD_WARP.elongation),
        {"warp": GOOD_WARP.load.max()},
        ("elongation-unit", True, "not the load"),
    ),
    "kN for N": (changed_curve("warp", load=GOOD_WARP.load / 1000), {}, ("load-unit", True, "MPa")),
    "N/m for N": (
        changed_curve("fill", load=GOOD_FILL.load / (1e-3 * WIDTH)),
        {},
        ("load-unit", True, "bounds of E2"),
    ),
    "preload": (
        changed_curve("fill", load=GOOD_FILL.load + 150.0),
        {},
        ("preload", False, "fill, 2: the load"),
    ),
    "travel of the crosshead": (
        changed_curve("warp", between_grips="Stroke"),
        {},
        ("grip-travel", False, "'Stroke'"),
    ),
    "extensometer taken off": (
        changed_curve("bias", elongation=STILL),
        {"bias": 7.0},
        ("gauge-still", True, "at 7 mm"),
    ),
    "load cell at its limit": (
        changed_curve("warp", load=np.minimum(GOOD_WARP.load, 0.6 * GOOD_WARP.load.max())),
        {},
        ("load-limit", False, "at their limit"),
    ),
    "slack in the grips": (
        changed_curve("warp", load=np.maximum(GOOD_WARP.load - 0.3 * GOOD_WARP.load.max(), 0.0)),
        {},
        ("slack-strip", False, "was slack"),
    ),
    "rows after failure": (BROKEN, {}, ("after-failure", True, "falls from")),
    "kgf for N": (
        changed_curve("warp", load=GOOD_WARP.load / 8.0),
        {},
        ("force-unit", False, "if they are kgf"),
    ),
    "warp and fill swapped": (
        {
            **GOOD_CURVES,
            "warp": replace(GOOD_FILL, direction="warp"),
            "fill": replace(GOOD_WARP, direction="fill"),
        },
        {"warp": ENDS["fill"], "fill": ENDS["warp"]},
        ("swapped", False, "swapped"),
    ),
}


@pytest.mark.parametrize("trap", TRAPS)
def test_mistake_in_strips_is_named(trap):
    curves, ends, (name, sure, words) = TRAPS[trap]
    found = strip_doubt_names(curves, **ends)
    assert found[name].sure == sure and words in found[name].text, list(found)
    assert {d.name for d in found.values() if d.sure} <= {name, "load-unit"}


def test_good_curves_raise_no_doubt():
    assert not strip_doubt_names(GOOD_CURVES)
    # Rows after failure beyond the final length are none.
    assert not strip_doubt_names(BROKEN, fill=4.0)
    # A curve known by its polynomial is looked at too.
    whole = {d: replace(strip_of_curves(c), curves=()) for d, c in GOOD_CURVES.items()}
    assert not strip_doubts_of(whole)
    assert {d.name for d in strip_doubts_of(whole, 100 * THICKNESS)} == {"load-unit"}


def test_give_of_the_machine_is_taken_off_the_elongation(tmp_path):
    """Machine compliance in travel from grip to grip: questions on test frames in forums."""
    load = np.linspace(0.0, 800.0, 30)
    true = 4.0 * load / 800.0
    table = np.column_stack([true + 0.001 * load, load])
    np.savetxt(tmp_path / "w.csv", table, "%.6f", ",", header="elongation,load", comments="")
    text = (
        "compliance = 0.001\n[warp]\ngauge_length = 75.0\n"
        '[data]\nload_unit = "N"\nlength_unit = "mm"\nfiles = {{ warp = ["w.csv"] }}\n'
    ).format()
    (tmp_path / "strips.toml").write_text(text)
    (curve,) = read_strips(tmp_path / "strips.toml").strips["warp"].curves
    assert curve.elongation == pytest.approx(true, abs=1e-5)
