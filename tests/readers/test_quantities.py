"""readers/quantities.py: which quantity a column holds."""

import pytest
from bubblefit.readers.quantities import means, nearest_to_strip


@pytest.mark.parametrize(
    ("name", "quantity", "yes"),
    [
        ("Load (N)", "load", 1), ("Load rate", "load", 0), ("Load cell", "load", 0),
        ("Zeit", "time", 1), ("Zeit (s)", "load", 0), ("Weg", "elongation", 1),
        ("Weg", "deflection", 1), ("Load", "elongation", 0), ("Specimen label", "specimen", 1),
        ("Specimen_ID", "specimen", 1), ("Specimen width", "specimen", 0), ("Preload", "load", 0),
        ("Überdruck [bar]", "pressure", 1), ("Pressure rate (bar/s)", "pressure", 0),
        ("Tensile strain (Extension)", "elongation", 0), ("Load Cell", "elongation", 0),
    ],
)  # fmt: skip
def test_names_of_columns_mean_their_quantity(name, quantity, yes):
    assert means(name, quantity) is bool(yes)


def test_elongation_nearest_to_the_strip_is_chosen():
    names = ["Crosshead (mm)", "Extension (mm)", "Video gauge (mm)", "Stroke", "Wegaufnehmer"]
    for which, nearest in (([0, 1, 2, 3, 4], [2, 4]), ([0, 1, 3], [1]), ([0, 3], [0, 3]), ([], [])):
        assert nearest_to_strip(names, which) == nearest
