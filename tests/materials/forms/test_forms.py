"""Forms of the moduli: pieces, increments, registry."""

from itertools import pairwise

import numpy as np
import pytest
from bubblefit.materials.forms.base import (
    COMPONENTS,
    ORDER,
    UNLIMITED,
    LawForm,
    form_named,
    form_names,
    form_settings,
    map_in_range,
    moduli_on_grid,
    pieces_of,
    ratio_map,
    ratios_of,
)
from bubblefit.materials.forms.polynomial import (
    CONSTANT,
    CUBIC,
    DEGREES,
    LINEAR,
    QUADRATIC,
    LoadRatio,
)
from bubblefit.materials.forms.ratio import SplineRatio
from bubblefit.materials.forms.spline import Spline
from bubblefit.materials.law import HypoelasticLaw
from bubblefit.materials.pieces import by_pieces, increment_modulus, point_modulus
from hypothesis import assume, example, given, settings
from hypothesis import strategies as st
from scipy.interpolate import CubicSpline

from ...builders.laws import TABLE_4_2
from ...support.refusals import complaint, refused

BETA = 1e3 * np.array(TABLE_4_2)
RANGE = [0.11, 0.12, 0.13]
KNOTS = [[0.0, 0.01, 0.04, 0.06, 0.11], [0.0, 0.06, 0.12], [0.0, 0.02, 0.05, 0.13, 0.2]]


def _degree(degree):
    beta = BETA.reshape(3, 4).copy()
    beta[:, : 3 - degree] = 0.0
    return beta.ravel()


OF_STRAIN = {
    "constant": HypoelasticLaw(_degree(0), 0.24, RANGE, form=CONSTANT),
    "linear": HypoelasticLaw(np.abs(_degree(1)), 0.24, RANGE, form=LINEAR),
    "quadratic": HypoelasticLaw(np.abs(_degree(2)), 0.24, RANGE, form=QUADRATIC),
    "cubic": HypoelasticLaw(BETA, 0.24, RANGE, form=CUBIC),
    "trilinear": HypoelasticLaw.trilinear(
        (800.0, 450.0, 900.0), (140.0, 110.0, 240.0), (20.0, 14.0, 40.0),
        [[0.01, 0.03], [0.02, 0.2], [0.01, 0.04]], 0.24, RANGE,
    ),
    "spline": HypoelasticLaw(
        np.array([20.0, 9.0, 8.0, 16.0, 30.0, 140.0, 120.0, 260.0, 800, 640, 350, 330, 500.0]),
        0.24, RANGE, form=Spline.at(KNOTS),
    ),
}  # fmt: skip


def turning_points(law: HypoelasticLaw, name: str) -> np.ndarray:
    ends = law.pieces[COMPONENTS[name], :, 0]
    return np.unique(np.concatenate([-ends, [0.0], ends]))


def integral(law: HypoelasticLaw, name: str, start: float, end: float) -> float:
    """Of the modulus, as a reader of the card takes it: Gauss between the turning points."""
    if end < start:
        return -integral(law, name, end, start)
    at, weight = np.polynomial.legendre.leggauss(4)
    inside = [x for x in turning_points(law, name) if start < x < end]
    points = np.array([start, *inside, end])
    width, middle = np.diff(points), 0.5 * (points[1:] + points[:-1])
    x = middle[:, None] + 0.5 * width[:, None] * at
    return float((0.5 * width[:, None] * weight * law.modulus(name, x)).sum())


def follow(law, path):
    stress = np.zeros((1, 3))
    for old, new in pairwise(path):
        stress, _ = law.increment(old, new, stress)
    return stress[0]


LAWS = {
    **OF_STRAIN,
    "load-ratio": HypoelasticLaw(
        np.array([20.0, 240.0, 90.0, 600.0, -150.0]), 0.24, RANGE, form=LoadRatio()
    ),
    "spline-ratio": HypoelasticLaw(
        np.array([*OF_STRAIN["spline"].beta, 40.0, -150.0]), 0.24, RANGE,
        form=SplineRatio.at(KNOTS),
    ),
}  # fmt: skip
FORMS = pytest.mark.parametrize("name", LAWS)
NO_RANGE = [UNLIMITED] * 3


@FORMS
def test_what_every_form_says_fits_together(name):
    form = LAWS[name].form
    assert isinstance(form, LawForm) and form.name == name and name in form_names()
    assert len(form.labels) == form.size and len(set(form.labels)) == form.size
    assert len(form.free) == len(form.modulus_of) and set(form.modulus_of) == set(ORDER)
    rows, uppers = form.piece_map(), form.uppers()
    assert rows.shape == (*uppers.shape, 4, form.size) and (uppers[:, -1] == UNLIMITED).all()
    assert (np.diff(uppers) >= 0).all()
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
def test_moduli_are_linear_in_the_entries(name, data):
    law = LAWS[name]
    modulus = data.draw(st.sampled_from(ORDER))
    strain = data.draw(st.lists(st.floats(-0.3, 0.3), min_size=1, max_size=9))
    rows = law.modulus_rows(modulus, strain)
    assert rows.shape == (len(strain), law.form.size)
    assert rows @ law.beta == pytest.approx(law.modulus(modulus, strain), rel=1e-9)
    assert law.modulus(modulus, np.array(strain)[:, None]).shape == (len(strain), 1)


@FORMS
@pytest.mark.parametrize("ends", [RANGE, [0.005, 0.06, 0.05], [0.03, 0.02, 0.01], NO_RANGE])
def test_pieces_end_where_the_range_does(name, ends):
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
def test_the_grid_sees_every_piece(name):
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
    asked = [1, 3, 3] if "ratio" in name else [1, 1, 1]
    assert [len(ratios_of(form, modulus)) for modulus in ORDER] == asked


@pytest.mark.parametrize("name", DEGREES)
def test_control_values_of_a_polynomial_are_moduli(name):
    law, n = LAWS[name], DEGREES.index(name) + 1
    share = 0.5 * (1 - np.cos((2 * np.arange(n) + 1) * np.pi / (2 * n)))
    values = [law.modulus(m, share * RANGE[COMPONENTS[m]]) for m in ORDER]
    free = list(law.form.free)
    assert law.form.from_values(RANGE) @ np.ravel(values) == pytest.approx(law.beta[free])


def test_a_spline_is_the_not_a_knot_spline_through_its_values():
    law, start = LAWS["spline"], 0
    for modulus in ORDER:
        knots, end = KNOTS[COMPONENTS[modulus]], RANGE[COMPONENTS[modulus]]
        values = law.beta[start : start + len(knots)]
        start += len(knots)
        strain = np.linspace(0, min(end, knots[-1]), 300)
        expected = CubicSpline(knots, values)(strain)
        assert law.modulus(modulus, strain) == pytest.approx(expected, rel=1e-11)
        inside = [knot for knot in knots if knot <= end]
        assert law.modulus(modulus, inside) == pytest.approx(values[: len(inside)], rel=1e-12)
    assert not law.jumps and LAWS["trilinear"].jumps


def test_from_four_knots_on_a_spline_contains_every_cubic():
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


def test_two_knots_are_a_line_and_beyond_the_last_the_modulus_is_held():
    form = Spline.at([[0.0, 0.1], [0.0, 0.05, 0.1], [0.0, 0.1]])
    law = HypoelasticLaw(np.array([10.0, 20, 100, 150, 100, 300, 500]), form=form)
    assert law.E1([0.0, 0.05, 0.1, 0.7]) == pytest.approx([300, 400, 500, 500])
    assert law.E2([0.025, 0.05, 3.0]) == pytest.approx([137.5, 150, 100])
    assert law.G12([-0.05, -0.2]) == pytest.approx([15, 20])


BAD = [
    ("quartic", {}, "form"), ("cubics", {}, "form"), ("cubic", {"knots": 4}, "knots"),
    ("spline", {"breaks": {}}, "breaks"), ("spline", {}, "knots"),
    # Too few, no number, too many; not from zero; beyond the end of the warp's range.
    *(("spline", {"knots": wrong}, "knots")
      for wrong in (1, True, 1000, 4.0, "many", [0.01, 0.1], [0.0, 0.05, 0.125])),
    ("spline", {"knots": {"warp": 4, "fill": 4}}, "knots.shear"),
    ("spline", {"knots": {"warp": 4, "fill": 4, "shear": [0.0, 0.2]}}, "knots.shear"),
    ("spline", {"knots": {"warp": 4, "fill": 4, "weft": 4}}, "knots.weft"),
    *(("spline", {"knots": {"warp": 4, "fill": wrong, "shear": 4}}, "knots.fill")
      for wrong in ([0.01, 0.1], [0.0, 0.1, 0.1], [0.0], [0.0, float("nan")])),
    ("trilinear", {}, "breaks"), ("trilinear", {"breaks": [[0.1, 0.2]] * 3}, "breaks"),
    ("trilinear", {"breaks": {"warp": [0.1, 0.2], "fill": [0.2, 0.1]}}, "breaks.shear"),
]  # fmt: skip


@pytest.mark.parametrize(("name", "given_settings", "field"), BAD)
def test_bad_forms_are_named(name, given_settings, field):
    assert refused(form_named, name, given_settings, RANGE).field == field


def test_a_number_of_knots_needs_a_range():
    assert "strain range" in complaint(form_named, "spline", {"knots": 4}, NO_RANGE)
    mixed = {"knots": {"warp": [0.0, 0.05, 0.11], "fill": 4, "shear": 2}}
    assert form_named("spline", mixed, RANGE).size == 9
    same = form_named("spline", {"knots": [0.0, 0.05, 0.1]}, NO_RANGE)
    assert same.knots == ((0.0, 0.05, 0.1),) * 3
    surplus = np.array([1.0, 2.0, *BETA[2:4]] + [0.0, 0.0, 1.0, 1.0] * 2)
    assert "beta_0, beta_1" in complaint(HypoelasticLaw, surplus, form=LINEAR)
    assert "expected 13" in complaint(HypoelasticLaw, BETA, form=LAWS["spline"].form)


EVERY_FORM = pytest.mark.parametrize("form", OF_STRAIN)
names = st.sampled_from(sorted(COMPONENTS))
forms = st.sampled_from(sorted(OF_STRAIN))
strains = st.floats(-0.2, 0.2)


def mean_of(form: str, name: str, x: float, x_old: float) -> tuple[float, float, float]:
    return increment_modulus(OF_STRAIN[form].pieces, COMPONENTS[name], x, x_old)


@settings(max_examples=200, deadline=None)
@given(forms, names, strains, strains)
@example("spline", "G12", 0.2, -0.2)
@example("trilinear", "E1", 0.03, 0.01)
def test_the_mean_is_the_integral_over_the_increment(form, name, x, x_old):
    law = OF_STRAIN[form]
    mean, ahead, behind = mean_of(form, name, x, x_old)
    assert mean == pytest.approx(mean_of(form, name, x_old, x)[0], rel=1e-14)
    assume(abs(x - x_old) > 1e-9)
    assert mean == pytest.approx(integral(law, name, x_old, x) / (x - x_old), rel=1e-9)
    # Whatever the path between the two ends is made of, the moduli there bound the mean.
    way = np.concatenate([np.linspace(x_old, x, 200), turning_points(law, name)])
    way = way[(way >= min(x, x_old)) & (way <= max(x, x_old))]
    moduli = law.modulus(name, way)
    room = 1e-3 * moduli.max()
    assert moduli.min() - room <= mean <= moduli.max() + room
    # d(stress)/d(strain) is the modulus at the end of the increment.
    assert mean + (x - x_old) * ahead == pytest.approx(float(law.modulus(name, x)), rel=1e-9)
    assume(x_old not in turning_points(law, name))  # there it may jump, and the way tells
    start = float(law.modulus(name, x_old))
    assert mean - (x - x_old) * behind == pytest.approx(start, rel=1e-9)


@settings(max_examples=200, deadline=None)
@given(forms, names, strains, strains)
def test_derivatives_against_finite_differences(form, name, x, x_old):
    law, step = OF_STRAIN[form], 1e-6
    assume(np.abs(np.subtract.outer([x, x_old], turning_points(law, name))).min() > 2 * step)
    assume(abs(x - x_old) > 1e-3)
    _, *slopes = mean_of(form, name, x, x_old)
    size = 1e-5 * float(law.pieces[COMPONENTS[name], 0, 4]) / abs(x - x_old)
    for slope, (by_new, by_old) in zip(slopes, ((step, 0.0), (0.0, step)), strict=True):
        ends = [mean_of(form, name, x + s * by_new, x_old + s * by_old)[0] for s in (1, -1)]
        assert slope == pytest.approx((ends[0] - ends[1]) / (2 * step), rel=1e-4, abs=size)


@settings(deadline=None)
@given(forms, names, strains, st.sampled_from([0.0, 1e-18, -1e-15, 1e-13, 1e-10, -1e-8, 1e-7]))
@example("spline", "G12", 0.015625, 1e-7)
def test_small_increments_lose_no_digits(form, name, x, change):
    law, component, step = OF_STRAIN[form], COMPONENTS[name], 1e-7
    assume(np.abs(x - turning_points(law, name)).min() > 1e-6)
    mean, *slopes = mean_of(form, name, x + change, x)
    gauss = x + change * (0.5 + np.array([-0.5, 0.5]) / np.sqrt(3))  # the mean of any cubic
    exact = np.mean([point_modulus(law.pieces, component, at) for at in gauss])
    assert mean == pytest.approx(exact, rel=1e-12)
    half = (law.modulus(name, x + step) - law.modulus(name, x - step)) / (4 * step)
    scale = 1e-9 * float(law.pieces[component, :, 4].max()) / step
    assert slopes == pytest.approx([half, half], rel=1e-4, abs=scale)


@settings(max_examples=200, deadline=None)
@given(forms, names, strains, strains)
@example("trilinear", "E1", 0.01, 0.01)
@example("trilinear", "E1", 0.01 + 1e-13, 0.01 - 1e-13)
@example("spline", "G12", 0.0, 0.0)
@example("cubic", "E2", 0.13, 0.13)
@example("cubic", "G12", -0.2, 0.15)
def test_rows_by_piece_are_the_derivatives_by_the_coefficients(form, name, x, x_old):
    law, component = OF_STRAIN[form], COMPONENTS[name]
    weights = np.full((law.pieces.shape[1], 4), np.nan)
    first, stop = by_pieces(law.pieces, component, x, x_old, weights)
    rows = map_in_range(law.form, law.strain_range)[component, first:stop]
    mean = mean_of(form, name, x, x_old)[0]
    assert weights[first:stop, 3].sum() == pytest.approx(1.0)
    by_beta = np.einsum("ki,kij->j", weights[first:stop], rows)
    assert by_beta @ law.beta == pytest.approx(mean, rel=1e-9)


@EVERY_FORM
@pytest.mark.parametrize("name", COMPONENTS)
def test_stress_is_continuous_where_a_piece_ends(form, name):
    law = OF_STRAIN[form]
    for at in turning_points(law, name):
        for old in (-0.17, 0.0, 0.005, 0.15):
            ends = (at - 1e-12, at, at + 1e-12)
            rises = [mean_of(form, name, x, old)[0] * (x - old) for x in ends]
            assert np.ptp(rises) < 3e-12 * law.modulus(name, np.linspace(0, 0.2, 99)).max()
    for bad in ((np.nan, 0.0), (0.0, np.nan), (np.nan, np.nan), (np.nan, 0.5)):
        assert np.isnan(mean_of(form, name, *bad)[0])


@EVERY_FORM
@pytest.mark.parametrize("steps", [1, 2, 7, 50])
@pytest.mark.parametrize("end", [0.005, 0.06, 0.11, 0.16])
def test_bars_are_exact_in_any_number_of_increments(form, steps, end):
    """Along warp, fill and in shear; E of the yarn across is held, because it gets shorter."""
    law, along = OF_STRAIN[form], np.linspace(0.0, end, steps + 1)
    warp, fill, shear = (integral(law, name, 0.0, end) for name in COMPONENTS)
    across = [-law.nu12 * integral(law, "E2", 0.0, x) / law.E1(0.0) for x in along]
    for path, stress in (
        ([along, -law.nu12 * along, 0 * along], [warp, 0, 0]),
        ([across, along, 0 * along], [0, fill, 0]),
        ([0 * along, 0 * along, -along], [0, 0, -shear]),
    ):
        assert follow(law, np.transpose(path)) == pytest.approx(stress, rel=1e-13, abs=1e-10)


@EVERY_FORM
def test_the_tangent_of_the_law_is_that_of_its_stress(form):
    law, step = OF_STRAIN[form], 1e-7
    random = np.random.default_rng(3)
    old, new = random.uniform(-0.15, 0.15, (2, 300, 3))
    near = [np.abs(np.subtract.outer(new[:, c], turning_points(law, n))).min(axis=1)
            for n, c in COMPONENTS.items()]  # fmt: skip
    keep = (np.array(near) > 1e-5).all(axis=0)
    assert keep.sum() > 200
    old, new, stress = old[keep], new[keep], random.standard_normal((300, 3))[keep]
    _, tangent = law.increment(old, new, stress)
    for j in range(3):
        shift = step * np.eye(3)[j]
        ahead, behind = (law.increment(old, new + s, stress)[0] for s in (shift, -shift))
        off = tangent[:, :, j] - (ahead - behind) / (2 * step)
        assert np.abs(off).max() < 1e-6 * np.abs(tangent).max()


ENDS = (0.1, 0.2, 0.5)


def test_ours_are_there_and_say_their_settings():
    ours = (*DEGREES, "load-ratio", "spline-ratio", "spline-crimp", "spline", "trilinear")
    assert form_names()[: len(ours)] == ours
    assert form_settings("cubic") == () and form_settings("spline") == ("knots",)
    assert form_settings("nothere") == ()
    assert form_named("cubic", {}, ENDS) == CUBIC != LINEAR
    assert "did you mean 'cubic'" in complaint(form_named, "cubik", {}, ENDS)
    assert "a cubic law has no knots" in complaint(form_named, "cubic", {"knots": 3}, ENDS)
