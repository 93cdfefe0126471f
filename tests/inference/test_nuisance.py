"""inference/nuisance.py: unknowns that are no law, of one comparison or shared."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from bubblefit.inference.nuisance import NuisanceUnknowns

from .cases import (
    BUBBLE_OF_100_MM,
    LAW,
    NU12,
    PRESSURE,
    SHIFT,
    THICKNESS,
    bubble_and_strip,
    cubic_problem_of,
    fields_objective,
    fitted_by_lm,
    noisy_bubble_comparison,
    two_bubbles,
)


def test_nuisance_belongs_to_its_comparison_and_stays_within_bounds():
    unknowns = two_bubbles().unknowns
    own = {"offset_z": 0.1, "pressure_offset": 2.0, "offset_x": 0.3}
    names = *(f"bubble 1: {name}" for name in own), "bubble 2: pressure_offset"
    assert unknowns.nuisance.names == names and unknowns.count == 16
    y = np.concatenate([np.ones(12), [0.1, 2.0, 0.3, -4.0]])
    for name, values in (("1", own), ("2", {"pressure_offset": -4.0}), ("3", {})):
        assert unknowns.nuisance_values(f"bubble {name}", y) == values
    alone = cubic_problem_of(noisy_bubble_comparison("bubble 1", BUBBLE_OF_100_MM, PRESSURE))
    assert alone.unknowns.nuisance.names == ("pressure_offset",)
    a, c = unknowns.inequalities
    y = unknowns.at(LAW.beta)
    assert (a @ y >= c).all()
    for k, end in ((12, 20.1), (13, -18.1), (14, -20.1), (15, 50.1)):
        outside = y.copy()
        outside[k] = end
        assert (a @ outside < c).any()


def test_offsets_of_two_comparisons_are_fitted_with_the_law():
    fit = two_bubbles()
    truth = {"bubble 1": (0.8, 2.0, 0.2), "bubble 2": (-3.0,)}
    for one in fit.comparisons:
        values = dict(zip((n.name for n in one.nuisance), truth[one.name], strict=True))
        offset = {"pressure_offset": 1e-3 * values["pressure_offset"]}
        moved = one.solver.run(one.model.with_parameters(offset), LAW)
        shift = [values.get(f"offset_{axis}", 0.0) for axis in "xyz"]
        one.objective = fields_objective(one.model, moved.displacement + shift)
    optimum = fitted_by_lm(fit, fit.unknowns.at(LAW.beta * 1.05), 1e-8, 60)
    assert optimum.value < 1e-7
    assert optimum.best.unknowns[12:] == pytest.approx([0.8, 2.0, 0.2, -3.0], abs=1e-4)


def test_shared_nuisance_is_one_unknown():
    nuisance = NuisanceUnknowns({"a": (SHIFT, NU12), "b": (NU12, PRESSURE, THICKNESS)})
    assert nuisance.names == ("nu12", "thickness", "a: offset_z", "b: pressure_offset")
    assert nuisance.positions("a").tolist() == [2, 0]
    assert nuisance.positions("b").tolist() == [0, 3, 1]
    values = np.array([0.2, 0.9, 3.0, 4.0])
    assert nuisance.values("b", values) == {"nu12": 0.2, "pressure_offset": 4.0, "thickness": 0.9}
    assert nuisance.start.tolist() == [0.3, 0.8, 0.0, 0.0]
    assert nuisance.of_law(values) == {"nu12": 0.2}
    # A step may leave the bounds by rounding, a law may not.
    assert nuisance.of_law(np.array([-1e-12, 0.9, 0.0, 0.0])) == {"nu12": 0.0}
    assert NuisanceUnknowns({"a": (NU12,)}).names == ("nu12",)


@pytest.mark.parametrize(
    ("lower", "upper", "drawn"),
    [(0.3, 2.9, 1.6), (0.3, 3.1, np.sqrt(0.93)), (2.0, 1800.0, 60.0), (0.0, 8.0, 4.0)],
)
def test_start_is_drawn_by_logarithm_where_bounds_are_wider_than_ten(lower, upper, drawn):
    known = replace(SHIFT, begin=0.7)
    unknown = replace(SHIFT, name="drawn", lower=lower, upper=upper, drawn=True)
    nuisance = NuisanceUnknowns({"a": (known, unknown)})
    middle = SimpleNamespace(random=lambda: 0.5)
    assert nuisance.drawn(middle) == pytest.approx([0.7, drawn])


def test_nu12_is_fitted_from_a_wrong_start():
    fit = bubble_and_strip(NU12)
    optimum = fitted_by_lm(fit, fit.unknowns.at(LAW.beta * 1.05), 1e-8, 60)
    assert optimum.value < 1e-7
    assert optimum.best.unknowns[12] == pytest.approx(LAW.nu12, abs=1e-5)
    assert fit.unknowns.law(fit.law, optimum.best.unknowns).nu12 == optimum.best.unknowns[12]
