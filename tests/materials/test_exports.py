"""Exported cards and tables, read back and compared with the law; UMAT, compiled and called."""

import ctypes
import dataclasses
import io
import json
import math
import re
import subprocess
from dataclasses import replace

import numpy as np
import pandas as pd
import pytest
from bubblefit.cli.main import main
from bubblefit.errors import InputError
from bubblefit.materials import card as card_module
from bubblefit.materials.card import MaterialCard, read_card, write_card
from bubblefit.materials.deformation_curves import trellis_angle, trellis_curve, uniaxial_curve
from bubblefit.materials.exports.base import NoOptions
from bubblefit.materials.exports.subroutines import umat
from bubblefit.materials.forms.base import COMPONENTS
from bubblefit.materials.law import HypoelasticLaw
from bubblefit.materials.memory import Memory
from bubblefit.materials.modulus_tables import JUMP, REACH, modulus_table, modulus_tables
from bubblefit.materials.pieces import integral_of
from bubblefit.solvers.calculix.library import SOURCE, constants, law_text
from bubblefit.solvers.exports import FORMATS
from click.testing import CliRunner
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.integrate import cumulative_trapezoid, trapezoid

from ..builders.fortran import (
    BETA,
    GONE,
    KNOTS,
    LAWS,
    SIZES,
    address,
    build,
    close,
    increments_everywhere,
    reals,
    strain_path,
    trilinear,
)
from ..solvers.calculix.test_calculix_law import check_patch, patch_deck
from ..support import needs
from ..support.refusals import complaint, refused

CARD = MaterialCard(LAWS["cubic"], 0.8, "Valmex 7318", "Table 4.2")
TABULATED = ("marc", "abaqus-fabric", "ls-dyna-mat34", "csv")
E1, E2, NU12 = np.poly1d(BETA[8:]), np.poly1d(BETA[4:8]), 0.24


def export(name, card=CARD, **options):
    return FORMATS[name].export(card, **options)


def few_points(name, count=15):
    return {"points": count} if hasattr(FORMATS[name].options(), "points") else {}


def strip(pulled, log_strain):
    """Nominal strain and stress of the cubic card; the width's modulus is held at zero strain."""
    stress = (E1, E2)[pulled].integ()(log_strain)
    across = -NU12 * (log_strain if pulled == 0 else stress / E1(0))
    return np.expm1(log_strain), stress * np.exp(across)


@pytest.mark.parametrize("name", ["cubic", "incompressible", "tri-linear", "spline"])
def test_curves_of_every_measure_do_the_same_work(name):
    """The stress over the trellis' angle is work-conjugate, too."""
    law, log_strain = LAWS[name], np.linspace(0, 0.12, 100)
    curves = {m: uniaxial_curve(law, 1, log_strain, m) for m in ("true", "nominal", "green")}
    work = {measure: trapezoid(y, x) for measure, (x, y) in curves.items()}
    assert work["green"] == pytest.approx(work["nominal"], rel=1e-4)
    areas = curves["nominal"][1][1:] * np.exp(log_strain[1:]) / curves["true"][1][1:]
    stress = curves["true"][1] * np.concatenate([[1.0], areas])
    assert trapezoid(stress, log_strain) == pytest.approx(work["green"], rel=1e-4)
    angles = np.linspace(0, 0.25, 251)
    _, stress, _ = trellis_curve(law, angles, "nominal")
    green, pk2, _ = trellis_curve(law, angles, "green")
    work = cumulative_trapezoid(pk2, green)
    np.testing.assert_allclose(cumulative_trapezoid(stress, angles), work, rtol=1e-4, atol=1e-9)
    gamma, _, _ = trellis_curve(law, angles[1:], "true")
    assert [trellis_angle(g) for g in gamma] == pytest.approx(list(angles[1:]), rel=1e-9)


def test_a_law_that_fails_on_the_way_has_no_curve():
    with pytest.raises(InputError, match=r"is not positive at 4\.95 % of log strain"):
        uniaxial_curve(GONE, 0, np.linspace(0, 0.1, 101), "true")
    weak = HypoelasticLaw(np.r_[0, 0, -1e3, 20.0, 0, 0, 0, 100.0, 0, 0, 0, 500.0])
    assert "trellis" in complaint(trellis_curve, weak, np.linspace(0, 0.2, 5), "true")


def fixed(line, widths):
    ends = np.cumsum(widths)
    return [line[end - width : end] for width, end in zip(widths, ends, strict=True)]


def test_csv_holds_the_moduli_and_the_strips():
    text = export("csv").files[".csv"]
    assert "# nu12: 0.24" in text
    table = pd.read_csv(io.StringIO(text), comment="#")
    assert list(table.direction.unique()) == ["warp", "fill", "shear"]
    for direction, name in (("warp", "E1"), ("fill", "E2"), ("shear", "G12")):
        rows = table[table.direction == direction]
        assert len(rows) == 121 and rows.log_strain.iloc[-1] == 0.13
        np.testing.assert_allclose(
            rows.tangent_modulus_MPa, LAWS["cubic"].modulus(name, rows.log_strain), rtol=1e-10
        )
    for pulled, direction in enumerate(("warp", "fill")):
        rows = table[table.direction == direction]
        x, y = strip(pulled, rows.log_strain.to_numpy())
        np.testing.assert_allclose(rows.test_strain, x, rtol=1e-9, atol=1e-12)
        np.testing.assert_allclose(rows.test_stress_MPa, y, rtol=1e-5)


def read_fabric(text):
    found, component = {}, None
    for line in text.splitlines():
        if line.startswith("*UNIAXIAL"):
            component = found.setdefault(line.partition("COMPONENT=")[2], [])
        elif line.startswith("*") and not line.startswith(("**", "*LOADING DATA")):
            component = None
        elif not line.startswith("*") and component is not None:
            stress, strain = map(float, line.split(","))
            component.append((strain, stress))
    return {name: np.array(rows) for name, rows in found.items()}


def test_abaqus_fabric_holds_the_strips_and_the_trellis():
    text = export("abaqus-fabric", density=1.25e-9, points=61).files[".inp"]
    assert "*FABRIC, STRESS FREE INITIAL SLACK=NO" in text
    assert "*DENSITY\n1.25e-09\n" in text and "stands in" not in text
    found = read_fabric(text)
    assert set(found) == {"1", "2", "SHEAR"}
    for pulled, component in enumerate("12"):
        strain, stress = found[component].T
        assert strain[0] < 0 and 0 in strain and (np.diff(strain) > 0).all()
        tension = strain >= 0
        _, wanted = strip(pulled, np.log1p(strain[tension]))
        np.testing.assert_allclose(stress[tension], wanted, rtol=1e-5, atol=1e-9)
        # Held in compression: the line through zero to the one point has the modulus at zero
        # but for the change of width and length, some percent at -0.1.
        assert stress[0] / strain[0] == pytest.approx((E1, E2)[pulled](0), rel=0.1)
    angle, stress = found["SHEAR"].T
    assert angle[0] == 0 and angle[-1] == pytest.approx(trellis_angle(0.13), rel=1e-9)
    _, wanted, _ = trellis_curve(LAWS["cubic"], angle, "nominal")
    np.testing.assert_allclose(stress, wanted, rtol=1e-9, atol=1e-12)


def read_k(text):
    """Fields of *MAT_FABRIC by name, and curves by number, sliced by column."""
    blocks, names = {}, {}
    for line in text.splitlines():
        if line.startswith("*"):
            blocks.setdefault(line, []).append([])
            last = blocks[line][-1]
        elif not line.startswith("$"):
            last.append(line)
    (material,) = blocks["*MAT_FABRIC_TITLE"]
    cards = (
        "mid ro ea eb - prba prab", "gab - - cse el prl lratio damp",
        "aopt flc fac ela lnrc form fvopt tsrfac", "- rgbrth a0ref a1 a2 a3 x0 x1",
        "v1 v2 v3 - - - beta isrefg", "lca lcb lcab lcua lcub lcuab rl",
    )  # fmt: skip
    for fields, line in zip(map(str.split, cards), material[1:], strict=True):
        assert len(line) == 10 * len(fields)
        for name, cell in zip(fields, fixed(line, [10] * len(fields)), strict=True):
            assert (name == "-") == (cell.strip() == "")
            names[name] = float(cell.strip() or 0)
    curves = {}
    for title, head, *rows in blocks["*DEFINE_CURVE_TITLE"]:
        assert title in ("warp", "fill", "shear")
        number, _, scale, _, offset, *_ = map(float, fixed(head, [10] * 7))
        assert scale == 1 and offset == 0
        curves[int(number)] = np.array([[float(v) for v in fixed(row, [20, 20])] for row in rows])
    return names, curves


@pytest.mark.parametrize("measure", [None, "green", "nominal", "true"])
def test_mat34_holds_the_strips_and_the_trellis(measure):
    given = {} if measure is None else {"measure": measure}
    made = export("ls-dyna-mat34", density=1.25e-9, points=61, **given)
    lines = made.files[".k"].splitlines()
    assert (lines[0], lines[-1]) == ("*KEYWORD", "*END")
    (names, curves), law = read_k(made.files[".k"]), LAWS["cubic"]
    wanted = {"form": 14, "cse": 0, "ro": 1.25e-9, "prab": 0.24}
    assert {name: names[name] for name in wanted} == wanted
    moduli = [names[name] for name in ("ea", "eb", "gab")]
    assert moduli == pytest.approx([806.35, 139.437, 20.0439])
    assert names["prba"] / names["eb"] == pytest.approx(names["prab"] / names["ea"], rel=1e-5)
    for pulled, number in enumerate((names["lca"], names["lcb"])):
        strain, stress = curves[int(number)].T
        assert (np.diff(strain) > 0).all() and strain[0] < 0
        strain, stress = strain[strain > 0], stress[strain > 0]
        # Back to nominal, by what the measures mean.
        if measure == "true":
            across = -NU12 * (strain if pulled == 0 else stress / E1(0))
            log_strain, nominal = strain, stress * np.exp(across)
        elif measure == "nominal":
            log_strain, nominal = np.log1p(strain), stress
        else:
            log_strain = 0.5 * np.log1p(2 * strain)
            nominal = stress * np.exp(log_strain)
        np.testing.assert_allclose(nominal, strip(pulled, log_strain)[1], rtol=1e-5)
    shear = curves[int(names["lcab"])]
    np.testing.assert_allclose(shear, -shear[::-1], atol=1e-12)
    assert np.interp(1e-3, *shear.T) / 1e-3 == pytest.approx(float(law.G12(0)), rel=0.02)
    assert ("Green" in made.says.carries[0]) == (measure in (None, "green"))


@pytest.mark.parametrize(("compression", "cse"), [("law", 0), ("none", 1)])
def test_mat34_says_what_a_pushed_yarn_carries(compression, cse):
    made = export("ls-dyna-mat34", compression=compression, points=15)
    names, curves = read_k(made.files[".k"])
    assert names["cse"] == cse and f"CSE = {cse}" in " ".join(made.says.carries)
    for yarn in ("lca", "lcb"):
        (x0, y0), (x1, _) = curves[int(names[yarn])][:2]
        assert (x0 < 0, y0 < 0, x1 > 0) == (not cse, not cse, bool(cse))
    assert curves[int(names["lcab"])][0, 0] < 0


@pytest.mark.parametrize("name", ["cubic", "tri-linear, held"])
def test_calculix_text_holds_the_constants_and_the_source(name):
    files, wanted = export("calculix", MaterialCard(LAWS[name], 0.8)).files, constants(LAWS[name])
    _, _, tail = files[".inp"].partition("*USER MATERIAL, CONSTANTS=")
    count, *rows = tail.partition("*DEPVAR")[0].splitlines()
    found = [v for row in rows for v in row.split(",") if v.strip()]
    assert all(len(v.strip()) <= 20 for v in found)
    assert int(count) == len(wanted)
    assert [float(v) for v in found] == pytest.approx(wanted, rel=1e-12)
    assert (files[".c"], files[".law"]) == (SOURCE.read_text(), law_text(LAWS[name]))


def test_ccx_runs_the_exported_card(ccx, tmp_path, monkeypatch):
    files = export("calculix").files
    for name, suffix in (("FILE.c", ".c"), ("card.inp", ".inp"), ("any name.law", ".law")):
        (tmp_path / name).write_text(files[suffix])
    (line,) = [text for text in files[".inp"].splitlines() if text.startswith("**   cc ")]
    command = line.removeprefix("**   cc ").split()
    subprocess.run([*needs.c_compiler(), *command], cwd=tmp_path, check=True)
    gradient, increments = np.eye(3), 10
    gradient[:2, :2] = [[1.06, 0.03], [0.05, 1.04]]
    (tmp_path / "elsewhere").mkdir()
    monkeypatch.chdir(tmp_path / "elsewhere")
    deck = patch_deck("S8R", LAWS["cubic"], gradient, increments, 0.0, "")
    start, stop = deck.index("*MATERIAL"), deck.index("*SHELL SECTION")
    deck = f"{deck[:start]}*INCLUDE, INPUT=card.inp\n{deck[stop:]}"
    check_patch(ccx, tmp_path, deck, gradient, increments, LAWS["cubic"], 0.0, tmp_path)


def test_the_limits_of_each_target_are_named():
    def loses(name, card=CARD, **options):
        return " ".join(export(name, card, **few_points(name) | options).says.loses)

    # The linear law in equal biaxial strain e: E1 (1 + nu21)/(1 - nu12 nu21) e on a width that is
    # exp(e) times the first; the strip: E1 e on exp(-nu12 e) times it. Fill likewise.
    linear = MaterialCard(HypoelasticLaw.linear(800.0, 140.0, 20.0), 0.8)
    nu21, e = NU12 * 140 / 800, 0.05
    both = (1 - NU12 * nu21) / (1 + np.array([nu21, NU12]))
    warp, fill = 100 * (1 - both * np.exp(-e * (1 + np.array([NU12, nu21]))))
    for name, words in (
        ("abaqus-fabric", ["nu12", "Explicit only"]), ("ls-dyna-mat34", ["nu12", "density"])
    ):  # fmt: skip
        assert all(word in loses(name) for word in words)
        assert f"{warp:.2g} % along the warp and {fill:.2g} % along the fill" in loses(name, linear)
    assert "measure" in " ".join(export("ls-dyna-mat34", points=15).says.confirm)
    assert "density" not in loses("abaqus-fabric", density=1e-9)
    assert "incompressible" in loses("marc", MaterialCard(LAWS["incompressible"], 0.8))
    assert "0.015 %" in loses("marc", points=121)
    unlimited = MaterialCard(LAWS["linear"], 0.8)
    for name in TABULATED:
        said = loses(name, unlimited, reach=0.05)
        assert "no valid_strain" in said and "5 % of log strain" in said
        assert "no valid_strain" not in loses(name)


@pytest.fixture
def folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    write_card(CARD, tmp_path / "material.toml")
    return tmp_path


def run(*arguments, code=0):
    done = CliRunner().invoke(main, ["export", *map(str, arguments)])
    assert done.exit_code == code, (done.output, done.exception)
    return done.output


@pytest.mark.parametrize("name", FORMATS)
def test_the_command_writes_and_says_the_same(folder, name):
    few = few_points(name)
    points = [x for key, value in few.items() for x in (f"--{key}", value)]
    text = run("material.toml", "--format", name, *points)
    made = export(name, **few)
    paths = [folder / f"material-{name}{suffix}" for suffix in made.files]
    assert sorted(paths) == sorted(p for p in folder.iterdir() if p.name != "material.toml")
    assert [path.read_text() for path in paths] == list(made.files.values())
    assert made.says.carries and all(line in text for line in made.says.lines())
    for suffix, content in made.files.items():
        if suffix not in (".c", ".law"):  # every file begins with what is carried and lost
            content = content.removeprefix("*KEYWORD\n")
            head = " ".join(content[: content.index("units: ")].split())
            assert "written by bubblefit" in head and "card: Valmex 7318" in head
            marks = content.split(" ", 1)[0]
            lines = [x.removeprefix(marks).removeprefix(" ") for x in content.splitlines()]
            assert set(made.says.lines()) <= set(lines)
    for law in ("tri-linear, held", "spline, incompressible"):
        card = MaterialCard(LAWS[law], 0.8, "Valmex 7318", "")
        write_card(card, folder / "material.toml", "MPa")
        run("material.toml", "--format", name, "--force", *points)
        assert [path.read_text() for path in paths] == [*export(name, card, **few).files.values()]


def test_nothing_is_written_over_without_force(folder):
    command = ("material.toml", "--format", "abaqus-umat", "--out", "law.f")
    run(*command)
    assert {p.name for p in folder.iterdir()} == {"material.toml", "law.f", "law.inp"}
    (folder / "law.f").unlink()
    (folder / "law.inp").write_text("mine")
    assert run(*command, code=2).startswith("bubblefit: law.inp: ")
    assert (folder / "law.inp").read_text() == "mine" and not (folder / "law.f").exists()
    run(*command, "--force")
    assert (folder / "law.inp").read_text() != "mine" and (folder / "law.f").exists()
    (folder / "cards").mkdir()
    run(*command[:-1], "cards")
    names = {path.name for path in (folder / "cards").iterdir()}
    assert names == {"material-abaqus-umat.f", "material-abaqus-umat.inp"}
    run("material.toml", "--format", "calculix", "--out", ".")
    assert (folder / "material-calculix.c").exists()


@pytest.mark.parametrize("name", FORMATS)
def test_a_card_without_stiffness_is_bad_input(folder, name, monkeypatch):
    for law, words in (
        (dataclasses.replace(GONE, strain_range=[0.1, 0.1, 0.1]),
         "beta: E1 is -500 MPa at 10 % of log strain"),
        (HypoelasticLaw(np.zeros(12)), "beta: E1 is 0 MPa at 0 % of log strain,"),
        (HypoelasticLaw.linear(1.0, 1000.0, 20.0), "nu12: nu12 nu21 is not below 1"),
    ):  # fmt: skip
        with monkeypatch.context() as patch:
            patch.setattr(card_module, "check_positive", lambda law: None)
            write_card(MaterialCard(law, 0.8), folder / "material.toml")
        text = run("material.toml", "--format", name, code=2)
        assert text.startswith(f"bubblefit: material.toml: {words}") and text.count("\n") == 1
    assert [path.name for path in folder.iterdir()] == ["material.toml"]


def test_json_points_and_a_missing_card(folder):
    run("material.toml", "--format", "csv", "--points", 11, "--reach", 0.1)
    assert len(pd.read_csv(folder / "material-csv.csv", comment="#")) == 33
    content = json.loads(run("material.toml", "--format", "calculix", "--json"))
    assert content["files"] == [f"material-calculix.{end}" for end in ("inp", "c", "law")]
    assert content["format"] == "calculix" and content["carries"] and content["loses"]
    assert "nowhere.toml: cannot be read" in run("nowhere.toml", "--format", "csv", code=2)
    # A card that fails beyond its range is bad input where a curve goes there.
    write_card(MaterialCard(GONE, 0.8), folder / "material.toml")
    text = run("material.toml", "--format", "csv", "--force", code=2)
    assert text.startswith("bubblefit: material.toml: beta: a modulus or 1 - nu12 nu21 is not pos")
    run("material.toml", "--format", "csv", "--force", "--reach", 0.04)
    run("material.toml", "--format", "abaqus-umat")
    for each in FORMATS.values():
        for entry in dataclasses.fields(each.options):
            assert entry.metadata["option"].help.endswith(".")


CUBIC = HypoelasticLaw(BETA, strain_range=np.array([0.13, 0.12, 0.14]))
TRILINEAR = LAWS["tri-linear, held"]


def test_the_published_cubic_to_the_stated_error():
    tables = modulus_tables(CUBIC)
    assert set(tables) == set(COMPONENTS)
    for name, table in tables.items():
        # Beyond both ends, too: held, as the law does.
        strain = np.linspace(-0.3, 0.3, 20001)
        off = np.abs(table.at(strain) / CUBIC.modulus(name, strain) - 1)
        assert off.max() <= 1.01 * table.error
        assert table.error < 1e-3 and table.reaches
        assert len(table.strain) >= 121
        assert table.strain[-1] == CUBIC.strain_range[COMPONENTS[name]]
        assert (np.diff(table.strain) > 0).all()
        assert np.array_equal(table.modulus, CUBIC.modulus(name, table.strain))
    shear = tables["G12"]
    assert np.array_equal(shear.strain, -shear.strain[::-1]) and tables["E1"].strain[0] == 0
    coarse, fine = (modulus_table(CUBIC, "E1", points).error for points in (61, 121))
    assert coarse / fine == pytest.approx(4.0, rel=0.1)
    table = modulus_table(HypoelasticLaw(BETA), "E1")
    assert not table.reaches and table.strain[-1] == REACH
    assert modulus_table(HypoelasticLaw(BETA), "E1", reach=0.1).strain[-1] == 0.1
    assert "points" in complaint(modulus_table, CUBIC, "E1", 1)
    assert "reach" in complaint(modulus_table, CUBIC, "E1", reach=0.0)


def test_a_jump_is_one_steep_line_after_its_break():
    table = modulus_table(TRILINEAR, "E1")
    assert table.error == 0
    assert table.at(0.01) == 800 and table.at(0.01 + JUMP) == pytest.approx(450, rel=1e-12)
    assert table.at(0.03) == pytest.approx(450, rel=1e-12) and table.at(0.03 + JUMP) == 900
    assert set(modulus_table(TRILINEAR, "E2").modulus) == {140.0, 110.0}
    assert set(modulus_table(TRILINEAR, "G12").modulus) == {20.0}
    law = LAWS["jumps and kinks"]
    mixed, fill = modulus_table(law, "E1"), modulus_table(law, "E2")
    assert mixed.jumps.tolist() == [0.01, 0.04] and fill.jumps.tolist() == []
    assert 0.03 in fill.strain and fill.error < 1e-12
    for own, made, breaks in ((TRILINEAR, table, [0.01, 0.03]), (law, mixed, mixed.jumps)):
        away = np.linspace(-0.02, 0.2, 4001)
        away = away[(np.abs(away[:, None] - breaks) > 2 * JUMP).all(axis=1)]
        assert np.abs(made.at(away) / own.E1(away) - 1).max() <= 1.01 * made.error + 1e-12


def test_a_spline_to_the_stated_error_with_a_point_at_every_knot():
    law = LAWS["spline"]
    for name, component in (("E1", 0), ("E2", 1), ("G12", 2)):
        table = modulus_table(law, name)
        end, knots = law.strain_range[component], KNOTS[component]
        strain = np.linspace(-0.3, 0.3, 20001)
        off = np.abs(table.at(strain) / law.modulus(name, strain) - 1)
        assert off.max() <= 1.01 * table.error and table.error < 2e-3
        assert np.abs(table.strain[:, None] - knots).min(axis=0).max() == 0
        assert np.diff(table.strain).min() > 1e-5 and not len(table.jumps)
        assert table.strain[-1] == end and table.reaches


@pytest.mark.parametrize("left", [1e-9, 5e-7, 1e-6, 2e-6, 1e-5])
def test_a_jump_just_before_the_end_of_the_range_is_in_the_table(left):
    table = modulus_table(trilinear(strain_range=[0.01 + left, 0.2, 0.2]), "E1")
    assert table.strain[-1] == 0.01 + left and table.error == 0
    assert table.at(0.01) == 800 and table.at(0.02) == 450


@settings(max_examples=50, deadline=None)
@given(
    st.lists(st.floats(-100, 100), min_size=12, max_size=12),
    st.lists(st.floats(0.005, 0.5), min_size=3, max_size=3),
    st.integers(100, 300),
)
def test_any_cubic_to_the_bound_of_linear_interpolation(beta, ends, points):
    """|f - table| <= h^2/8 max |f''|, in MPa; a modulus through zero has no relative error."""
    law = HypoelasticLaw(np.array(beta), strain_range=np.array(ends))
    for first, (name, component) in zip((8, 4, 0), COMPONENTS.items(), strict=True):
        table = modulus_table(law, name, points)
        curvature = np.abs([np.polyval([6 * beta[first], 2 * beta[first + 1]], x)
                            for x in (0.0, ends[component])]).max()  # fmt: skip
        bound = (ends[component] / (points - 1)) ** 2 / 8 * curvature
        strain = np.linspace(-0.6, 0.6, 2001)
        assert (np.abs(table.at(strain) - law.modulus(name, strain)) <= bound + 1e-11).all()


XIT = """
      subroutine xit
      integer last
      common /asked/ last
      last = 1
      end
"""


def whole(*values):
    return np.array(values, dtype=np.int32)


def properties(export):
    text = export.files[".inp"]
    head, _, block = text.partition("*USER MATERIAL, CONSTANTS=")
    count, *lines = block.splitlines()
    assert count.endswith(", UNSYMM") and "*MATERIAL, NAME=" in head
    assert all(len(line.split(",")) <= 8 for line in lines)
    found = reals(*(float(v) for line in lines for v in line.split(",") if v.strip()))
    assert len(found) == int(count.split(",")[0]) == 4 + 5 * found[1:4].sum()
    return found


class Point:
    def __init__(self, library, props):
        self.function, self.props = library.umat_, props
        self.asked = ctypes.c_int32.in_dll(library, "asked_")
        self.asked.value = 0
        self.strain, self.stress = np.zeros(3), np.zeros(3)
        self.ndi, self.ntens = 2, 3

    def call(self, increment, pnewdt=1.0):
        stress, stiffness = self.stress.copy(), np.full((3, 3), 77.0, order="F")
        energy, request, de = reals(0.0), reals(pnewdt), reals(*increment)
        empty = address(np.full(99, np.nan))
        ntens = whole(self.ntens)
        self.function(
            address(stress), empty, address(stiffness), address(energy), empty, empty, empty,
            empty, empty, empty, address(self.strain), address(de), empty, empty, empty, empty,
            empty, empty, ctypes.c_char_p(b"FABRIC".ljust(80)), address(whole(self.ndi)),
            address(whole(1)), address(ntens), address(whole(0)), address(self.props),
            address(whole(len(self.props))), empty, empty, address(request), empty, empty, empty,
            address(whole(3)), address(whole(2)), address(whole(1)), address(whole(1)),
            address(whole(1, 1, 1, 1)), address(whole(4)), ctypes.c_size_t(80),
        )  # fmt: skip
        return stress, stiffness, request[0], energy[0]

    def commit(self, increment):
        self.stress, stiffness, request, energy = self.call(increment)
        self.strain = self.strain + increment
        return self.stress, stiffness, request, energy


def exported(law):
    return umat(MaterialCard(law, 0.8, "Valmex 7318"), NoOptions())


@pytest.fixture(scope="module")
def library(tmp_path_factory):
    folder = tmp_path_factory.mktemp("umat")
    return build(folder, exported(LAWS["cubic"]).files[".f"], "-ffixed-form", beside=XIT)


@pytest.mark.parametrize("name", LAWS)
def test_random_paths_give_stress_and_stiffness_of_the_python_law(library, name):
    law, export = LAWS[name], exported(LAWS[name])
    props = properties(export)
    assert f"POISSON={0.5 if 'incompressible' in name else 0:g}\n" in export.files[".inp"]
    for seed in range(20):
        point = Point(library, props)
        old, stress = np.zeros(3), np.zeros(3)
        for new in strain_path(seed):
            s, d, request, energy = point.commit(new - old)
            after, tangent = law.increment(old, new, stress)
            close(s, after[0])
            close(d, tangent[0])
            assert energy == pytest.approx(0.5 * (stress + after[0]) @ (new - old), rel=1e-9)
            assert request == 1.0
            old, stress = new, after[0]
        assert point.asked.value == 0


@pytest.mark.parametrize("name", LAWS)
@pytest.mark.parametrize("size", SIZES)
def test_increments_of_any_size_from_anywhere(library, name, size):
    law, props = LAWS[name], properties(exported(LAWS[name]))
    for old, new in increments_everywhere(law, size):
        point = Point(library, props)
        point.strain, point.stress = old, reals(3.0, -1.0, 0.5)
        s, d, request, _ = point.call(new - old)
        after, tangent = law.increment(old, new, point.stress)
        if np.isfinite(after).all():
            close(s, after[0])
            close(d, tangent[0])
        assert (request == 1.0) == np.isfinite(after).all()


def test_a_modulus_that_runs_out_asks_for_half_the_increment(library):
    point = Point(library, properties(exported(GONE)))
    before = point.commit(reals(0.04, 0.0, 0.0))[0].copy()
    for increment in (reals(0.04, 0.0, 0.0), reals(np.nan, 0.0, 0.0)):
        stress, stiffness, request, _ = point.call(increment)
        assert request == 0.5 and np.array_equal(stress, before)
        assert (np.linalg.eigvalsh(stiffness) > 0).all()
        assert point.call(increment, pnewdt=0.1)[2] == 0.1


def test_what_is_no_plane_stress_ends_the_job(library):
    point = Point(library, properties(exported(LAWS["cubic"])))
    point.ndi = 3
    point.call(np.zeros(3))
    assert point.asked.value == 1
    good = properties(exported(LAWS["spline"]))
    for other in (good[:-1], good[:4], np.append(good, 1.0), np.ones(22), 1e300 * good, -good):
        wrong = Point(library, other)
        wrong.call(np.zeros(3))
        assert wrong.asked.value == 1
    right = Point(library, good)
    right.call(np.zeros(3))
    assert right.asked.value == 0


def test_the_names_and_lines_are_ones_that_abaqus_takes():
    card = MaterialCard(
        LAWS["cubic"], 0.8, "7318 – überzogen, very long indeed, and longer", "a\nb"
    )
    export = umat(card, NoOptions())
    (name,) = re.findall(r"\*MATERIAL, NAME=(.*)", export.files[".inp"])
    assert re.fullmatch(r"[A-Z]\w{0,31}", name)
    for text in export.files.values():
        assert text.isascii()
    for line in export.files[".f"].splitlines():
        assert len(line) <= 72 or (line[72:] == "&" and line[:6].strip() in ("", "&")), line


MEMORY = Memory((0.4, 0.5, 0.3), (1.6, 1.7, 1.5), (1.2, 1.1, 1.0), (3.0, 5.0, 1.0))
REMEMBERS = replace(CARD, law=replace(LAWS["cubic"], memory=MEMORY), state="first loading")


def unloaded(component, measure="nominal"):
    law, end, count = REMEMBERS.law, 0.13, 15
    kept, up = MEMORY.kept(component, end), MEMORY.unloading[component]
    x = np.linspace(kept, end, count)
    s = (x - kept) / (end - kept)
    own = integral_of(law.pieces, component, 0.0, end) * ((2 - up) * s + (up - 1) * s**2)
    across = -NU12 * (x if component == 0 else own / E1(0))
    nominal = np.stack([np.expm1(x), own * np.exp(across)], axis=1)
    if measure == "green":
        stretch = np.exp(x)
        return np.stack([0.5 * (stretch**2 - 1), nominal[:, 1] / stretch], axis=1)
    return np.stack([x, own], axis=1) if measure == "true" else nominal


@pytest.mark.parametrize("measure", ["green", "nominal", "true"])
def test_mat34_unloads_as_the_memory_does(measure):
    text = FORMATS["ls-dyna-mat34"].export(REMEMBERS, measure=measure, points=15).files[".k"]
    assert "$ state of the fabric: first loading" in text
    names, curves = read_k(text.replace(" unloading\n", "\n"))
    assert [names[n] for n in ("lca", "lcb", "lcab", "lcua", "lcub", "lcuab", "rl")] == [
        101, 102, 103, 104, 105, 106, 0]  # fmt: skip
    for pulled, number in enumerate((104, 105)):
        rows, wanted = curves[number], unloaded(pulled, measure)
        assert (rows[0] == 0).all()
        np.testing.assert_allclose(rows[1:], wanted, rtol=1e-9, atol=1e-9)
        np.testing.assert_allclose(rows[-1], curves[number - 3][-1], rtol=1e-6)
    shear, loading = curves[106], curves[103]
    np.testing.assert_allclose(shear, -shear[::-1], atol=1e-12)
    np.testing.assert_allclose(shear[-1], loading[-1], rtol=1e-6)
    inside = np.interp(shear[:, 0], *loading.T)
    assert (np.abs(shear[:, 1]) <= np.abs(inside) * (1 + 1e-9)).all()


def read_functions(text):
    found, last = {}, None
    for line in text.splitlines():
        if line.startswith("/FUNCT/"):
            last = found.setdefault(int(line.removeprefix("/FUNCT/")), [])
        elif last is not None and re.fullmatch(r"[ \d.E+-]{40}", line):
            last.append([float(v) for v in fixed(line, [20, 20])])
    return {number: np.array(rows) for number, rows in found.items()}


def test_law58_unloads_as_the_memory_does():
    text = FORMATS["radioss-law58"].export(REMEMBERS, points=15).files[".rad"]
    lines, curves = text.splitlines(), read_functions(text)
    cards = [lines[i + 1] for i, line in enumerate(lines) if line.startswith("#  FCT_ID")]
    assert int(fixed(cards[0], [10, 10, 20])[0]) == 101
    last = [float(v) for v in fixed(cards[1], [10, 10, 20, 20, 10, 20])]
    assert last == [104, 105, 1, 1, 106, 1]
    assert set(curves) == {101, 102, 103, 104, 105, 106}
    for pulled, number in enumerate((104, 105)):
        np.testing.assert_allclose(curves[number][1:], unloaded(pulled), rtol=1e-9, atol=1e-9)
        loading = curves[number - 3]
        np.testing.assert_allclose(loading[:, 1], strip(pulled, np.log1p(loading[:, 0]))[1],
                                   rtol=1e-5, atol=1e-9)  # fmt: skip
    angle = math.degrees(trellis_angle(MEMORY.kept(2, 0.13)))
    assert curves[106][1] == pytest.approx([angle, 0.0])
    assert curves[106][-1] == pytest.approx(curves[103][-1], rel=1e-6)


def test_abaqus_fabric_unloads_as_the_memory_does():
    text = FORMATS["abaqus-fabric"].export(REMEMBERS, points=15).files[".inp"]
    blocks = re.split(r"^\*UNLOADING DATA, DEFINITION=SHIFTED CURVE\n", text, flags=re.M)[1:]
    curves = []
    for block in blocks:
        body = block.split("*")[0].strip().splitlines()
        curves.append(np.array([[float(v) for v in line.split(",")] for line in body])[:, ::-1])
    assert len(curves) == 3
    for pulled in (0, 1):
        wanted = unloaded(pulled)
        wanted[:, 0] -= wanted[0, 0]
        np.testing.assert_allclose(curves[pulled], wanted, rtol=1e-9, atol=1e-9)
    assert text.count(", TYPE=PERMANENT DEFORMATION") == 3 and text.count("TYPE=ELASTIC") == 2


@pytest.mark.parametrize("name", sorted(FORMATS))
def test_other_formats_refuse_a_memory(name):
    if name in ("ls-dyna-mat34", "radioss-law58", "abaqus-fabric"):
        return
    assert refused(FORMATS[name].export, REMEMBERS).field == "memory"


def test_a_card_keeps_memory_and_state(tmp_path):
    path = tmp_path / "card.toml"
    REMEMBERS.write(path)
    card = read_card(path)
    assert (card.law.memory, card.state) == (MEMORY, "first loading")
    text = path.read_text()
    for old, new, field in (
        ("format = 4", "format = 3", "memory"), ('"first loading"', '"tenth"', "state"),
        ("0.4,", "1.4,", "memory.permanent_set"),
    ):  # fmt: skip
        path.write_text(text.replace(old, new))
        assert refused(read_card, path).field == field
