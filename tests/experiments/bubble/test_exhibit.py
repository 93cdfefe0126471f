"""What a bubble puts on the page of a fit: facts, and the tables of its misfit."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from bubblefit.experiments.bubble import report as figures
from bubblefit.experiments.bubble.objective import FieldObjective, FieldTarget
from bubblefit.experiments.bubble.report import misfit_table, residual_table, surface_tables
from bubblefit.solvers.base import History


def facts(shift: Any = None, pressure: Any = None, doubtful: int = 0, outside: int = 0) -> Any:
    sheet = {
        "measured_rms_mm": None, "modes_mm": {}, "surface_mm": {}, "slack_percent": None,
        "rim_motion_mm": None, "constant_field_rms_mm": None, "from_pressure_kPa": 35.0,
    }  # fmt: skip
    numbers = {
        "mean_abs_mm": 0.125,
        "data": {"doubtful_dropped": doubtful, "outside_dropped": outside},
        "nuisance": {"displacement_offset_mm": shift, "pressure_offset_kPa": pressure},
        "sheet": sheet,
    }
    return figures._facts(None, SimpleNamespace(numbers=numbers))  # type: ignore[arg-type]


def test_facts() -> None:
    first, last = (
        ("mean |dx| + |dy| + |dz|, mm", 0.125), ("sheet", "displacements counted from 35 kPa")
    )  # fmt: skip
    assert facts() == [first, last]
    assert facts([0.1, -0.2, 0.33333], -1.5, 3, 7) == [
        first,
        ("points left out", "3 doubtful, 7 beyond the rim"),
        ("displacement offset, mm", "0.100, -0.200, 0.333"),
        ("pressure offset, kPa", "-1.500"),
        last,
    ]
    for one in ({"doubtful": 1}, {"outside": 2}):
        assert len(facts(**one)) == 3


@pytest.mark.parametrize(("objective", "scales"), [("mm", (1, 1, 1)), ("e", (2, 4, 5))])
def test_misfit_by_pressure(objective: str, scales: tuple[float, ...]) -> None:
    """Of one point: its difference, or that over the largest value measured."""
    read = np.array([[[2.0, 4.0, 5.0]], [[2.0, 4.0, -5.0]]])
    moved = read + np.array([[[0.1, 0.2, -0.4]], [[0.5, 0.0, 0.3]]])
    targets = [FieldTarget(p, u) for p, u in zip((0.02, 0.2), read, strict=True)]
    comparison = SimpleNamespace(objective=FieldObjective(targets, objective))
    history = History(np.array([0.02, 0.2]), moved, np.zeros(3), np.zeros(3))
    fitted: Any = SimpleNamespace(comparisons=[comparison], histories=[history], nuisance={})
    prepared: Any = SimpleNamespace(test=SimpleNamespace(objective=objective))
    comparison.model = SimpleNamespace(mesh=SimpleNamespace(points=np.array([[7.0, 8.0, 0.0]])))
    each = residual_table(prepared, fitted)
    assert each.index.tolist() == [0, 1, 2, 3, 4, 5]
    assert list(each.columns) == [
        "part", "frame", "pressure_kPa", "x_mm", "y_mm", "quantity", "measured", "modelled",
        "difference", "unit",
    ]  # fmt: skip
    assert each.iloc[5].tolist()[:6] == ["bubble", 2, 200.0, 7.0, 8.0, "dz"]
    assert each.iloc[5].tolist()[6:9] == pytest.approx([-5.0, -4.7, 0.3])
    assert each["frame"].tolist() == [1, 1, 1, 2, 2, 2] and set(each["unit"]) == {"mm"}
    table = misfit_table(prepared, fitted)
    assert (table.title, table.header) == (
        "Misfit by pressure", ["pressure, kPa", "x", "y", "z"]
    )  # fmt: skip
    off = np.array([[0.1, 0.2, 0.4], [0.5, 0.0, 0.3]]) / scales
    np.testing.assert_allclose(table.rows, np.column_stack([[20.0, 200.0], off]), atol=1e-12)
    assert table.note == (
        "RMS error in mm, direction by direction"
        if objective == "mm"
        else "RMS error over the largest measured value, direction by direction"
    )


def test_how_well_surfaces_follow() -> None:
    surface = SimpleNamespace(r_squared=np.array([0.999994, 0.5, 1.0]))
    test = SimpleNamespace(match_by="points", match_degree=6, pressures=(0.02,))
    prepared: Any = SimpleNamespace(test=test, surfaces=[])
    assert surface_tables(prepared) == []
    prepared.surfaces = [surface]
    (table,) = surface_tables(prepared)
    assert table.title == "R\u00b2 of polynomial surfaces of degree 6"
    assert table.rows == [[20.0, "0.99999", "0.50000", "1.00000"]]
    assert table.note == "for the record: the fit matched the points themselves"
    test.match_by = "surfaces"
    assert surface_tables(prepared)[0].note == ""
