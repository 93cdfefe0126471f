"""Biaxial tests as laboratories have them: one ratio, slits, copies of files; each with its source.

- Slits and the share of the load that reaches the gauge field: Bridgens & Gosling (2003), and the
  guidance of EN 17117-1 on cruciforms: the arms carry a part of the load.
- Exchanged channels: questions on extensometers of biaxial rigs in forums of test houses.
"""

import re

import bubblefit as bf
import numpy as np
import pytest
from bubblefit.errors import InputError
from bubblefit.materials.law import HypoelasticLaw
from bubblefit.meshes.strip_models import straight_strip
from bubblefit.solvers.membrane.solver import MembraneSolver

from ..builders.biaxial_tests import (
    THICKNESS,
    biaxial_project,
    biaxial_rows,
    write_biaxial_rows,
)

E1, E2 = 900.0, 600.0
LAW = HypoelasticLaw([0, 0, 0, 30.0, 0, 0, 0, E2, 0, 0, 0, E1], 0.24, [0.07, 0.07, 0.1])
STIFFER_WARP = "E1 = [300, 3000]\nE2 = [100, 3000]\nG12 = [1, 300]"


def project_of(folder, rows, test="", form="constant"):
    write_biaxial_rows(folder / "test.csv", rows)
    path = biaxial_project(folder, test, form=form)
    text = path.read_text().replace(
        "E1 = [100, 3000]\nE2 = [100, 3000]\nG12 = [1, 300]", STIFFER_WARP
    )
    path.write_text(text.replace("starts = 1", 'starts = 1\nstarts_from = "estimate"'))
    return bf.read_project(path)


def findings(project):
    return {name: text for _, name, text in bf.check(project).findings["biaxial"] if name}


def test_exchanged_strains_of_equal_loads_alone_are_doubted(tmp_path):
    rows = [(r, a, b, d, c) for r, a, b, c, d in biaxial_rows(LAW, ["1:1"])]
    found = findings(project_of(tmp_path, rows))
    assert "in 1:1 the warp is strained" in found["swapped"]


def test_equal_loads_of_a_stiffer_warp_are_not_doubted(tmp_path):
    assert findings(project_of(tmp_path, biaxial_rows(LAW, ["1:1"]))) == {}


def test_exchanged_directions_of_mirrored_ratios_are_doubted(tmp_path):
    names = {"2:1": "1:2", "1:2": "2:1"}
    rows = [(names[r], b, a, d, c) for r, a, b, c, d in biaxial_rows(LAW, ["2:1", "1:2"])]
    assert "in 2:1 the warp is strained" in findings(project_of(tmp_path, rows))["swapped"]


def with_share(rows, share):
    return [(r, a / share, b / share, c, d) for r, a, b, c, d in rows]


def test_share_of_the_load_that_reaches_the_field_is_taken_into_account(tmp_path):
    rows = with_share(biaxial_rows(LAW, ["1:1", "2:1", "1:2"]), 0.85)
    fit = bf.fit(project_of(tmp_path, rows))
    assert fit.modulus("E1", 0.01).value == pytest.approx(E1 / 0.85, rel=1e-3)
    fit = bf.fit(project_of(tmp_path, rows, "load_share = 0.85"))
    assert fit.modulus("E1", 0.01).value == pytest.approx(E1, rel=1e-4)
    assert fit.modulus("E2", 0.01).value == pytest.approx(E2, rel=1e-4)


def test_share_of_each_direction_is_taken_into_account(tmp_path):
    rows = [(r, a / 0.9, b / 0.8, c, d) for r, a, b, c, d in biaxial_rows(LAW, ["1:1", "2:1"])]
    fit = bf.fit(project_of(tmp_path, rows, "load_share = [0.9, 0.8]"))
    assert fit.modulus("E2", 0.01).value == pytest.approx(E2, rel=1e-4)


def test_uncertain_share_widens_the_bands_by_as_much(tmp_path):
    noise = 0.01 * np.random.default_rng(1).standard_normal((400, 2))
    rows = with_share(biaxial_rows(LAW, ["1:1", "2:1", "1:2"]), 0.85)
    rows = [(r, a, b, c + u, d + v) for (r, a, b, c, d), (u, v) in zip(rows, noise, strict=False)]
    # Constant moduli would tell the share, by the geometry of 4 % of strain.
    test = "load_share = 0.85"
    sure = bf.fit(project_of(tmp_path, rows, test, "quadratic")).modulus("E1", 0.02)
    test = "load_share = 0.85\nload_share_deviation = 0.05"
    unsure = bf.fit(project_of(tmp_path, rows, test, "quadratic")).modulus("E1", 0.02)
    assert unsure.value == pytest.approx(sure.value, rel=0.01)
    widths = np.array([band.upper - band.lower for band in (unsure, sure)])
    added = np.sqrt(widths[0] ** 2 - widths[1] ** 2) / (4 * E1)
    assert added == pytest.approx(0.05 / 0.85, rel=0.15)


def test_check_asks_for_the_share_where_it_is_not_given(tmp_path):
    rows = biaxial_rows(LAW, ["1:1"])
    assert "load_share" in str(bf.check(project_of(tmp_path, rows)))
    assert "load_share" not in str(bf.check(project_of(tmp_path, rows, "load_share = 1.0")))


def test_file_given_twice_is_refused(tmp_path):
    project_of(tmp_path, biaxial_rows(LAW, ["1:1", "2:1"]))
    (tmp_path / "copy.csv").write_text((tmp_path / "test.csv").read_text())
    path = tmp_path / "project.toml"
    path.write_text(path.read_text().replace('"test.csv"', '"test.csv", "copy.csv"'))
    with pytest.raises(InputError, match=r"files\[1\]: has the content of test.csv"):
        bf.read_project(path)


def test_start_on_a_bound_of_nu12_leaves_it(tmp_path):
    project_of(tmp_path, biaxial_rows(LAW, ["1:1", "2:1", "1:2"]))
    path = tmp_path / "project.toml"
    text, count = re.subn(r"nu12 = [\d.]+", "nu12 = 0.0", path.read_text())
    assert count == 1
    path.write_text(text + "\n[fit.unknowns]\nnu12 = {}\n")
    fit = bf.fit(bf.read_project(path))
    assert fit.best.law.nu12 == pytest.approx(0.24, abs=1e-3)
    assert fit.modulus("E1", 0.01).value == pytest.approx(E1, rel=1e-3)


COMPLIANCE = 1e-3
JOINT_STRIPS = """
[[strips]]
width = 25.0
gauge_length = 75.0
match = "points"
increments = 10
noise = 1.0
%s
[strips.data]
folder = ""
files = { warp = ["warp.csv"], fill = ["fill.csv"] }
load_unit = "N"
length_unit = "mm"
"""


def joint_project(folder, keys):
    """Biaxial test and strips whose elongations contain what machine and grips give."""
    random = np.random.default_rng(2)
    for yarn, end in (("warp", 78.0), ("fill", 78.0)):
        model = straight_strip(yarn, 75.0, end, THICKNESS, 25.0, 10)
        load = MembraneSolver().run(model, LAW).load
        travel = np.array(model.elongations) + COMPLIANCE * load
        table = np.column_stack([travel, load + random.standard_normal(10)])
        head = "elongation,load"
        np.savetxt(folder / f"{yarn}.csv", table, "%.6f", ",", header=head, comments="")
    rows = biaxial_rows(LAW, ["1:1", "2:1", "1:2"])
    noise = 0.01 * random.standard_normal((len(rows), 2))
    noise[:: len(rows) // 3] = 0.0  # strains of a ratio count from its first row
    rows = [(*row[:3], row[3] + u, row[4] + v) for row, (u, v) in zip(rows, noise, strict=True)]
    project_of(folder, rows)
    path = folder / "project.toml"
    path.write_text(path.read_text() + JOINT_STRIPS % keys)
    return bf.read_project(path)


def test_compliance_of_the_machine_is_found_beside_a_biaxial_test(tmp_path):
    """Crosshead travel for elongation, from questions on test frames in forums."""
    fit = bf.fit(joint_project(tmp_path, "compliance_prior = 0.002"))
    (verdict,) = fit.verdicts
    assert verdict.name == "compliance of strips" and verdict.determined
    assert verdict.sigma < 1e-4 and abs(verdict.value - COMPLIANCE) < 2.5 * verdict.sigma
    for name, true in (("E1", E1), ("E2", E2)):
        modulus = fit.modulus(name, 0.02)
        half = 0.5 * (modulus.upper - modulus.lower)
        assert abs(modulus.value - true) < 1.3 * half and half < 0.03 * true
    # Reported loads lie at the elongations of the specimen.
    table = fit.residuals()
    strips = table[table["quantity"] == "load"]
    assert strips["elongation_mm"].max() == pytest.approx(3.0, rel=0.02)
    assert np.abs(strips["difference"]).max() < 5.0


def test_elongations_without_extensometer_are_named_where_strips_alone_are_fitted(tmp_path):
    project = joint_project(tmp_path, "")
    assert "compliance_prior" in str(bf.check(project))
    fit = bf.fit(project, tests="strips")
    assert "no extensometer is named" in str(fit.notes)
    assert "compliance_prior" not in str(bf.check(joint_project(tmp_path, "compliance = 0.001")))
    assert "compliance_prior" not in str(bf.check(joint_project(tmp_path, "grip_distance = 100.0")))
