"""materials/forms/base.py: what the forms of the moduli have in common, and their registry."""

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
    moduli_on_grid,
    pieces_of,
    ratio_map,
    ratios_of,
)
from bubblefit.materials.forms.polynomial import CUBIC, DEGREES, LINEAR
from bubblefit.materials.law import HypoelasticLaw
from hypothesis import given, settings
from hypothesis import strategies as st

from ...support.refusals import complaint, refused
from ..cases import FORMS, LAW_OF_FORM, NO_RANGE

FORM_RANGE = [0.11, 0.12, 0.13]


@FORMS
def test_form_has_consistent_layout_map_and_card(name):
    form = LAW_OF_FORM[name].form
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
    t = form.from_values(FORM_RANGE)
    assert t.shape == (len(form.free),) * 2 and np.linalg.cond(t) < 1e16
    assert form.describe().endswith(".") and "E1" in form.describe()
    again = form_named(name, form.to_card(), NO_RANGE)
    assert again == form and hash(again) == hash(form)


@FORMS
@settings(max_examples=30, deadline=None)
@given(data=st.data())
def test_moduli_are_linear_in_the_coefficients(name, data):
    law = LAW_OF_FORM[name]
    modulus = data.draw(st.sampled_from(ORDER))
    strain = data.draw(st.lists(st.floats(-0.3, 0.3), min_size=1, max_size=9))
    rows = law.modulus_rows(modulus, strain)
    assert rows.shape == (len(strain), law.form.size)
    assert rows @ law.beta == pytest.approx(law.modulus(modulus, strain), rel=1e-9)
    assert law.modulus(modulus, np.array(strain)[:, None]).shape == (len(strain), 1)


@FORMS
@pytest.mark.parametrize("ends", [FORM_RANGE, [0.005, 0.06, 0.05], [0.03, 0.02, 0.01], NO_RANGE])
def test_pieces_end_where_the_range_does(name, ends):
    form = LAW_OF_FORM[name].form
    pieces = pieces_of(form, LAW_OF_FORM[name].beta, ends)
    assert (pieces[:, -1, 0] == ends).all()
    uppers = form.uppers()
    for component, end in enumerate(ends):
        own = [upper for upper in uppers[component] if upper < end]
        reached = pieces[component, :, 0]
        assert (reached[: len(own)] == own).all() and (reached[len(own) :] == end).all()
        # Repeated, not made up: what follows the last piece is that piece.
        assert (pieces[component, len(own) :] == pieces[component, len(own)]).all()
    law = HypoelasticLaw(LAW_OF_FORM[name].beta, strain_range=ends, form=form)
    for modulus, component in COMPONENTS.items():
        assert law.modulus(modulus, 2 * ends[component]) == law.modulus(modulus, ends[component])


@FORMS
def test_grid_has_a_strain_in_each_piece(name):
    form = LAW_OF_FORM[name].form
    for component, end in enumerate(FORM_RANGE):
        grid = form.grid(component, end)
        assert grid[0] == 0 and grid[-1] == end and (np.diff(grid) > 0).all()
        inside = [upper for upper in form.uppers()[component] if upper < end]
        assert np.isin(inside, grid).all()
    rows = moduli_on_grid(form, FORM_RANGE)
    assert tuple(rows) == ORDER
    for modulus, part in rows.items():
        strain = form.grid(COMPONENTS[modulus], FORM_RANGE[COMPONENTS[modulus]])
        moduli = [LAW_OF_FORM[name].modulus(modulus, strain, r) for r in ratios_of(form, modulus)]
        assert part @ LAW_OF_FORM[name].beta == pytest.approx(np.concatenate(moduli))
    asked = [1, 3, 3] if "ratio" in name else [1, 1, 1]
    assert [len(ratios_of(form, modulus)) for modulus in ORDER] == asked


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
def test_bad_settings_of_a_form_name_their_field(name, given_settings, field):
    assert refused(form_named, name, given_settings, FORM_RANGE).field == field


ENDS = (0.1, 0.2, 0.5)


def test_registered_forms_and_their_settings_are_listed():
    ours = (*DEGREES, "load-ratio", "spline-ratio", "spline-crimp", "spline", "trilinear")
    assert form_names()[: len(ours)] == ours
    assert form_settings("cubic") == () and form_settings("spline") == ("knots",)
    assert form_settings("nothere") == ()
    assert form_named("cubic", {}, ENDS) == CUBIC != LINEAR
    assert "did you mean 'cubic'" in complaint(form_named, "cubik", {}, ENDS)
    assert "a cubic law has no knots" in complaint(form_named, "cubic", {"knots": 3}, ENDS)
