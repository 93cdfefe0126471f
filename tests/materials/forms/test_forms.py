"""Every form as a map onto piecewise cubics; splines; which form a name means."""

from __future__ import annotations

import numpy as np
import pytest
from bubblefit.errors import InputError
from bubblefit.materials.forms.base import (
    COMPONENTS,
    ORDER,
    UNLIMITED,
    Form,
    moduli_on_grid,
    modulus_rows,
    pieces_of,
    ratio_map,
    ratios_of,
)
from bubblefit.materials.forms.polynomial import CUBIC, DEGREES, LINEAR
from bubblefit.materials.forms.ratio import LoadRatio
from bubblefit.materials.forms.registry import form_named, form_names, form_settings
from bubblefit.materials.forms.spline import PARTS, Spline
from bubblefit.materials.law import HypoelasticLaw
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.interpolate import CubicSpline

from .pieces_of_laws import BETA, KNOTS, RANGE
from .pieces_of_laws import LAWS as OF_STRAIN

LAWS = {
    **OF_STRAIN,
    "load-ratio": HypoelasticLaw(
        np.array([20.0, 240.0, 90.0, 600.0, -150.0]), 0.24, RANGE, form=LoadRatio()
    ),
}
FORMS = pytest.mark.parametrize("name", LAWS)
NO_RANGE = [UNLIMITED] * 3


@FORMS
def test_what_every_form_says_fits_together(name: str) -> None:
    form = LAWS[name].form
    assert isinstance(form, Form) and form.name == name and name in form_names()
    assert len(form.labels) == form.size and len(set(form.labels)) == form.size
    assert len(form.free) == len(form.modulus_of) and set(form.modulus_of) == set(ORDER)
    rows, uppers = form.piece_map(), form.uppers()
    assert rows.shape == (*uppers.shape, 4, form.size) and (uppers[:, -1] == UNLIMITED).all()
    assert (np.diff(uppers) >= 0).all()
    # An entry belongs to one modulus, that of its name.
    for entry, modulus in zip(form.free, form.modulus_of, strict=True):
        component = COMPONENTS[modulus]
        by_ratio = np.vstack([ratio_map(form), np.zeros(form.size)])[:, entry]
        assert rows[component, ..., entry].any() != (by_ratio[component] != 0)
        assert not np.delete(rows, component, axis=0)[..., entry].any()
        assert not np.delete(by_ratio, component).any()
    t = form.from_values(RANGE)
    assert t.shape == (len(form.free),) * 2 and np.linalg.cond(t) < 1e16
    assert form.describe().endswith(".") and "E1" in form.describe()
    again = form_named(name, form.to_card(), NO_RANGE)
    assert again == form and hash(again) == hash(form)


@FORMS
@settings(max_examples=30, deadline=None)
@given(data=st.data())
def test_moduli_are_linear_in_the_entries(name: str, data: st.DataObject) -> None:
    law = LAWS[name]
    modulus = data.draw(st.sampled_from(ORDER))
    strain = data.draw(st.lists(st.floats(-0.3, 0.3), min_size=1, max_size=9))
    rows = law.modulus_rows(modulus, strain)
    assert rows.shape == (len(strain), law.form.size)
    assert rows @ law.beta == pytest.approx(law.modulus(modulus, strain), rel=1e-9)
    assert law.modulus(modulus, np.array(strain)[:, None]).shape == (len(strain), 1)


@FORMS
@pytest.mark.parametrize("ends", [RANGE, [0.005, 0.06, 0.05], [0.03, 0.02, 0.01], NO_RANGE])
def test_pieces_end_where_the_range_does(name: str, ends: list[float]) -> None:
    form = LAWS[name].form
    pieces = pieces_of(form, LAWS[name].beta, ends)
    assert (pieces[:, -1, 0] == ends).all()
    uppers = form.uppers()
    for component, end in enumerate(ends):
        own = [upper for upper in uppers[component] if upper < end]
        reached = pieces[component, :, 0]
        assert (reached[: len(own)] == own).all() and (reached[len(own) :] == end).all()
        # Repeated, not made up: what follows the last piece is that piece.
        assert (pieces[component, len(own) :] == pieces[component, len(own)]).all()
    law = HypoelasticLaw(LAWS[name].beta, strain_range=ends, form=form)
    for modulus, component in COMPONENTS.items():
        assert law.modulus(modulus, 2 * ends[component]) == law.modulus(modulus, ends[component])


@FORMS
def test_the_grid_sees_every_piece(name: str) -> None:
    form = LAWS[name].form
    for component, end in enumerate(RANGE):
        grid = form.grid(component, end)
        assert grid[0] == 0 and grid[-1] == end and (np.diff(grid) > 0).all()
        inside = [upper for upper in form.uppers()[component] if upper < end]
        assert np.isin(inside, grid).all()
    rows = moduli_on_grid(form, RANGE)
    assert tuple(rows) == ORDER
    for modulus, part in rows.items():
        strain = form.grid(COMPONENTS[modulus], RANGE[COMPONENTS[modulus]])
        moduli = [LAWS[name].modulus(modulus, strain, r) for r in ratios_of(form, modulus)]
        assert part @ LAWS[name].beta == pytest.approx(np.concatenate(moduli))
    # Linear in the ratio: the ends are enough.
    asked = [1, 3, 3] if name == "load-ratio" else [1, 1, 1]
    assert [len(ratios_of(form, modulus)) for modulus in ORDER] == asked


@pytest.mark.parametrize("name", DEGREES)
def test_control_values_of_a_polynomial_are_moduli(name: str) -> None:
    """from_values takes the moduli at Chebyshev points back to the coefficients."""
    law, n = LAWS[name], DEGREES.index(name) + 1
    share = 0.5 * (1 - np.cos((2 * np.arange(n) + 1) * np.pi / (2 * n)))
    values = [law.modulus(m, share * RANGE[COMPONENTS[m]]) for m in ORDER]
    free = list(law.form.free)
    assert law.form.from_values(RANGE) @ np.ravel(values) == pytest.approx(law.beta[free])


# Splines


def test_a_spline_is_the_not_a_knot_spline_through_its_values() -> None:
    law = LAWS["spline"]
    start = 0
    for modulus in ORDER:
        knots = KNOTS[COMPONENTS[modulus]]
        values = law.beta[start : start + len(knots)]
        start += len(knots)
        end = min(RANGE[COMPONENTS[modulus]], knots[-1])
        strain = np.linspace(0, end, 300)
        expected = CubicSpline(knots, values)(strain)
        assert law.modulus(modulus, strain) == pytest.approx(expected, rel=1e-11)
        inside = [knot for knot in knots if knot <= end]
        assert law.modulus(modulus, inside) == pytest.approx(values[: len(inside)], rel=1e-12)
    assert not law.jumps and LAWS["trilinear"].jumps


def test_from_four_knots_on_a_spline_contains_every_cubic() -> None:
    cubic = HypoelasticLaw(BETA, strain_range=RANGE)
    for count in (4, 5, 9, 20):
        form = form_named("spline", {"knots": count}, RANGE)
        assert form.size == 3 * count
        assert form.labels[0] == "G12 at 0.000" and form.labels[-1] == "E1 at 0.110"
        beta = [cubic.modulus(m, form.knots[COMPONENTS[m]]) for m in ORDER]
        law = HypoelasticLaw(np.ravel(beta), strain_range=RANGE, form=form)
        strain = np.linspace(-0.05, 0.2, 99)
        for modulus in ORDER:
            same = pytest.approx(cubic.modulus(modulus, strain), rel=1e-9)
            assert law.modulus(modulus, strain) == same


def test_two_knots_are_a_line_and_beyond_the_last_the_modulus_is_held() -> None:
    form = Spline.at([[0.0, 0.1], [0.0, 0.05, 0.1], [0.0, 0.1]])
    law = HypoelasticLaw(np.array([10.0, 20, 100, 150, 100, 300, 500]), form=form)
    assert law.E1([0.0, 0.05, 0.1, 0.7]) == pytest.approx([300, 400, 500, 500])
    assert law.E2([0.025, 0.05, 3.0]) == pytest.approx([137.5, 150, 100])
    assert law.G12([-0.05, -0.2]) == pytest.approx([15, 20])


def test_a_spline_that_is_positive_on_its_grid_hardly_dips_between() -> None:
    random = np.random.default_rng(5)
    form = form_named("spline", {"knots": 6}, RANGE)
    coarse = moduli_on_grid(form, RANGE)["E1"][:, -6:]
    fine = modulus_rows(form, "E1", np.linspace(0, RANGE[0], 2000), RANGE)[:, -6:]
    dips = []
    for values in random.uniform(-1, 3, (4000, 6)):
        on_grid = coarse @ values
        if on_grid.min() > 0:
            dips.append(-(fine @ values).min() / np.abs(fine @ values).max())
    assert len(dips) > 200 and max(dips) < 1.5 * (2 / PARTS) ** 2


# Names


BAD = [
    ("quartic", {}, "form"),
    ("cubics", {}, "form"),
    ("cubic", {"knots": 4}, "knots"),
    ("spline", {"breaks": {}}, "breaks"),
    ("spline", {}, "knots"),
    ("spline", {"knots": 1}, "knots"),
    ("spline", {"knots": True}, "knots"),
    ("spline", {"knots": 1000}, "knots"),
    ("spline", {"knots": 4.0}, "knots"),
    ("spline", {"knots": "many"}, "knots"),
    ("spline", {"knots": [0.01, 0.1]}, "knots"),
    ("spline", {"knots": [0.0, 0.05, 0.125]}, "knots"),  # beyond the end of the warp's range
    ("spline", {"knots": {"warp": 4, "fill": 4}}, "knots.shear"),
    ("spline", {"knots": {"warp": 4, "fill": 4, "shear": [0.0, 0.2]}}, "knots.shear"),
    ("spline", {"knots": {"warp": 4, "fill": 4, "weft": 4}}, "knots.weft"),
    ("spline", {"knots": {"warp": 4, "fill": [0.01, 0.1], "shear": 4}}, "knots.fill"),
    ("spline", {"knots": {"warp": 4, "fill": [0.0, 0.1, 0.1], "shear": 4}}, "knots.fill"),
    ("spline", {"knots": {"warp": 4, "fill": [0.0], "shear": 4}}, "knots.fill"),
    ("spline", {"knots": {"warp": 4, "fill": [0.0, float("nan")], "shear": 4}}, "knots.fill"),
    ("trilinear", {}, "breaks"),
    ("trilinear", {"breaks": [[0.1, 0.2]] * 3}, "breaks"),
    ("trilinear", {"breaks": {"warp": [0.1, 0.2], "fill": [0.2, 0.1]}}, "breaks.fill"),
]


@pytest.mark.parametrize(("name", "given_settings", "field"), BAD)
def test_bad_forms_are_named(name: str, given_settings: dict, field: str) -> None:
    with pytest.raises(InputError) as caught:
        form_named(name, given_settings, RANGE)
    assert caught.value.field == field and "\n" not in str(caught.value)


def test_a_number_of_knots_needs_a_range() -> None:
    with pytest.raises(InputError, match="strain range"):
        form_named("spline", {"knots": 4}, NO_RANGE)
    mixed = {"knots": {"warp": [0.0, 0.05, 0.11], "fill": 4, "shear": 2}}
    assert form_named("spline", mixed, RANGE).size == 9
    same = form_named("spline", {"knots": [0.0, 0.05, 0.1]}, NO_RANGE)
    assert same.knots == ((0.0, 0.05, 0.1),) * 3


def test_names_and_what_they_take() -> None:
    assert {*DEGREES, "trilinear", "spline"} <= set(form_names())
    assert form_settings("spline") == ("knots",) and form_settings("cubic") == ()
    with pytest.raises(InputError, match="did you mean 'quadratic'"):
        form_named("quadratics", {}, RANGE)
    assert form_named("cubic", {}, RANGE) == CUBIC != LINEAR


def test_an_entry_that_a_form_does_not_have_is_named() -> None:
    with pytest.raises(InputError, match=r"linear law has no beta_0, beta_1: expected 0") as caught:
        HypoelasticLaw(np.array([1.0, 2.0, *BETA[2:4]] + [0.0, 0.0, 1.0, 1.0] * 2), form=LINEAR)
    assert caught.value.field == "beta"
    with pytest.raises(InputError, match="expected 13 finite"):
        HypoelasticLaw(BETA, form=LAWS["spline"].form)
