"""The lines that a study of refinement prints."""

from __future__ import annotations

from typing import Any

from bubblefit.runs.refinement import lines


def level(elements: int, factor: float, values: Any, failed: str = "") -> dict[str, Any]:
    return {
        "elements": elements, "increments": 10, "seconds": 0.5, "factor": factor,
        "values": values, "failed": failed,
    }  # fmt: skip


def quantity(order: float | None, own: float | None, remark: str = "") -> dict[str, Any]:
    return {
        "finest": 38.81234567, "order": order, "limit": 38.9, "own_error": own,
        "own_error_against": "limit", "remark": remark,
    }  # fmt: skip


def test_levels_and_quantities() -> None:
    model = {
        "quantities": {
            "first, mm": quantity(None, None),
            "apex at 22 kPa, mm": quantity(1.987, -0.00123, "one order only"),
            "load, N": quantity(None, 0.5),
        },
        "levels": [
            level(48, 4.0, {"apex at 22 kPa, mm": 14.123456789, "load, N": None}),
            level(200, 1.0, {"apex at 22 kPa, mm": 14.2, "load, N": 3.0}),
            level(800, 0.5, None, "no equilibrium"),
        ],
        "rms_N": {"to_next_finer": [12.3456, 3.1], "order": 1.999},
    }
    found = lines({"refined": "elements", "models": {"bubble": model}})
    assert found == [
        "bubble: elements refined",
        "    quads  steps  seconds   apex at 22 kPa, mm   load, N",
        "       48     10     0.50   14.12346             -",
        "      200     10     0.50   14.2                 3         (the project's own)",
        "      800     10     0.50   failed: no equilibrium",
        "  first, mm: 38.81235 on the finest",
        "  apex at 22 kPa, mm: 38.81235 on the finest, order 1.99, limit 38.9; the project's own is"
        " -0.12 % off the limit (one order only)",
        "  load, N: 38.81235 on the finest; the project's own is +50 % off the limit",
        "  RMS of the load to the next finer level: 12.3, 3.1 N, order 2.00",
    ]
