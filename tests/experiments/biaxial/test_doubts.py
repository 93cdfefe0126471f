"""experiments/biaxial/doubts.py: mistakes in tables of biaxial tests are doubted."""

import bubblefit as bf
import numpy as np
import pytest
from bubblefit.experiments.biaxial.prepared import PreparedBiaxial
from bubblefit.experiments.doubts import Expected

from ...builders.biaxial_tests import (
    BENT_LAW,
    THICKNESS,
    biaxial_project,
    biaxial_rows,
    write_biaxial_rows,
)

EXPECTED = Expected({"E1": (300.0, 3000.0), "E2": (200.0, 3000.0), "G12": (1.0, 300.0)})
ROWS = biaxial_rows(BENT_LAW)


def scaled(load=1.0, strain=1.0):
    return [(r, load * a, load * b, strain * c, strain * d) for r, a, b, c, d in ROWS]


#: Rows, and of each trap that they fall into whether it stops a fit and a word of it.
TRAPS = {
    "shares for percent": (scaled(strain=0.01), {"strain-unit": (True, "in the unit")}),
    "percent times a hundred": (scaled(strain=100), {"strain-unit": (True, "changes by")}),
    "newtons a metre": (scaled(load=1e3), {"load-unit": (True, "per width")}),
    "loads of a fiftieth": (scaled(load=0.02), {"modulus": (True, "is the thickness right")}),
    "yarns of the loads swapped": (
        [(r, b, a, c, d) for r, a, b, c, d in ROWS], {"ratio": (True, "columns")},
    ),
    "another ratio": (
        [("3:1" if r == "2:1" else r, *rest) for r, *rest in ROWS],
        {"ratio": (False, "which is 2:1")},
    ),
    "yarns of the strains swapped": (
        [(r, a, b, d, c) for r, a, b, c, d in ROWS], {"swapped": (True, "stretches more")},
    ),
}  # fmt: skip


def doubts_of_table(folder, rows):
    write_biaxial_rows(folder / "test.csv", rows)
    (test,) = bf.read_project(biaxial_project(folder)).tests.values()
    return {doubt.name: doubt for doubt in PreparedBiaxial(test).doubts(EXPECTED)}


@pytest.mark.parametrize("trap", TRAPS)
def test_mistakes_in_a_biaxial_table_are_doubted(tmp_path, trap):
    rows, wanted = TRAPS[trap]
    found = doubts_of_table(tmp_path, rows)
    for name, (sure, words) in wanted.items():
        assert found[name].sure == sure and words in found[name].text, found
    if trap == "loads of a fiftieth":
        (_, first, _, low, _), (_, last, _, high, _) = rows[0], rows[29]
        modulus = (last - first) / (0.01 * (high - low)) / THICKNESS
        assert f"is about {modulus:.3g} MPa" in found["modulus"].text
    if trap in ("another ratio", "yarns of the strains swapped"):
        assert set(found) == set(wanted)


def test_good_biaxial_data_raise_no_doubt(tmp_path):
    assert doubts_of_table(tmp_path, ROWS) == {}
    noise = 0.005 * np.random.default_rng(3).standard_normal((len(ROWS), 4))
    rows = [(r, *(np.array(rest) + n)) for (r, *rest), n in zip(ROWS, noise, strict=True)]
    assert doubts_of_table(tmp_path, rows) == {}
