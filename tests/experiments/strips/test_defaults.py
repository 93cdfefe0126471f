"""What a section of strips is where it says nothing."""

from __future__ import annotations

from bubblefit.experiments.strips.section import CurvesSection, StripsSection


def test_defaults() -> None:
    said = StripsSection(data=CurvesSection())
    assert (said.bias_angle, said.increments) == (45.0, 100)
    assert (said.match, said.objective, said.weight) == ("polynomial", "N", 1.0)
    assert said.weights.model_dump() == {"warp": 1.0, "fill": 1.0, "bias": 1.0}
    assert (said.data.order, said.data.through_origin, said.data.comment) == (4, True, "#")
