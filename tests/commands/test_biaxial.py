"""`bubblefit biaxial`: usual constants of the last cycles, and the options that choose them."""

import json
import shutil

import numpy as np
import pandas as pd
import pytest
from bubblefit.materials.designers import DesignersConstants
from bubblefit.reports.content import read_page_data

from ..builders.biaxial_tests import FIVE_RATIOS, biaxial_project, load_cycle, write_biaxial_rows
from ..support.commands import in_process, one_line, result_in

LAST = DesignersConstants(800.0, 640.0, 0.4, 0.5)


#: In its first cycle a fabric is softer.
FIRST = DesignersConstants(600.0, 400.0, 0.3, 0.45)


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """Three cycles a ratio, the first of other constants; each leaves 0.03 and 0.05 %."""
    place = tmp_path_factory.mktemp("constants")
    shares = {"1:1": (1, 1), "2:1": (1, 0.5), "1:2": (0.5, 1), "1:0": (1, 0), "0:1": (0, 1)}
    rows, kept = [], np.zeros(2)
    for ratio in FIVE_RATIOS:
        for number in range(3):
            prestress = np.array([2.0, 2.0])
            loads = prestress + np.outer(load_cycle() - 2.0, shares[ratio])
            loads = np.concatenate([loads, prestress[None]])
            constants = LAST if number else FIRST
            strain = 100 * (constants.strain(loads) - constants.strain(prestress[None])) + kept
            kept = kept + np.array([0.03, 0.05])
            strain[30:] = kept + (strain[30:] - strain[-1])
            own = (strain + 0.2).tolist()  # counted from somewhere before the prestress
            rows += [(ratio, *n, *e) for n, e in zip(loads.tolist(), own, strict=True)]
    write_biaxial_rows(place / "test.csv", rows)
    biaxial_project(place)
    return place


def test_usual_constants_are_those_of_the_last_cycles(folder, golden):
    golden("biaxial", in_process("biaxial", "project.toml", cwd=folder).stdout, folder)
    out = folder / "out" / f"{folder.name}-biaxial"
    first = result_in(out)["tests"]["biaxial"]["constants"][0]
    assert first["what"] == "chosen" and first["paths"] == 8
    assert first["E_warp_kN_per_m"] == pytest.approx(800, rel=1e-9)
    assert first["A_warp_fill_kN_per_m"] == pytest.approx(400, rel=1e-9)
    assert first["squares_percent2"] < 1e-15
    page = read_page_data(out)
    ((name, verdict),) = page.verdicts
    assert (name, verdict.state, list(page.warnings)) == ("", "usable", [])
    assert verdict.numbers == result_in(out)["tests"]["biaxial"]["verdict"]
    table = pd.read_csv(out / "constants.csv")
    assert list(table.what.fillna(""))[-2:] == ["first cycle", "last cycle"] and len(table) == 13
    assert table.E_fill_kN_per_m.iloc[-2] < 480
    kept = pd.read_csv(out / "kept.csv")
    np.testing.assert_allclose(kept.warp_after_percent, 0.09 * np.arange(1, 6), atol=1e-9)
    np.testing.assert_allclose(kept.fill_before_percent, 0.15 * np.arange(5), atol=1e-9)
    lines = pd.read_csv(out / "lines.csv")
    row = lines[lines.ratio == "2:1"].iloc[0]
    assert (row.cycle, row.cycles, row.readings) == (3, 3, 30)
    assert (row.from_kN_per_m, row.to_kN_per_m) == (2.0, 30.0)
    assert row.fill_load_change_kN_per_m == pytest.approx(14.0)
    wanted = 100 * LAST.strain([[28.0, 14.0]])[0]
    assert row.fill_strain_change_percent == pytest.approx(wanted[1])
    assert (out / "constants.png").is_file()
    # At 1:2 the warp does not strain: nothing over nothing is no stiffness.
    standard = pd.read_csv(out / "en-17117.csv").set_index("ratio")
    assert np.isnan(standard.loc["1:2", "warp_stiffness_kN_per_m"])
    assert standard.loc["1:2", "fill_stiffness_kN_per_m"] == pytest.approx(800.0)


def test_options_choose_evaluated_cycles(folder, tmp_path):
    def run(*options, code=0):
        out = tmp_path / "-".join(options).replace(":", "").replace("/", "")
        run = ("biaxial", "project.toml", *options, "--json", "--out", out)
        return in_process(*run, cwd=folder, code=code)

    def chosen(*options):
        told = json.loads(run(*options).stdout)["tests"]["biaxial"]
        return told["options"], told["constants"][0]

    words, row = chosen("--paths", "10", "--free")
    assert "free, with unloaded yarns" in words
    assert row["paths"] == 10 and row["reciprocal"] is False and row["unloaded_yarns"] is True
    words, row = chosen("--minimise", "load", "--ratio", "1:1", "--ratio", "2/1")
    assert words.startswith("least squares of loads, reciprocal") and "1:1 and 2:1 only" in words
    assert (row["minimise"], row["ratios"], row["paths"]) == ("load", "1:1 2:1", 4)
    one_line(run("--ratio", "3:1", code=2), "there is no ratio 3:1", "1:1, 2:1")
    one_line(run("--ratio", "1:1", code=2), "two that differ")
    one_line(run("--test", "none", code=2), "none")
    assert len(list(tmp_path.iterdir())) == 2


def test_ratios_of_several_tests_stand_under_their_names(folder, tmp_path):
    shutil.copy(folder / "test.csv", tmp_path)
    path = biaxial_project(tmp_path, 'name = "a"')
    second = '[[biaxial]]\nname = "b"\n[biaxial.data]\nfiles = ["test.csv"]\n'
    path.write_text(path.read_text() + second)
    in_process("biaxial", "project.toml", cwd=tmp_path)
    ratios = "1:1, 2:1, 1:2, 1:0, 0:1"
    page = read_page_data(tmp_path / "out" / f"{tmp_path.name}-biaxial")
    assert [tuple(fact) for fact in page.facts] == [("a: ratios", ratios), ("b: ratios", ratios)]
