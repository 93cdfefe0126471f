"""experiments/biaxial/tables.py: files of biaxial tests."""

import numpy as np
import pytest
from bubblefit.experiments.biaxial.tables import pair_over_load, read_biaxial_table

from ...builders.biaxial_tests import BENT_LAW, biaxial_rows, write_biaxial_rows
from ...support.refusals import complaint_with

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
    found = read_biaxial_table(path, width=100.0)
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


def one_yarn(folder, yarn, load, strain):
    """The table of a file with the readings along one yarn: kPa on 1 mm, and strains."""
    path = folder / f"{yarn}.csv"
    rows = [f"{e!r},{n!r}" for e, n in zip(strain.tolist(), load.tolist(), strict=True)]
    path.write_text("\n".join(["Strain,Stress", *rows]))
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


def test_directions_whose_load_falls_are_not_paired(tmp_path):
    load = np.array([0.0, 50, 100, 50, 0])
    warp = one_yarn(tmp_path, "warp", load, load)
    fill = one_yarn(tmp_path, "fill", np.arange(5.0), np.arange(5.0))
    complaint_with(["warp.csv", "the load falls", "one loading"], pair_over_load, warp, fill)
