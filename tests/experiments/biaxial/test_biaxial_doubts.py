"""Traps made from good biaxial paths are named; good ones raise no doubt."""

import bubblefit as bf
import numpy as np
import pytest
from bubblefit.experiments.biaxial.doubts import doubts_of_biaxial
from bubblefit.experiments.kinds import Expected

from ...biaxial_files import BENT, biaxial_project, rows_of, write_rows

EXPECTED = Expected({"E1": (300.0, 3000.0), "E2": (200.0, 3000.0), "G12": (1.0, 300.0)})
ROWS = rows_of(BENT)


def scaled(load=1.0, strain=1.0):
    return [(r, load * a, load * b, strain * c, strain * d) for r, a, b, c, d in ROWS]


#: Rows, and of each trap that they fall into whether it stops a fit and a word of it.
TRAPS = {
    "shares for percent": (
        scaled(strain=0.01), {"strain-unit": (True, "in the unit that is said")},
    ),
    "percent times a hundred": (scaled(strain=100), {"strain-unit": (True, "changes by")}),
    "newtons a metre": (scaled(load=1e3), {"load-unit": (True, "per width")}),
    "loads of a fiftieth": (scaled(load=0.02), {"modulus": (True, "is the thickness right")}),
    "yarns of the loads swapped": (
        [(r, b, a, c, d) for r, a, b, c, d in ROWS], {"ratio": (True, "columns of warp and fill")},
    ),
    "another ratio": (
        [("3:1" if r == "2:1" else r, *rest) for r, *rest in ROWS],
        {"ratio": (False, "which is 2:1")},
    ),
    "yarns of the strains swapped": (
        [(r, a, b, d, c) for r, a, b, c, d in ROWS], {"swapped": (True, "stretches more")},
    ),
}  # fmt: skip


def doubts(folder, rows):
    write_rows(folder / "test.csv", rows)
    (test,) = bf.read_project(biaxial_project(folder)).tests.values()
    return {doubt.name: doubt for doubt in doubts_of_biaxial(test, EXPECTED)}


@pytest.mark.parametrize("trap", TRAPS)
def test_traps_are_named(tmp_path, trap):
    rows, wanted = TRAPS[trap]
    found = doubts(tmp_path, rows)
    for name, (sure, words) in wanted.items():
        assert found[name].sure == sure and words in found[name].text, found
    if trap in ("another ratio", "yarns of the strains swapped"):
        assert set(found) == set(wanted)


def test_good_data_raise_no_doubt(tmp_path):
    assert doubts(tmp_path, ROWS) == {}
    noise = 0.005 * np.random.default_rng(3).standard_normal((len(ROWS), 4))
    rows = [(r, *(np.array(rest) + n)) for (r, *rest), n in zip(ROWS, noise, strict=True)]
    assert doubts(tmp_path, rows) == {}
