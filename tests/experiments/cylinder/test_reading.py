"""experiments/cylinder/reading.py: the cylinder of a section, its units and defaults."""

import re

import numpy as np
import pytest
from bubblefit.errors import InputError
from bubblefit.meshes.cylinder_model import DEFAULTS
from bubblefit.project.project import read_project

from ...builders.bent_cylinders import write_cylinder_project
from ...builders.projects import replaced_once
from .cases import CYLINDER_EXAMPLE, TABLE_6_1, TABLES, cylinders_of_project


def test_example_is_table_6_1_with_tables_3_2_and_5_4():
    project = read_project(CYLINDER_EXAMPLE)
    wanted = [(d, p) for d, pressures in TABLE_6_1.items() for p in pressures]
    tests = list(project.tests.values())
    assert [(t.diameter, round(1e3 * t.pressure, 9)) for t in tests] == wanted
    assert list(project.tests) == [f"{d:g} mm, {p} kPa" for d, p in wanted]
    assert list(project.cards) == list(TABLES)
    for name, beta in TABLES.items():
        card = project.cards[name]
        np.testing.assert_allclose(card.card.law.beta, 1e3 * np.array(beta), rtol=1e-12)
        assert card.card.thickness == 0.81 and card.card.law.nu12 == 0.24
        assert card.test == name.split()[0]
    for test in tests:
        collar = (295.0, 147.0) if test.diameter == 250 else (240.0, 145.0)
        assert (test.collar.inner_diameter, test.collar.length) == collar
        assert (test.length, test.supports.span) == (3000.0, 2000.0)
        assert (
            len(test.deflections) == DEFAULTS.frames and test.deflections[-1] == DEFAULTS.deflection
        )
        assert list(test.reading.places.values()) == [40.0, 100.0, 240.0]
        assert test.reading.slope_over == 20.0
        assert test.measured == ()
    assert tests[2].name == "150 mm, 140 kPa"
    # Moduli stay above zero as far as each card says that it is valid.
    for card in project.cards.values():
        law = card.card.law
        for modulus, column in (("E1", 0), ("E2", 1), ("G12", 2)):
            assert law.modulus(modulus, np.linspace(0, law.strain_range[column], 500)).min() > 0


def test_reading_of_the_curve_follows_the_diameter(tmp_path):
    path = write_cylinder_project(tmp_path)
    usual = path.read_text().replace("places = [40, 100, 240]\nslope_over = 20\n", "")
    path.write_text(usual.replace("diameter = 150", "diameter = 200", 1))
    wide, narrow = cylinders_of_project(path)
    names = ["0.25 diameters", "0.5 diameters", "1 diameters"]
    assert wide.reading.places == dict(zip(names, (50.0, 100.0, 200.0), strict=True))
    assert narrow.reading.places == dict(zip(names, (37.5, 75.0, 150.0), strict=True))
    assert (wide.reading.slope_over, narrow.reading.slope_over) == (20.0, 15.0)
    assert wide.model().reading == wide.reading


def test_units_of_the_file_do_not_change_the_cylinder(tmp_path):
    path = write_cylinder_project(tmp_path)
    usual = cylinders_of_project(path)
    text = replaced_once(
        path.read_text(), ('modulus = "MPa"', 'modulus="MPa"\nlength="m"\npressure="bar"'),
        ("thickness = 0.81", "thickness = 0.81e-3"), ("size = 40.0", "size = 0.04"),
        ("= 90\n", "= 0.9\n"), ("= 140\n", "= 1.4\n"), ("[40, 100, 240]", "[0.04, 0.1, 0.24]"),
        ("slope_over = 20", "slope_over = 0.02"),
    )  # fmt: skip
    path.write_text(text.replace("diameter = 150", "diameter = 0.15"))
    for one, other in zip(usual, cylinders_of_project(path), strict=True):
        assert other.name == one.name
        for key in ("diameter", "pressure", "length", "size", "seam_width", "deflections"):
            assert getattr(other, key) == pytest.approx(getattr(one, key)), key
        assert other.reading.places == pytest.approx(one.reading.places)
        assert other.reading.slope_over == pytest.approx(one.reading.slope_over)
    assert read_project(path).cards["soft"].card.thickness == pytest.approx(0.81)


def test_cylinder_cannot_be_fitted(tmp_path):
    with pytest.raises(InputError, match="no test to be fitted"):
        read_project(write_cylinder_project(tmp_path)).chosen(None, fitted=True)


def test_example_without_optional_keys_has_the_defaults(tmp_path):
    """Without [defaults.cylinder], but for where curves are read, the cylinders are the same."""
    bare = re.sub(r"\[defaults.cylinder\].*?\n\n", "\n\n", CYLINDER_EXAMPLE.read_text(), flags=re.S)
    (tmp_path / "project.toml").write_text(bare)
    own = {"name", "place", "reading", "assumed"}
    for pair in zip(
        cylinders_of_project(CYLINDER_EXAMPLE),
        cylinders_of_project(tmp_path / "project.toml"),
        strict=True,
    ):
        said, left = ({k: v for k, v in vars(t).items() if k not in own} for t in pair)
        assert said == left
