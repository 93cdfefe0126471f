"""Readings of bent cylinders and of biaxial specimens."""

from pathlib import Path

import numpy as np
import pytest
from bubblefit.experiments.biaxial.paths import evaluated_paths, find_cycles
from bubblefit.experiments.biaxial.ratios import USUAL_RATIOS, nearest_ratio, plain_ratio
from bubblefit.experiments.biaxial.tables import read_biaxial_table
from bubblefit.experiments.biaxial.test import BiaxialSection, TablesSection, read
from bubblefit.experiments.fabric import Fabric
from bubblefit.experiments.sections import Place
from bubblefit.materials.designers import shares
from bubblefit.readers.bending import BendingCurve, model_error, read_bending_curves, scatter
from bubblefit.readers.machine_tables import Channel
from hypothesis import given
from hypothesis import strategies as st

from ..builders.bent_cylinders import write_cylinder_readings
from ..builders.biaxial_tests import (
    BENT_LAW,
    FIVE_RATIOS,
    HEAD,
    biaxial_rows,
    load_cycle,
    write_biaxial_rows,
)
from ..support.refusals import complaint_with

KG = Channel("mass_kg", "kg")


def written(folder: Path, text: str) -> Path:
    path = folder / "test.csv"
    path.write_text(text)
    return path


def curve(deflection: list[float], load: list[float], name: str = "a") -> BendingCurve:
    return BendingCurve(name, np.array(deflection), np.array(load))


def test_repetitions_in_a_column_and_weights_in_kilograms(tmp_path):
    curves = read_bending_curves(write_cylinder_readings(tmp_path / "made-up.csv"), load=KG)
    assert [c.repetition for c in curves] == ["made-up 1", "made-up 2"]
    for c in curves:
        # What came after the largest deflection was unloading.
        assert len(c.load) == 7 and c.load[-1] == pytest.approx(30 * 9.80665)
        assert c.load == pytest.approx(3.5 * c.deflection)
    path = written(tmp_path, "wire (V);cell (V)\n0,5;0,1\n0,6;0,2\n0,75;0,35\n")
    (found,) = read_bending_curves(
        path, deflection=Channel("wire", "cm", 20.0, -10.0), load=Channel("cell", "kN", 2.0)
    )
    assert found.deflection == pytest.approx([0.0, 20.0, 50.0])
    assert found.load == pytest.approx([200.0, 400.0, 700.0])
    assert found.repetition == "test"
    (found,) = read_bending_curves(written(tmp_path, "Deflection [m],Load [kN]\n0,0\n0.1,0.3\n"))
    assert found.deflection == pytest.approx([0.0, 100.0])
    assert found.load == pytest.approx([0.0, 300.0])


@pytest.mark.parametrize(
    ("zero", "deflection"),
    [("none", [7.0, 17.0, 27.0, 37.0]), ("first", [0, 10, 20, 30]), ("line", [5, 15, 25, 35])],
)
def test_zero_of_the_deflection_and_what_hangs_on_the_beam(tmp_path, zero, deflection):
    """2 and 0.02 N/mm; the collar's 10 N are on the beam before the first reading."""
    for scale in (1.0, 0.01):
        readings = "".join(f"{7 + 10 * k},{scale * 20 * k}\n" for k in range(4))
        path = written(tmp_path, f"deflection (mm),load (N)\n{readings}")
        (found,) = read_bending_curves(path, preload=10.0 * scale, zero=zero)
        assert found.deflection == pytest.approx(deflection)
        assert found.load == pytest.approx(scale * np.array([10.0, 30.0, 50.0, 70.0]))


@pytest.mark.parametrize(
    ("text", "how", "words"),
    [
        ("deflection (mm),load (N)\n0,0\n1,x\n2,2\n", {}, ["line 3", "load", "expected a number"]),
        ("deflection (mm),mass_kg\n0,0\n1,1\n", {}, ["deflection", "load", "columns"]),
        ("deflection,load (N)\n0,0\n1,1\n", {}, ["line 1", "deflection", "say the unit"]),
        ("wire (V),load (N)\n0,0\n1,1\n", {"deflection": Channel("wire")}, ["'V'", "volts"]),
        ("deflection (mm),load (N)\n0,0\n1,1\n", {"load": Channel(unit="kg")}, ["'N'", "'kg'"]),
        ("deflection (mm),load (N),run\n0,0,a\n1,1,a\n0,0,b\n", {}, ["line 4", "'b'", "one read"]),
        ("deflection (mm),load (N)\n0,5\n1,4\n", {"zero": "line"}, ["line 2", "do not rise"]),
        ("deflection (mm),load (N)\n", {}, ["line 1", "no rows"]),
    ],
)
def test_mistakes_name_file_and_line(tmp_path, text, how, words):
    complaint_with(["test.csv", *words], read_bending_curves, written(tmp_path, text), **how)


def test_mean_and_scatter_of_repetitions_that_end_apart():
    found = scatter([curve([0, 10, 20], [0, 20, 40]), curve([0, 10], [0, 24], "b")], places=5)
    assert found.deflection == pytest.approx([0, 5, 10, 15, 20])
    assert found.mean == pytest.approx([0, 11, 22, 30, 40])
    assert found.deviation[:3] == pytest.approx([0, np.sqrt(2), np.sqrt(8)])
    assert np.isnan(found.deviation[3:]).all()
    assert found.count.tolist() == [2, 2, 2, 1, 1]
    # Two readings at one deflection count as their mean.
    found = scatter([curve([0, 10, 10, 20], [0, 10, 14, 20])], places=3)
    assert found.mean == pytest.approx([0, 12, 20])


def test_error_of_a_model_by_hand():
    readings = [curve([0, 10, 20, 60], [0, 20, 40, 100]), curve([0, 30], [0, 60], "b")]
    error = model_error(readings, [0.0, 40.0], [0.0, 100.0])  # 2.5 N/mm against 2
    assert error.rms == pytest.approx(np.sqrt(np.mean(np.array([0, 5, 10, 0, 15]) ** 2)))
    assert (error.mean, error.relative) == pytest.approx((6.0, error.rms / 60))
    assert (error.compared, error.beyond_count) == (5, 1)
    assert model_error(readings[:1], [70.0, 80.0], [0.0, 1.0]) is None
    for none in ([], [curve([0, 1], [0, 0])]):
        assert model_error(none, [0.0, 1.0], [0.0, 1.0]) is None


ROWS = biaxial_rows(BENT_LAW, cycles=3, kept=0.02)


@pytest.fixture
def table(tmp_path):
    return read_biaxial_table(write_biaxial_rows(tmp_path / "test.csv", ROWS))


def test_a_file_is_read_in_newtons_a_millimetre_and_shares(table):
    load = np.array([row[1:3] for row in ROWS])
    strain = np.array([row[3:] for row in ROWS])
    np.testing.assert_allclose(table.load, load, rtol=1e-14)
    np.testing.assert_allclose(table.strain, 0.01 * strain, rtol=1e-12, atol=1e-16)
    assert table.ratio == tuple(row[0] for row in ROWS)
    assert table.source.columns["warp load"] == "n_w, kN/m"
    assert table.source.units["fill strain"] == "%" and table.lines[0] == 2


@pytest.mark.parametrize(
    ("head", "load", "strain"),
    [
        ("ratio;Kraft Kette [N/m];Kraft Schuss [N/m];Dehnung Kette [‰];Dehnung Schuss [‰]",
         1e3, 10),
        ("Load ratio;F_warp (N/mm);F_weft (N/mm);Strain warp (mm/mm);Strain weft (mm/mm)", 1, 0.01),
        ("ratio;Stress x (N/cm);Stress y (N/cm);epsilon_x (%);epsilon_y (%)", 10, 1),
    ],
)  # fmt: skip  # fmt: skip
def test_other_names_and_units_mean_the_same(tmp_path, head, load, strain):
    path = tmp_path / "test.csv"
    lines = [head]
    for ratio, *numbers in ROWS[:30]:
        values = np.array(numbers) * [load, load, strain, strain]
        lines.append(";".join([ratio, *(f"{v:.12g}".replace(".", ",") for v in values)]))
    path.write_text("\n".join(lines) + "\n")
    found = read_biaxial_table(path)
    np.testing.assert_allclose(found.load, [row[1:3] for row in ROWS[:30]], rtol=1e-10)
    wanted = 0.01 * np.array([row[3:] for row in ROWS[:30]])
    np.testing.assert_allclose(found.strain, wanted, rtol=1e-9)


def test_forces_on_the_arms_of_a_cruciform(tmp_path):
    head = "ratio;Kraft Kette [kN];Kraft Schuss [kN];Dehnung Kette [%];Dehnung Schuss [%]\n"
    path = tmp_path / "arms.csv"
    path.write_text(head + "1:1;0;0;0;0\n1:1;1;0,5;0,5;1\n")
    complaint_with(["arms.csv", "Kraft Kette", "width"], read_biaxial_table, path)
    found = read_biaxial_table(path, width=100.0)
    np.testing.assert_allclose(found.load, [[0, 0], [10, 5]])
    path.write_text(head.replace("[kN]", "") + "1:1;0;0;0;0\n1:1;1000;500;0,5;1\n")
    found = read_biaxial_table(path, width=50.0, load_unit="N")
    np.testing.assert_allclose(found.load, [[0, 0], [20, 10]])


def test_what_a_file_does_not_say_has_to_be_said(tmp_path):
    bare = write_biaxial_rows(tmp_path / "bare.csv", ROWS[:5], "ratio,a,b,c,d")
    complaint_with(["bare.csv", "header row", "columns"], read_biaxial_table, bare)
    names = {"warp_load": "a", "fill_load": "b", "warp_strain": "c", "fill_strain": "d"}
    complaint_with(["load_unit"], read_biaxial_table, bare, columns=names)
    complaint_with(["strain_unit"], read_biaxial_table, bare, columns=names, load_unit="kN/m")
    found = read_biaxial_table(bare, columns=names, load_unit="N/m", strain_unit="‰")
    assert found.load[3, 0] == pytest.approx(1e-3 * ROWS[3][1])
    assert found.strain[3, 1] == pytest.approx(1e-3 * ROWS[3][4])
    complaint_with(["'warp'", "warp_load"], read_biaxial_table, bare, columns={"warp": "a"})
    said = write_biaxial_rows(tmp_path / "said.csv", ROWS[:5])
    complaint_with(["kN/m", "N/m"], read_biaxial_table, said, load_unit="N/m")
    wrong = write_biaxial_rows(tmp_path / "wrong.csv", [("12:30 h", *ROWS[0][1:])])
    complaint_with(["line 2", "'ratio'", "2:1", "12:30 h"], read_biaxial_table, wrong)


@pytest.mark.parametrize(
    ("plain", "names"),
    [
        ("2:1", ["2:1", "2/1", " 4 : 2 ", "1:0.5", "1:0,5", "30:15"]), ("0:1", ["0:3"]),
        ("1:0", ["2:0"]), ("1:1", ["5:5"]), ("1:0.37", ["1:0.37"]),
    ],
)  # fmt: skip
def test_ratios_have_one_name_each(plain, names):
    assert {plain_ratio(name) for name in names} == {plain}
    assert shares("1:2") == (0.5, 1.0) and shares("0:1") == (0.0, 1.0)
    for wrong in ("", "one to two", "0:0", "-1:2", "1:2:3"):
        complaint_with(["2:1"], plain_ratio, wrong)


@given(st.sampled_from(USUAL_RATIOS), st.floats(0.5, 500.0))
def test_loads_have_the_ratio_that_is_nearest(name, size):
    assert nearest_ratio([size * x for x in shares(name)]) == name
    # Loads between the ratios have their own numbers.
    assert nearest_ratio([30.0, 27.0]) == "1:1" and nearest_ratio([30.0, 24.7]) == "1:0.82"
    assert nearest_ratio([20.0, -0.1]) == "1:0" and nearest_ratio([0.5, 30.0]) == "0:1"


def test_cycles_are_told_apart_and_begin_and_end_where_the_loads_turn(table):
    cycles = find_cycles(table.load, table.ratio)
    expected = [(ratio, k + 1, n) for k, ratio in enumerate(FIVE_RATIOS) for n in (1, 2, 3)]
    assert [(c.ratio, c.phase, c.number) for c in cycles] == expected
    starts = len(load_cycle()) * np.arange(len(cycles))
    assert [(c.count - 1, c.first) for c in cycles] == list(enumerate(starts))
    assert [c.last for c in cycles] == list(starts + 29)
    # Without names they have the ratio of their loads, with a prestress kept on both yarns.
    cycles = find_cycles(np.maximum(table.load, 0.4))
    assert [(c.ratio, c.phase, c.number) for c in cycles] == expected
    hold = [np.full(20, 2.0), np.linspace(2, 30, 40), np.full(15, 30.0), np.linspace(30, 2, 40)]
    s = np.concatenate(hold * 2)
    s += 0.1 * np.random.default_rng(1).standard_normal(len(s))
    cycles = find_cycles(np.column_stack([s, s]))
    assert len(cycles) == 2
    for one in cycles:
        # The loading alone: not the holds at both ends, in which the fabric creeps.
        assert one.last - one.first <= 42
        assert s[one.first] < 2.6 and s[one.last] > 29.4
    assert find_cycles(np.full((10, 2), 3.0)) == []


def test_the_last_cycle_of_each_ratio_counts_unless_another_is_asked_for(table):
    cycles = [find_cycles(table.load, table.ratio)]
    last = evaluated_paths([table], cycles)
    assert [(p.ratio, p.cycle.number, p.cycles) for p in last] == [(r, 3, 3) for r in FIVE_RATIOS]
    first = evaluated_paths([table], cycles, 1)
    assert [p.cycle.number for p in first] == [1] * 5
    # The first three cycles are conditioning, and the only ones of 1:1.
    later = evaluated_paths([table], cycles, 1, conditioning=3)
    assert [p.ratio for p in later] == list(FIVE_RATIOS[1:])
    few = evaluated_paths([table], cycles, ratios=["1:2", "1:1"])
    assert [p.ratio for p in few] == ["1:1", "1:2"]
    asked = lambda *a, **k: evaluated_paths([table], cycles, *a, **k)  # noqa: E731
    complaint_with(["ratio 1:1", "3 cycles", "number 4"], asked, 4)
    complaint_with(["3:1", "the ratios there: 1:1, 2:1"], asked, ratios=["1:1", "3:1"])
    complaint_with(["any", "after the conditioning"], asked, conditioning=15)
    path = evaluated_paths([table], cycles)[1]
    assert path.ratio == "2:1" and len(path.load) == 30
    np.testing.assert_array_equal(path.since[0], [0.0, 0.0])
    np.testing.assert_allclose(path.since, path.strain - path.strain[0])
    # Five cycles of 0.02 % came before; 2:1 begins at another load along the fill.
    assert path.residual[0] == pytest.approx(path.strain[0, 0] - table.strain[0, 0])
    inside, thin = path.between(5.0, 20.0), path.thinned(7)
    assert inside.load.max() <= 20.0 and inside.load[0].max() >= 5.0
    assert len(path.between(2.0, 30.0).load) == 30
    complaint_with(["ratio 2:1", "2 to 30"], path.between, 40.0, 50.0)
    assert len(thin.load) == 7 and path.thinned(30) is path
    np.testing.assert_array_equal(thin.load[[0, -1]], path.load[[0, -1]])


def test_a_file_listed_for_a_ratio_is_of_that_ratio(tmp_path):
    path = write_biaxial_rows(tmp_path / "x.csv", biaxial_rows(BENT_LAW, ["1:2"], cycles=2))
    table = read_biaxial_table(path)
    cycles = find_cycles(table.load, ["2:1"] * len(table.load))
    assert [c.ratio for c in cycles] == ["2:1", "2:1"]
    flat = write_biaxial_rows(
        tmp_path / "flat.csv", [("1:1", 2.0, 2.0, 0.1 * k, 0.2) for k in range(5)], HEAD
    )
    place = Place(tmp_path / "project.toml", "biaxial[0]", Fabric("fabric", 0.8))
    section = BiaxialSection(data=TablesSection(files=[flat.name]))
    complaint_with(["flat.csv", "no loading"], read, section, place, "flat")
