"""experiments/biaxial/evaluation_tables.py: tables, numbers and lines of an evaluated test."""

import json

import bubblefit as bf
import numpy as np
import pytest
from bubblefit.experiments.biaxial.evaluation import evaluate_test
from bubblefit.experiments.biaxial.evaluation_tables import (
    STANDARD,
    in_words,
    lines_of,
    numbers_of,
    standard_table,
    tables_of,
)
from bubblefit.materials.designers import Options
from bubblefit.materials.law import HypoelasticLaw

from ...builders.biaxial_tests import THICKNESS, biaxial_project, biaxial_rows, write_biaxial_rows

LINEAR = HypoelasticLaw.linear(1e5, 8e4, 3e3, 0.24)


@pytest.fixture(scope="module")
def evaluation(tmp_path_factory):
    folder = tmp_path_factory.mktemp("tables")
    write_biaxial_rows(folder / "test.csv", biaxial_rows(LINEAR, cycles=2, kept=0.01))
    return evaluate_test(bf.read_project(biaxial_project(folder)).tests["biaxial"])


@pytest.mark.parametrize(
    ("options", "words"),
    [
        (Options(), "least squares of strains, reciprocal, without unloaded yarns"),
        (
            Options(False, False, "load", ("1:1", "2:1")),
            "least squares of loads, free, without unloaded yarns, 1:1 and 2:1 only",
        ),
    ],
)
def test_options_are_described(options, words):
    assert in_words(options) == words


def test_standard_table_has_stiffness_of_loaded_and_poissons_ratio_of_unloaded_yarns(evaluation):
    table = standard_table(evaluation).set_index("ratio")
    assert list(table.index) == ["1:1", "2:1", "1:2", "1:0", "0:1", "all"]
    # Along one yarn alone the stiffness is its modulus times the thickness.
    assert table.warp_stiffness_kN_per_m["1:0"] == pytest.approx(1e5 * THICKNESS, rel=2e-3)
    assert table.fill_stiffness_kN_per_m["0:1"] == pytest.approx(8e4 * THICKNESS, rel=2e-3)
    assert np.isnan(table.fill_stiffness_kN_per_m["1:0"]) and np.isnan(table.warp_poisson["1:0"])
    assert table.fill_poisson["1:0"] == pytest.approx(0.24, rel=5e-3)
    assert table.warp_poisson["0:1"] == pytest.approx(0.24 * 0.8, rel=5e-3)
    # At equal loads both yarns are stiffer by what the other one takes.
    assert table.warp_stiffness_kN_per_m["1:1"] == pytest.approx(8e4 / (1 - 0.24), rel=5e-3)


def test_last_row_of_the_standard_table_has_the_constants_of_all_paths(evaluation):
    row = standard_table(evaluation).iloc[-1]
    c = evaluation.chosen.constants
    assert (row.ratio, row.load_cycles) == ("all", 10)
    assert (row.warp_stiffness_kN_per_m, row.fill_stiffness_kN_per_m) == (c.warp, c.fill)


def test_table_of_constants_has_a_row_for_each_choice(evaluation):
    tables = tables_of(evaluation)
    assert set(tables) == {"constants", STANDARD, "lines", "kept"}
    what = tables["constants"].what.tolist()
    assert what[0] == "chosen" and what[-2:] == ["first cycle", "last cycle"]
    assert len(what) == 3 + len(evaluation.alternatives)


def test_table_of_lines_has_the_change_of_loads_and_strains(evaluation):
    lines = tables_of(evaluation)["lines"].set_index("ratio")
    assert (lines.from_kN_per_m["1:0"], lines.to_kN_per_m["1:0"]) == pytest.approx((2.0, 30.0))
    strain = lines.warp_strain_change_percent["1:0"]
    assert strain == pytest.approx(100 * 28.0 / (1e5 * THICKNESS), rel=5e-3)


def test_numbers_are_written_as_json_without_nan(evaluation):
    numbers = numbers_of(evaluation)
    text = json.dumps(numbers, allow_nan=False)
    assert (
        json.loads(text)["options"]
        == "least squares of strains, reciprocal, without unloaded yarns"
    )
    assert set(numbers) >= {"constants", STANDARD, "lines", "kept", "spread", "notes", "convention"}


def test_lines_for_the_terminal_have_constants_and_their_spread(evaluation):
    c = evaluation.chosen.constants
    text = "\n".join(lines_of(evaluation))
    assert f"E warp {c.warp:.4g} kN/m, E fill {c.fill:.4g} kN/m" in text
    assert "strain paths of ratios 1:1, 2:1, 1:2, 1:0, 0:1" in text
    assert "direct form: A warp" in text and "first cycles: E warp" in text
    assert f"over {1 + len(evaluation.alternatives)} choices" in text
