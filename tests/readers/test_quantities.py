"""readers/quantities.py: which quantity a column holds, at machines and in image correlation."""

import pytest
from bubblefit.readers.quantities import columns_by_quantity, heading_of, means, nearest_to_strip


@pytest.mark.parametrize(
    ("name", "quantity", "yes"),
    [
        ("Load (N)", "load", 1), ("Load rate", "load", 0), ("Load cell", "load", 0),
        ("Zeit", "time", 1), ("Zeit (s)", "load", 0), ("Weg", "elongation", 1),
        ("Weg", "deflection", 1), ("Load", "elongation", 0), ("Specimen label", "specimen", 1),
        ("Specimen_ID", "specimen", 1), ("Specimen width", "specimen", 0), ("Preload", "load", 0),
        ("Überdruck [bar]", "pressure", 1), ("Pressure rate (bar/s)", "pressure", 0),
        ("Tensile strain (Extension)", "elongation", 0), ("Load Cell", "elongation", 0),
        ("Déplacement [mm]", "elongation", 1), ("Force [daN]", "load", 1),
        ("Vitesse de déplacement [mm/s]", "elongation", 0), ("Temps [s]", "time", 1),
    ],
)  # fmt: skip
def test_names_of_columns_mean_their_quantity(name, quantity, yes):
    assert means(name, quantity) is bool(yes)


def test_elongation_nearest_to_the_strip_is_chosen():
    names = ["Crosshead (mm)", "Extension (mm)", "Video gauge (mm)", "Stroke", "Wegaufnehmer"]
    french = ["Déplacement traverse [mm]", "Déplacement [mm]", "Extensomètre [mm]"]
    assert [nearest_to_strip(french, which) for which in ([0, 1, 2], [0, 1])] == [[2], [1]]
    for which, nearest in (([0, 1, 2, 3, 4], [2, 4]), ([0, 1, 3], [1]), ([0, 3], [0, 3]), ([], [])):
        assert nearest_to_strip(names, which) == nearest


@pytest.mark.parametrize(
    ("name", "unit", "quantity", "state"),
    [
        ("X", "", "x", ""), ("dx", "", "dx", ""), ("u", "", "dx", ""), ("uz", "", "dz", ""),
        ("x deformed", "", "x", "deformed"), ("x undeformed", "", "x", "reference"),
        ("Vx", "mm", "dx", ""), ("Vx", "", "", ""), ("Vx", "m/s", "", ""),
        ("displacement x", "", "dx", ""), ("Koordinate Y", "mm", "y", ""), ("x px", "", "x", ""),
        ("x", "kPa", "", ""), ("xy", "", "", ""), ("x y", "", "", ""), ("strain x", "", "", ""),
        ("sigma", "pixel", "sigma", ""), ("sigma x", "", "", ""), ("is valid", "", "valid", ""),
        ("rejected", "", "invalid", ""), ("X_inch", "", "x", ""),
    ],
)  # fmt: skip
def test_heading_has_quantity_and_state(name, unit, quantity, state):
    found = heading_of(name, unit)
    assert (found.name, found.quantity, found.state) == (name, quantity, state)


def test_units_of_headings_are_found():
    scales = {"mm": 1.0, "cm": 10.0, "m": 1e3, "µm": 1e-3, "um": 1e-3, "in": 25.4, "INCH": 25.4}
    scales |= {'"': 25.4, "mil": 0.0254, "Centimeters": 10.0, "micrometres": 1e-3}
    for unit, scale in scales.items():
        assert heading_of("x", unit).scale == scale
        assert heading_of(f"x [{unit}]", "mm").scale == scale  # the name's own comes first
    assert heading_of("x_inch").unit == "inch" and heading_of("x um").unit == "um"
    assert heading_of("x", "px").scale is heading_of("x").scale is None

    def best(*names: str, upper_is_length: bool = False, **named: str) -> dict[str, list[int]]:
        return columns_by_quantity([heading_of(name) for name in names], named, upper_is_length)

    assert best("X [px]", "X", "X [mm]") == {"x": [2]}
    assert best("X [px]", "X", "U") == {"x": [1], "dx": [2]}
    assert best("X [mm]", "x") == {"x": [1]}
    assert best("x", "X", upper_is_length=True) == {"x": [1]} and best(
        "x", upper_is_length=True
    ) == {"x": [0]}
    assert best("X", "Y1 mm", "X") == {"x": [0, 2]}
    assert best("a", "X", "a [mm]", x="a") == {"x": [0]}
    assert best("b [mm]", "X", x="b") == {"x": [0]} and best("X", x="q") == {"x": []}
    assert best("x deformed", "x undeformed") == {"x deformed": [0], "x": [1]}
