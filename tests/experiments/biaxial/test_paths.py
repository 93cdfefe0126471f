"""experiments/biaxial/paths.py: load ratios and cycles, and files of biaxial tests."""

from dataclasses import replace

import numpy as np
import pytest
from bubblefit.experiments.biaxial.paths import (
    USUAL_RATIOS,
    canonical_ratio,
    evaluated_paths,
    find_cycles,
    nearest_ratio,
    pair_over_load,
    read_biaxial_table,
)
from bubblefit.materials.designers import shares
from hypothesis import given
from hypothesis import strategies as st

from ...builders.biaxial_tests import (
    BENT_LAW,
    FIVE_RATIOS,
    biaxial_rows,
    load_cycle,
    write_biaxial_rows,
)
from ...support.refusals import complaint_with


@pytest.mark.parametrize(
    ("plain", "names"),
    [
        ("2:1", ["2:1", "2/1", " 4 : 2 ", "1:0.5", "1:0,5", "30:15"]), ("0:1", ["0:3"]),
        ("1:0", ["2:0"]), ("1:1", ["5:5"]), ("1:0.37", ["1:0.37"]),
    ],
)  # fmt: skip
def test_load_ratios_have_one_name(plain, names):
    assert {canonical_ratio(name) for name in names} == {plain}
    assert shares("1:2") == (0.5, 1.0) and shares("0:1") == (0.0, 1.0)
    for wrong in ("", "one to two", "0:0", "-1:2", "1:2:3"):
        complaint_with(["2:1"], canonical_ratio, wrong)


@given(st.sampled_from(USUAL_RATIOS), st.floats(0.5, 500.0))
def test_loads_have_the_nearest_ratio(name, size):
    assert nearest_ratio([size * x for x in shares(name)]) == name
    # Loads between the ratios have their own numbers.
    assert nearest_ratio([30.0, 27.0]) == "1:1" and nearest_ratio([30.0, 24.7]) == "1:0.82"
    assert nearest_ratio([20.0, -0.1]) == "1:0" and nearest_ratio([0.5, 30.0]) == "0:1"


def test_cycles_begin_and_end_where_loads_turn(biaxial_table):
    cycles = find_cycles(biaxial_table.load, biaxial_table.ratio)
    expected = [(ratio, k + 1, n) for k, ratio in enumerate(FIVE_RATIOS) for n in (1, 2, 3)]
    assert [(c.ratio, c.phase, c.number) for c in cycles] == expected
    starts = len(load_cycle()) * np.arange(len(cycles))
    assert [(c.number_in_file - 1, c.first) for c in cycles] == list(enumerate(starts))
    assert [c.last for c in cycles] == list(starts + 29)
    # Without names they have the ratio of their loads, with a prestress kept on both yarns.
    cycles = find_cycles(np.maximum(biaxial_table.load, 0.4))
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


def test_last_cycle_of_a_ratio_counts_by_default(biaxial_table):
    cycles = [find_cycles(biaxial_table.load, biaxial_table.ratio)]
    last = evaluated_paths([biaxial_table], cycles)
    assert [(p.ratio, p.cycle.number, p.cycle_count) for p in last] == [
        (r, 3, 3) for r in FIVE_RATIOS
    ]
    first = evaluated_paths([biaxial_table], cycles, 1)
    assert [p.cycle.number for p in first] == [1] * 5
    # The first three cycles are conditioning, and the only ones of 1:1.
    later = evaluated_paths([biaxial_table], cycles, 1, conditioning=3)
    assert [p.ratio for p in later] == list(FIVE_RATIOS[1:])
    few = evaluated_paths([biaxial_table], cycles, ratios=["1:2", "1:1"])
    assert [p.ratio for p in few] == ["1:1", "1:2"]
    asked = lambda *a, **k: evaluated_paths([biaxial_table], cycles, *a, **k)  # noqa: E731
    complaint_with(["ratio 1:1", "3 cycles", "number 4"], asked, 4)
    complaint_with(["3:1", "the ratios there: 1:1, 2:1"], asked, ratios=["1:1", "3:1"])
    complaint_with(["any", "after the conditioning"], asked, conditioning=15)
    path = evaluated_paths([biaxial_table], cycles)[1]
    assert path.ratio == "2:1" and len(path.load) == 30
    np.testing.assert_array_equal(path.strain_change[0], [0.0, 0.0])
    np.testing.assert_allclose(path.strain_change, path.strain - path.strain[0])
    # Five cycles of 0.02 % came before; 2:1 begins at another load along the fill.
    assert path.residual[0] == pytest.approx(path.strain[0, 0] - biaxial_table.strain[0, 0])
    for of_ratio in last:
        expected = of_ratio.strain[0] - biaxial_table.strain[0]
        np.testing.assert_allclose(of_ratio.residual, expected, atol=1e-12)
    inside, thin = path.between(5.0, 20.0), path.thinned(7)
    assert inside.load.max() <= 20.0 and inside.load[0].max() >= 5.0
    assert len(path.between(2.0, 30.0).load) == 30
    complaint_with(["ratio 2:1", "2 to 30"], path.between, 40.0, 50.0)
    assert len(thin.load) == 7 and path.thinned(30) is path
    np.testing.assert_array_equal(thin.load[[0, -1]], path.load[[0, -1]])


ROWS = biaxial_rows(BENT_LAW, cycles=3, kept=0.02)


def test_biaxial_file_is_read_in_newtons_per_millimetre(biaxial_table):
    load = np.array([row[1:3] for row in ROWS])
    strain = np.array([row[3:] for row in ROWS])
    np.testing.assert_allclose(biaxial_table.load, load, rtol=1e-14)
    np.testing.assert_allclose(biaxial_table.strain, 0.01 * strain, rtol=1e-12, atol=1e-16)
    assert biaxial_table.ratio == tuple(row[0] for row in ROWS)
    assert biaxial_table.source.columns["warp load"] == "n_w, kN/m"
    assert biaxial_table.source.units["fill strain"] == "%" and biaxial_table.lines[0] == 2


@pytest.mark.parametrize(
    ("head", "load", "strain"),
    [
        ("ratio;Kraft Kette [N/m];Kraft Schuss [N/m];Dehnung Kette [‰];Dehnung Schuss [‰]",
         1e3, 10),
        ("Load ratio;F_warp (N/mm);F_weft (N/mm);Strain warp (mm/mm);Strain weft (mm/mm)", 1, 0.01),
        ("ratio;Stress x (N/cm);Stress y (N/cm);epsilon_x (%);epsilon_y (%)", 10, 1),
        ("Verhältnis;Nx [kN/m];Ny [kN/m];exx [%];eyy [%]", 1, 1),
        ("ratio;σx (N/mm);σy (N/mm);εx (%);εy (%)", 1, 1),
    ],
)  # fmt: skip  # fmt: skip
def test_biaxial_columns_of_other_names_and_units(tmp_path, head, load, strain):
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
    found = read_biaxial_table(path=path, width=100.0)
    np.testing.assert_allclose(found.load, [[0, 0], [10, 5]])
    path.write_text(head.replace("[kN]", "") + "1:1;0;0;0;0\n1:1;1000;500;0,5;1\n")
    found = read_biaxial_table(path, width=50.0, load_unit="N")
    np.testing.assert_allclose(found.load, [[0, 0], [20, 10]])


def test_missing_units_and_ratios_of_a_biaxial_file_are_asked_for(tmp_path):
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


def one_yarn(folder, yarn, load, strain, time=None):
    """The table of a file with the readings along one yarn: kPa on 1 mm, and strains."""
    path = folder / f"{yarn}.csv"
    heading = "Strain,Stress"
    columns = [strain, load]
    if time is not None:
        heading += ",Time (s)"
        columns.append(time)
    rows = [",".join(map(repr, row)) for row in np.column_stack(columns).tolist()]
    path.write_text("\n".join([heading, *rows]))
    columns = {f"{yarn}_load": "Stress", f"{yarn}_strain": "Strain"}
    options = {"columns": columns, "load_unit": "N/m", "strain_unit": "mm/mm", "yarns": [yarn]}
    return read_biaxial_table(path, **options)


def test_directions_sampled_at_other_points_are_paired_over_the_load(tmp_path):
    """Strains 0.2 (n / 100)^(1/2) and 0.1 (n / 50)^(1/2) at loads n in the ratio 2:1."""
    loads = np.linspace(5.0, 100.0, 9), np.linspace(1.0, 50.0, 200)
    warp = one_yarn(tmp_path, "warp", loads[0], 0.2 * np.sqrt(loads[0] / 100))
    fill = one_yarn(tmp_path, "fill", loads[1], 0.1 * np.sqrt(loads[1] / 50))
    both = pair_over_load(warp, fill)
    np.testing.assert_allclose(both.load, 1e-3 * np.column_stack([loads[0], loads[0] / 2]))
    strain = np.sqrt(loads[0] / 100)[:, None] * [0.2, 0.1]
    np.testing.assert_allclose(both.strain, strain, rtol=1e-3)
    assert both.partner is fill and "paired with fill.csv" in both.source.notes[-1]
    # Readings below the first of the other direction have no partner.
    late = one_yarn(tmp_path, "fill", loads[1][100:], 0.1 * np.sqrt(loads[1][100:] / 50))
    assert len(pair_over_load(warp, late).load) == 5


@pytest.mark.parametrize("loaded", ["warp", "fill"])
def test_direction_without_load_is_paired_over_the_time(tmp_path, loaded):
    times = {"warp": np.linspace(0.0, 20.0, 21), "fill": np.linspace(0.5, 22.0, 44)}
    noise = np.random.default_rng(3)
    tables = {}
    for yarn, time in times.items():
        load = 5.0 * time if yarn == loaded else noise.normal(0.1, 0.05, len(time))
        strain = (1e-3 if yarn == loaded else -4e-4) * time
        tables[yarn] = one_yarn(tmp_path, yarn, load, strain, time)
    both = pair_over_load(**tables)
    share = np.array([1e-3, -4e-4] if loaded == "warp" else [-4e-4, 1e-3])
    np.testing.assert_allclose(both.strain, times["warp"][1:, None] * share)
    assert find_cycles(both.load)[0].ratio == ("1:0" if loaded == "warp" else "0:1")
    assert "at equal times" in both.source.notes[-1]
    later = replace(tables["fill"], time=tables["fill"].time + 100.0)
    complaint_with(["fill.csv", "time", "warp.csv"], pair_over_load, tables["warp"], later)
    tables["warp"] = replace(tables["warp"], time=None)
    unloaded = {"warp": "fill.csv", "fill": "warp.csv"}[loaded]
    complaint_with([unloaded, "carries no load", "column of time"], pair_over_load, **tables)


def test_directions_whose_load_falls_are_not_paired(tmp_path):
    load = np.array([0.0, 50, 100, 50, 0])
    warp = one_yarn(tmp_path, "warp", load, load)
    fill = one_yarn(tmp_path, "fill", np.arange(5.0), np.arange(5.0))
    complaint_with(["warp.csv", "the load falls", "one loading"], pair_over_load, warp, fill)
