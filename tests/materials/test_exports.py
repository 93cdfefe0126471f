"""Exported cards and tables, each read back and compared with the law."""

import dataclasses
import io
import json
import subprocess

import numpy as np
import pandas as pd
import pytest
from bubblefit.cli.main import main
from bubblefit.errors import InputError
from bubblefit.materials.card import MaterialCard, write_card
from bubblefit.materials.forms.base import COMPONENTS
from bubblefit.materials.law import HypoelasticLaw
from bubblefit.materials.responses import (
    JUMP,
    REACH,
    modulus_table,
    modulus_tables,
    trellis_angle,
    trellis_curve,
    uniaxial_curve,
)
from bubblefit.solvers.calculix.library import SOURCE, constants, law_text
from bubblefit.solvers.registry import FORMATS
from click.testing import CliRunner
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.integrate import trapezoid

from .. import needs
from ..complaints import complaint
from ..fortran_build import BETA, KNOTS, LAWS
from ..published_laws import TABLE_4_2
from ..solvers.calculix.test_calculix_law import expected, patch_deck, tensor, voigt

CARD = MaterialCard(LAWS["cubic"], 0.8, "Valmex 7318", "Table 4.2")
TABULATED = ("marc", "abaqus-fabric", "ls-dyna-mat34", "csv")
E1, E2 = (np.poly1d(BETA[first : first + 4]) for first in (8, 4))
NU12 = 0.24


def export(name, card=CARD, **options):
    return FORMATS[name].export(card, **options)


def strip(pulled, log_strain):
    """Nominal stress of the cubic card in closed form; the width's modulus is held at zero strain.

    d eps across = - nu12 d eps1 of a warp strip, - nu12 E2/E1(0) d eps2 of a fill strip.
    """
    modulus = (E1, E2)[pulled]
    stress = modulus.integ()(log_strain)
    across = -NU12 * (log_strain if pulled == 0 else stress / E1(0))
    return np.expm1(log_strain), stress * np.exp(across)


@pytest.mark.parametrize("pulled", [0, 1])
def test_a_strip_is_the_closed_form(pulled):
    log_strain = np.linspace(0, 0.13, 66)
    x, y = uniaxial_curve(LAWS["cubic"], pulled, log_strain, "nominal")
    wanted_x, wanted_y = strip(pulled, log_strain)
    np.testing.assert_allclose(x, wanted_x, rtol=1e-13)
    np.testing.assert_allclose(y, wanted_y, rtol=1e-5)


@pytest.mark.parametrize("name", ["cubic", "incompressible", "tri-linear", "spline"])
def test_the_measures_of_a_strip_do_the_same_work(name):
    log_strain = np.linspace(0, 0.12, 400)
    law, work = LAWS[name], {}
    for measure in ("true", "nominal", "green"):
        x, y = uniaxial_curve(law, 1, log_strain, measure)
        work[measure] = np.sum(0.5 * (y[1:] + y[:-1]) * np.diff(x))
    assert work["green"] == pytest.approx(work["nominal"], rel=1e-5)
    # Cauchy stress does its work on the present area of the strip.
    _, force = uniaxial_curve(law, 1, log_strain, "nominal")
    _, stress = uniaxial_curve(law, 1, log_strain, "true")
    areas = force[1:] * np.exp(log_strain[1:]) / stress[1:]
    x = log_strain
    y = stress * np.concatenate([[1.0], areas])
    assert np.sum(0.5 * (y[1:] + y[:-1]) * np.diff(x)) == pytest.approx(work["green"], rel=1e-5)


@pytest.mark.parametrize("name", ["cubic", "incompressible", "tri-linear", "spline"])
def test_trellis_shear_does_the_work_of_the_membrane(name):
    """The stress over the angle is work-conjugate: both pairs do the work of the law."""
    law, angles = LAWS[name], np.linspace(0, 0.25, 251)
    _, stress, _ = trellis_curve(law, angles, "nominal")
    green, pk2, _ = trellis_curve(law, angles, "green")
    work = np.concatenate([[0], np.cumsum(0.5 * (pk2[1:] + pk2[:-1]) * np.diff(green))])
    same = np.concatenate([[0], np.cumsum(0.5 * (stress[1:] + stress[:-1]) * np.diff(angles))])
    np.testing.assert_allclose(same, work, rtol=1e-4, atol=1e-9)
    gamma, _, _ = trellis_curve(law, angles[1:], "true")
    assert [trellis_angle(g) for g in gamma] == pytest.approx(list(angles[1:]), rel=1e-9)


def test_a_law_that_fails_on_the_way_has_no_curve():
    gone = HypoelasticLaw(np.r_[0, 0, 0, 20.0, 0, 0, 0, 100.0, 0, 0, -1e4, 500.0])
    with pytest.raises(InputError, match=r"is not positive at log strain 0\.0495"):
        uniaxial_curve(gone, 0, np.linspace(0, 0.1, 101), "true")
    weak = HypoelasticLaw(np.r_[0, 0, -1e3, 20.0, 0, 0, 0, 100.0, 0, 0, 0, 500.0])
    assert "trellis" in complaint(trellis_curve, weak, np.linspace(0, 0.2, 5), "true")


def fixed(line, widths):
    """Fields of fixed columns."""
    ends = np.cumsum(widths)
    return [line[end - width : end] for width, end in zip(widths, ends, strict=True)]


def read_marc(text):
    """Tables (name: number, variable, points) and the NLELAST block, sliced by column."""
    lines = [line for line in text.splitlines() if not line.startswith("$")]
    tables, i = {}, 0
    while lines[i].startswith("table"):
        name = lines[i][20:].strip()
        number, variables, *rest = map(int, fixed(lines[i + 1], [10] * 5))
        assert variables == 1 and rest == [0, 0, 2]
        kind, count, *rest = map(int, fixed(lines[i + 2], [10] * 12))
        assert rest == [2, 0, 0] + [2, 0, 0] * 2 + [2]
        rows = [tuple(map(float, fixed(line, [20, 20]))) for line in lines[i + 3 : i + 3 + count]]
        assert all(len(line) == 40 for line in lines[i + 3 : i + 3 + count])
        tables[name] = number, kind, np.array(rows)
        i += 3 + count
    assert lines[i] == "nlelast" and lines[i + 1] == ""
    return tables, lines[i + 2 :]


@pytest.mark.parametrize(
    "name", ["cubic", "tri-linear, held", "linear", "spline", "jumps and kinks"]
)
def test_marc_tables_give_the_moduli_of_the_law(name):
    law = LAWS[name]
    text = export("marc", MaterialCard(law, 0.8, "Valmex 7318")).files[".dat"]
    tables, (material, multipliers, numbers, elements) = read_marc(text)
    assert fixed(material, [10] * 5 + [24, 10])[5].strip() == "valmex_7318"
    assert [float(v) for v in fixed(multipliers, [20] * 4)] == [1, 1, law.nu12, 1]
    assert [int(v) for v in fixed(numbers, [10] * 4)] == [11, 12, 0, 13]
    assert elements == "fabric"
    strain = np.linspace(-0.9, 0.9, 40001)
    for modulus, number, unit in (("E1", 11, "e1"), ("E2", 12, "e2"), ("G12", 13, "g12")):
        found, kind, rows = tables[unit]
        assert found == number and kind == 73 and len(rows) > 100
        assert (np.diff(rows[:, 0]) > 0).all()
        away = strain
        if law.jumps:
            at = np.abs(np.abs(strain)[:, None] - law.pieces[:, :-1, 0].ravel())
            away = strain[(at > 2e-6).all(axis=1)]
        read = np.interp(away, *rows.T)
        np.testing.assert_allclose(read, law.modulus(modulus, away), rtol=3e-4)


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
    """(strain, stress) by COMPONENT, from *UNIAXIAL and *LOADING DATA."""
    found, component = {}, None
    for line in text.splitlines():
        if line.startswith("**"):
            continue
        if line.startswith("*"):
            if line.startswith("*UNIAXIAL"):
                component = line.partition("COMPONENT=")[2]
                found[component] = []
            elif not line.startswith("*LOADING DATA"):
                component = None
        elif component is not None:
            stress, strain = map(float, line.split(","))
            found[component].append((strain, stress))
    return {name: np.array(rows) for name, rows in found.items()}


def test_abaqus_fabric_holds_the_strips_and_the_trellis():
    text = export("abaqus-fabric", density=1.25e-9).files[".inp"]
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
            keyword = line
            blocks.setdefault(keyword, []).append([])
        elif not line.startswith("$"):
            blocks[keyword][-1].append(line)
    (material,) = blocks["*MAT_FABRIC_TITLE"]
    cards = [
        ("mid", "ro", "ea", "eb", "", "prba", "prab"),
        ("gab", "", "", "cse", "el", "prl", "lratio", "damp"),
        ("aopt", "flc", "fac", "ela", "lnrc", "form", "fvopt", "tsrfac"),
        ("", "rgbrth", "a0ref", "a1", "a2", "a3", "x0", "x1"),
        ("v1", "v2", "v3", "", "", "", "beta", "isrefg"),
        ("lca", "lcb", "lcab", "lcua", "lcub", "lcuab", "rl"),
    ]
    assert len(material) == 1 + len(cards)
    for fields, line in zip(cards, material[1:], strict=True):
        assert len(line) == 10 * len(fields)
        for name, text_of in zip(fields, fixed(line, [10] * len(fields)), strict=True):
            assert (name == "") == (text_of.strip() == "")
            names[name] = float(text_of or 0) if name else None
    curves = {}
    for title, head, *rows in blocks["*DEFINE_CURVE_TITLE"]:
        assert title in ("warp", "fill", "shear")
        number, _, scale, _, offset, *_ = (float(v) for v in fixed(head, [10] * 7))
        assert scale == 1 and offset == 0
        curves[int(number)] = np.array([[float(v) for v in fixed(row, [20, 20])] for row in rows])
    return names, curves


@pytest.mark.parametrize("measure", [None, "green", "nominal", "true"])
def test_mat34_holds_the_strips_and_the_trellis(measure):
    given = {} if measure is None else {"measure": measure}
    made = export("ls-dyna-mat34", density=1.25e-9, **given)
    names, curves = read_k(made.files[".k"])
    law = LAWS["cubic"]
    assert names["form"] == 14 and names["cse"] == 0 and names["ro"] == 1.25e-9
    assert names["ea"] == pytest.approx(806.35) and names["eb"] == pytest.approx(139.437)
    assert names["gab"] == pytest.approx(20.0439) and names["prab"] == 0.24
    assert names["prba"] / names["eb"] == pytest.approx(names["prab"] / names["ea"], rel=1e-5)
    for pulled, number in enumerate((names["lca"], names["lcb"])):
        strain, stress = curves[int(number)].T
        assert (np.diff(strain) > 0).all() and strain[0] < 0
        tension = strain > 0
        strain, stress = strain[tension], stress[tension]
        # Back to nominal, by what the measures mean.
        if measure == "true":
            log_strain = strain
            across = -NU12 * (log_strain if pulled == 0 else stress / E1(0))
            nominal = stress * np.exp(across)
        elif measure == "nominal":
            log_strain, nominal = np.log1p(strain), stress
        else:
            log_strain = 0.5 * np.log1p(2 * strain)
            nominal = stress * np.exp(log_strain)
        _, wanted = strip(pulled, log_strain)
        np.testing.assert_allclose(nominal, wanted, rtol=1e-5)
    shear = curves[int(names["lcab"])]
    np.testing.assert_allclose(shear, -shear[::-1], atol=1e-12)
    slope = np.interp(1e-3, *shear.T) / 1e-3
    assert slope == pytest.approx(float(law.G12(0)), rel=0.02)
    assert ("Green" in made.says.carries[0]) == (measure in (None, "green"))


def test_calculix_text_holds_the_constants_and_the_source():
    for name in ("cubic", "tri-linear, held"):
        made = export("calculix", MaterialCard(LAWS[name], 0.8))
        wanted = constants(LAWS[name])
        _, _, tail = made.files[".inp"].partition("*USER MATERIAL, CONSTANTS=")
        count, *rows = tail.partition("*DEPVAR")[0].splitlines()
        found = [float(v) for row in rows for v in row.split(",") if v.strip()]
        assert all(len(v.strip()) <= 20 for row in rows for v in row.split(","))
        assert int(count) == len(wanted) and found == pytest.approx(wanted, rel=1e-12)
        assert made.files[".c"] == SOURCE.read_text()
        assert made.files[".law"] == law_text(LAWS[name])


def test_ccx_runs_the_exported_card(ccx, tmp_path, monkeypatch):
    compiler = needs.c_compiler()
    made = export("calculix")
    (tmp_path / "FILE.c").write_text(made.files[".c"])
    (line,) = [text for text in made.files[".inp"].splitlines() if text.startswith("**   cc ")]
    command = line.removeprefix("**   cc ").split()
    subprocess.run([*compiler, *command], cwd=tmp_path, check=True)
    (tmp_path / "card.inp").write_text(made.files[".inp"])
    (tmp_path / "any name.law").write_text(made.files[".law"])
    gradient = np.eye(3)
    gradient[:2, :2] = [[1.06, 0.03], [0.05, 1.04]]
    increments = 10
    (tmp_path / "elsewhere").mkdir()
    monkeypatch.chdir(tmp_path / "elsewhere")
    deck = patch_deck("S8R", LAWS["cubic"], gradient, increments, 0.0, "")
    start, stop = deck.index("*MATERIAL"), deck.index("*SHELL SECTION")
    deck = f"{deck[:start]}*INCLUDE, INPUT=card.inp\n{deck[stop:]}"
    (tmp_path / "patch.inp").write_text(deck)
    done = subprocess.run(
        [ccx.path, "patch"], cwd=tmp_path, env={"LD_LIBRARY_PATH": str(tmp_path)},
        capture_output=True, text=True, timeout=60,
    )  # fmt: skip
    assert done.returncode == 0, done.stdout[-2000:]
    printed = [row.split() for row in (tmp_path / "patch.dat").read_text().splitlines()]
    found = np.array([row[2:] for row in printed if len(row) == 8 and row[0] == "1"], float)
    state = np.zeros(6)
    for step in range(1, increments + 1):
        f = np.eye(3) + step / increments * (gradient - np.eye(3))
        s, _, state = expected(LAWS["cubic"], np.eye(3), f, state, 1.0, 1.0)
    wanted = voigt(f @ tensor(s) @ f.T / np.linalg.det(f))
    np.testing.assert_allclose(found, np.tile(wanted, (len(found), 1)), atol=2e-6 * wanted.max())


@pytest.mark.parametrize("name", FORMATS)
def test_every_file_begins_with_what_is_carried_lost_and_to_be_confirmed(name):
    made = export(name)
    for suffix, text in made.files.items():
        if suffix in (".c", ".law"):
            continue
        head = " ".join(text[: text.index("units: mm")].split())
        assert "written by bubblefit" in head and "card: Valmex 7318" in head
        marks = text.split(" ", 1)[0]
        lines = [line.removeprefix(marks).removeprefix(" ") for line in text.splitlines()]
        for said in made.says.lines():
            assert said in lines
    assert made.says.carries


def test_the_limits_of_each_target_are_named():
    def loses(name, card=CARD, **options):
        return " ".join(export(name, card, **options).says.loses)

    assert "nu12" in loses("abaqus-fabric") and "Explicit only" in loses("abaqus-fabric")
    assert "nu12" in loses("ls-dyna-mat34") and "density" in loses("ls-dyna-mat34")
    # The linear law in equal biaxial strain e: E1 (1 + nu21)/(1 - nu12 nu21) e on a width that is
    # exp(e) times the first; the strip: E1 e on exp(-nu12 e) times it. Fill likewise.
    linear = MaterialCard(HypoelasticLaw.linear(800.0, 140.0, 20.0), 0.8)
    nu21, e = NU12 * 140 / 800, 0.05
    both = (1 - NU12 * nu21) / (1 + np.array([nu21, NU12]))
    warp, fill = 100 * (1 - both * np.exp(-e * (1 + np.array([NU12, nu21]))))
    for name in ("abaqus-fabric", "ls-dyna-mat34"):
        assert f"{warp:.2g} % along the warp and {fill:.2g} % along the fill" in loses(name, linear)
    assert "measure" in " ".join(export("ls-dyna-mat34").says.confirm)
    assert "density" not in loses("abaqus-fabric", density=1e-9)
    incompressible = MaterialCard(LAWS["incompressible"], 0.8)
    assert "incompressible" in loses("marc", incompressible)
    assert "0.015 %" in loses("marc")
    unlimited = MaterialCard(LAWS["linear"], 0.8)
    for name in TABULATED:
        assert "no valid_strain" in loses(name, unlimited)
        assert "log strain 0.05" in loses(name, unlimited, reach=0.05)
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
    text = run("material.toml", "--format", name)
    made = export(name)
    paths = [folder / f"material-{name}{suffix}" for suffix in made.files]
    assert sorted(paths) == sorted(p for p in folder.iterdir() if p.name != "material.toml")
    assert [path.read_text() for path in paths] == list(made.files.values())
    for line in made.says.lines():
        assert line in text
    assert f"written to material-{name}" in text


@pytest.mark.parametrize("law", ["spline", "tri-linear, held", "spline, incompressible"])
def test_a_card_of_any_form_goes_into_every_format(folder, law):
    card = MaterialCard(LAWS[law], 0.8, "Valmex 7318", "")
    write_card(card, folder / "material.toml", "MPa")
    for name in FORMATS:
        run("material.toml", "--format", name)
        made = export(name, card)
        for suffix, text in made.files.items():
            assert (folder / f"material-{name}{suffix}").read_text() == text


def test_a_format_takes_its_own_options_only():
    with pytest.raises(InputError, match="--density: means nothing to the format csv"):
        FORMATS["csv"].export(CARD, density=1e-9)
    made = FORMATS["csv"].export(CARD, points=11, reach=0.1)
    assert "at 11 log strains each" in " ".join(made.says.carries)
    for each in FORMATS.values():
        for entry in dataclasses.fields(each.options):
            assert entry.metadata["option"].help.endswith(".")


def test_nothing_is_written_over_without_force(folder):
    run("material.toml", "--format", "abaqus-umat", "--out", "law.f")
    assert {p.name for p in folder.iterdir()} == {"material.toml", "law.f", "law.inp"}
    (folder / "law.f").unlink()
    (folder / "law.inp").write_text("mine")
    text = run("material.toml", "--format", "abaqus-umat", "--out", "law.f", code=2)
    assert text == "bubblefit: law.inp: is already there; use --force or another --out\n"
    # Neither of the two.
    assert (folder / "law.inp").read_text() == "mine" and not (folder / "law.f").exists()
    run("material.toml", "--format", "abaqus-umat", "--out", "law.f", "--force")
    assert (folder / "law.inp").read_text() != "mine" and (folder / "law.f").exists()


@pytest.mark.parametrize(
    ("words", "said"),
    [
        ("csv --out material.toml --force", "--out: material.toml is the card itself"),
        ("csv --out ./material.toml --force", "is the card itself"),
        ("abaqus-umat --out law.inp", "use .f"), ("csv --out file/t.csv", "choose another --out"),
        ("calculix --points 50", "--points: means nothing to the format calculix"),
        ("csv --density 1e-9", "--density: means nothing"),
        ("marc --measure true", "--measure: means nothing"),
    ],
)  # fmt: skip
def test_options_that_cannot_be(folder, words, said):
    (folder / "file").write_text("")
    before = (folder / "material.toml").read_text()
    text = run("material.toml", "--format", *words.split(), code=2)
    assert said in text and text.startswith("bubblefit: ") and text.count("\n") == 1
    assert (folder / "material.toml").read_text() == before
    assert {path.name for path in folder.iterdir()} == {"file", "material.toml"}


def test_into_a_folder(folder):
    (folder / "cards").mkdir()
    run("material.toml", "--format", "abaqus-umat", "--out", "cards")
    names = {path.name for path in (folder / "cards").iterdir()}
    assert names == {"material-abaqus-umat.f", "material-abaqus-umat.inp"}
    run("material.toml", "--format", "calculix", "--out", ".")
    assert (folder / "material-calculix.c").exists()


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ("nu12", "nu21", "material.toml: nu21: unknown key"),
        ("0.24", "1.24", "material.toml: nu12: expected 0 <= nu12 < 1, got 1.24"),
        ("unit = ", "unit = 3 #", "material.toml: unit: expected 'GPa', 'MPa' or 'Pa', got 3"),
        ("[", "", "material.toml: TOML syntax"),
    ],
)
def test_a_bad_card_is_named_with_its_field(folder, old, new, words):
    path = folder / "material.toml"
    path.write_text(path.read_text().replace(old, new, 1))
    for name in FORMATS:
        text = run("material.toml", "--format", name, code=2)
        assert words in text and text.count("\n") == 1
    assert list(folder.iterdir()) == [path]


@pytest.mark.parametrize("name", FORMATS)
def test_a_card_without_stiffness_is_bad_input(folder, name):
    gone = np.r_[0, 0, 0, 20.0, 0, 0, 0, 100.0, 0, 0, -1e4, 500.0]
    for law, words in (
        (HypoelasticLaw(gone, strain_range=[0.1, 0.1, 0.1]),
         "beta: E1 is -500 MPa at log strain 0.1, where the card is to hold; expected > 0"),
        (HypoelasticLaw(np.zeros(12)), "beta: E1 is 0 MPa at log strain 0,"),
        (HypoelasticLaw.linear(1.0, 1000.0, 20.0),
         "nu12: nu12 nu21 is not below 1 at zero strain, for nu12 = 0.24"),
    ):  # fmt: skip
        write_card(MaterialCard(law, 0.8), folder / "material.toml")
        text = run("material.toml", "--format", name, code=2)
        assert text.startswith(f"bubblefit: material.toml: {words}") and text.count("\n") == 1
    assert [path.name for path in folder.iterdir()] == ["material.toml"]


def test_a_card_that_fails_beyond_its_range_is_bad_input_where_a_curve_goes_there(folder):
    law = HypoelasticLaw(np.r_[0, 0, 0, 20.0, 0, 0, 0, 100.0, 0, 0, -1e4, 500.0])
    write_card(MaterialCard(law, 0.8), folder / "material.toml")
    text = run("material.toml", "--format", "csv", code=2)
    assert text.startswith("bubblefit: material.toml: beta: a modulus or 1 - nu12 nu21 is not pos")
    run("material.toml", "--format", "csv", "--reach", 0.04)
    run("material.toml", "--format", "abaqus-umat")


def test_json_points_and_a_missing_card(folder):
    run("material.toml", "--format", "csv", "--points", 11)
    assert len(pd.read_csv(folder / "material-csv.csv", comment="#")) == 33
    content = json.loads(run("material.toml", "--format", "calculix", "--json"))
    assert content["files"] == [f"material-calculix.{end}" for end in ("inp", "c", "law")]
    assert content["format"] == "calculix" and content["carries"] and content["loses"]
    assert "nowhere.toml: cannot be read" in run("nowhere.toml", "--format", "csv", code=2)


# MPa.
TABLE = 1e3 * np.array(TABLE_4_2)
CUBIC = HypoelasticLaw(TABLE, strain_range=np.array([0.13, 0.12, 0.14]))
MODULI_3 = ((800.0, 450.0, 900.0), (140.0, 110.0, 240.0), (20.0, 14.0, 40.0))
BREAKS = [[0.01, 0.03], [0.02, 0.06], [0.01, 0.04]]
TRILINEAR = HypoelasticLaw.trilinear(*MODULI_3, BREAKS, strain_range=[0.13, 0.05, 0.008])


def test_the_published_cubic_to_the_stated_error():
    tables = modulus_tables(CUBIC)
    assert set(tables) == set(COMPONENTS)
    for name, table in tables.items():
        end = CUBIC.strain_range[COMPONENTS[name]]
        # Beyond both ends, too: held, as the law does.
        strain = np.linspace(-0.3, 0.3, 20001)
        off = np.abs(table.at(strain) / CUBIC.modulus(name, strain) - 1)
        assert off.max() <= 1.01 * table.error
        assert table.error < 1e-3 and table.reaches
        assert len(table.strain) >= 121 and table.strain[-1] == end
        assert (np.diff(table.strain) > 0).all()
        assert np.array_equal(table.modulus, CUBIC.modulus(name, table.strain))


def test_the_error_falls_with_the_square_of_the_spacing():
    coarse, fine = (modulus_table(CUBIC, "E1", points).error for points in (61, 121))
    assert coarse / fine == pytest.approx(4.0, rel=0.1)


def test_stress_of_a_bar_from_the_tables_is_that_of_the_law():
    table = modulus_table(CUBIC, "E1")
    stress = trapezoid(table.modulus, table.strain)
    antiderivative = np.polyint(TABLE[8:])
    assert stress == pytest.approx(np.polyval(antiderivative, 0.13), rel=1e-4)


def test_shear_is_even():
    table = modulus_table(CUBIC, "G12")
    assert np.array_equal(table.strain, -table.strain[::-1])
    assert np.array_equal(table.modulus, table.modulus[::-1])
    assert table.strain[0] == -0.14
    assert modulus_table(CUBIC, "E1").strain[0] == 0


def test_a_jump_is_one_steep_line_after_its_break():
    table = modulus_table(TRILINEAR, "E1")
    assert table.error == 0
    assert table.at(0.01) == 800 and table.at(0.01 + JUMP) == pytest.approx(450, rel=1e-12)
    assert table.at(0.03) == pytest.approx(450, rel=1e-12) and table.at(0.03 + JUMP) == 900
    away = np.linspace(-0.02, 0.2, 4001)
    away = away[(np.abs(away[:, None] - [0.01, 0.03]) > 2 * JUMP).all(axis=1)]
    assert np.allclose(table.at(away), TRILINEAR.E1(away), rtol=1e-12)
    # Breaks beyond the range are not in the table.
    assert set(modulus_table(TRILINEAR, "E2").modulus) == {140.0, 110.0}
    assert set(modulus_table(TRILINEAR, "G12").modulus) == {20.0}


def test_a_spline_to_the_stated_error_with_a_point_at_every_knot():
    law = LAWS["spline"]
    for name, component in (("E1", 0), ("E2", 1), ("G12", 2)):
        table = modulus_table(law, name)
        end, knots = law.strain_range[component], KNOTS[component]
        strain = np.linspace(-0.3, 0.3, 20001)
        off = np.abs(table.at(strain) / law.modulus(name, strain) - 1)
        assert off.max() <= 1.01 * table.error and table.error < 2e-3
        assert np.abs(table.strain[:, None] - knots).min(axis=0).max() == 0
        # A knot does not lie beside an equally spaced strain, but instead of it.
        assert np.diff(table.strain).min() > 1e-5 and not len(table.jumps)
        assert table.strain[-1] == end and table.reaches


def test_jumps_and_kinks_are_in_the_table():
    law = LAWS["jumps and kinks"]
    warp, fill = modulus_table(law, "E1"), modulus_table(law, "E2")
    assert warp.jumps.tolist() == [0.01, 0.04] and fill.jumps.tolist() == []
    assert 0.03 in fill.strain and fill.error < 1e-12
    away = np.linspace(-0.02, 0.2, 4001)
    away = away[(np.abs(away[:, None] - warp.jumps) > 2 * JUMP).all(axis=1)]
    assert np.abs(warp.at(away) / law.E1(away) - 1).max() <= 1.01 * warp.error


@pytest.mark.parametrize("left", [1e-9, 5e-7, 1e-6, 2e-6, 1e-5])
def test_a_jump_just_before_the_end_of_the_range_is_in_the_table(left):
    short = HypoelasticLaw.trilinear(*MODULI_3, BREAKS, strain_range=[0.01 + left, 0.2, 0.2])
    table = modulus_table(short, "E1")
    assert table.strain[-1] == 0.01 + left and table.error == 0
    assert table.at(0.01) == 800 and table.at(0.02) == 450


def test_a_law_without_a_range_is_tabulated_as_far_as_asked():
    law = HypoelasticLaw(TABLE)
    table = modulus_table(law, "E1")
    assert not table.reaches and table.strain[-1] == REACH
    assert modulus_table(law, "E1", reach=0.1).strain[-1] == 0.1


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


def test_what_cannot_be_is_refused():
    assert "points" in complaint(modulus_table, CUBIC, "E1", 1)
    assert "reach" in complaint(modulus_table, CUBIC, "E1", reach=0.0)
