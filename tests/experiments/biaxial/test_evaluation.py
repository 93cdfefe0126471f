"""experiments/biaxial/evaluation.py: constants of a test and their spread, as tables and lines."""

import json

import bubblefit as bf
import numpy as np
import pytest
from bubblefit.experiments.base import UNMATCHED
from bubblefit.experiments.biaxial.evaluation import (
    STANDARD,
    by_yarn,
    evaluate_test,
    in_words,
    lines_of,
    numbers_of,
    standard_table,
    tables_of,
)
from bubblefit.materials.designers import Options
from bubblefit.materials.law import HypoelasticLaw

from ...builders.biaxial_tests import (
    HEAD,
    THICKNESS,
    biaxial_project,
    biaxial_rows,
    write_biaxial_rows,
)
from ...support.refusals import complaint

#: So stiff that strains are small, and the constants those of linear elasticity.
LINEAR = HypoelasticLaw.linear(1e5, 8e4, 3e3, 0.24)
CONSTANTS = (1e5 * THICKNESS, 8e4 * THICKNESS, 0.24 * 8e4 / 1e5, 0.24)


@pytest.fixture(scope="module")
def biaxial_test(tmp_path_factory):
    folder = tmp_path_factory.mktemp("evaluated")
    write_biaxial_rows(folder / "test.csv", biaxial_rows(LINEAR, cycles=2, kept=0.01))
    return bf.read_project(biaxial_project(folder)).tests["biaxial"]


def test_constants_of_a_linear_law_are_recovered(biaxial_test):
    c = evaluate_test(biaxial_test).chosen.constants
    assert (c.warp, c.fill) == pytest.approx(CONSTANTS[:2], rel=2e-3)
    assert sorted((c.nu_warp, c.nu_fill)) == pytest.approx(sorted(CONSTANTS[2:]), rel=5e-3)


def test_options_hardly_change_the_constants_of_a_linear_law(biaxial_test):
    found = evaluate_test(biaxial_test)
    assert len(found.alternatives) > 5
    for low, high in found.spread.values():
        assert high / low == pytest.approx(1.0, abs=0.01)
    (note,) = found.notes
    assert note.kind == UNMATCHED and "shear stiffness" in note


def test_first_and_last_cycles_of_a_linear_law_are_equal(biaxial_test):
    found = evaluate_test(biaxial_test)
    first, last = found.first_cycle.constants, found.last_cycle.constants
    assert (first.warp, first.fill) == pytest.approx((last.warp, last.fill), rel=1e-6)


def test_residual_strain_grows_by_what_each_cycle_leaves(biaxial_test):
    table = evaluate_test(biaxial_test).residual_strains
    assert table.ratio.tolist() == ["1:1", "2:1", "1:2", "1:0", "0:1"]
    assert (table.cycles == 2).all()
    # Only 1:1 comes back to the loads of the first row, before it starts and after it.
    assert table.warp_before_percent[0] == 0.0
    assert np.isnan(table.warp_before_percent[1:]).all()


def test_ratio_that_was_not_tested_is_refused(biaxial_test):
    words = complaint(evaluate_test, biaxial_test, Options(ratios=("3:1",)))
    assert "there is no ratio 3:1; the test has: 1:1, 2:1, 1:2" in words


def test_pairs_become_columns_of_warp_and_fill():
    assert by_yarn(load=[1, 2], strain=np.array([0.5, np.nan]))["fill_load"] == 2.0
    assert list(by_yarn(load=[1, 2])) == ["warp_load", "fill_load"]


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


def test_rows_of_the_standard_go_by_file_also_where_names_are_alike(tmp_path):
    names = {"1:1": "a", "2:1": "b", "1:2": "c", "1:0": "d", "0:1": "e"}
    rows = biaxial_rows(LINEAR, cycles=1)
    files = {}
    for ratio, folder in names.items():
        (tmp_path / folder).mkdir()
        files[ratio] = [f"{folder}/test.csv"]
        of_ratio = [row[1:] for row in rows if row[0] == ratio]
        write_biaxial_rows(tmp_path / folder / "test.csv", of_ratio, HEAD.removeprefix("ratio,"))
    path = biaxial_project(tmp_path)
    text = path.read_text()
    assert 'files = ["test.csv"]' in text
    listed = ", ".join(f'"{ratio}" = {paths}' for ratio, paths in files.items())
    path.write_text(text.replace('files = ["test.csv"]', f"files = {{ {listed} }}"))
    table = standard_table(evaluate_test(bf.read_project(path).tests["biaxial"]))
    for row in table.to_dict("records")[:-1]:
        warp, fill = map(float, row["ratio"].split(":"))
        assert row["warp_to_kN_per_m"] * fill == pytest.approx(row["fill_to_kN_per_m"] * warp)
