"""`bubblefit doctor`, finding ccx, and the bars against Marc's published end stresses."""

import csv
import json
import os
import shutil
import subprocess

import numpy as np
import pytest
from bubblefit.errors import InputError, SolverFailure
from bubblefit.solvers.bars import BARS, bar_law
from bubblefit.solvers.calculix import solver as proof
from bubblefit.solvers.calculix.executable import carries_external, every_ccx, find_ccx
from bubblefit.solvers.calculix.library import (
    MATERIAL,
    constants,
    law_files,
    law_number,
    material_library,
)
from bubblefit.solvers.calculix.solver import bar_deck, prove

from ..commands import in_process
from ..complaints import complaint
from ..places import PUBLISHED, ROOT
from ..programs import program


def fake(path, version="2.99", then="exit 0"):
    return program(path, f'#!/bin/sh\n[ "$1" = -v ] && echo "This is Version {version}"\n{then}\n')


@pytest.fixture
def bare(tmp_path, monkeypatch):
    (tmp_path / "bin").mkdir()
    (tmp_path / "cache").mkdir()
    monkeypatch.setenv("PATH", str(tmp_path / "bin"))
    monkeypatch.setenv("BUBBLEFIT_CACHE", str(tmp_path / "cache"))
    monkeypatch.delenv("BUBBLEFIT_CCX", raising=False)
    return tmp_path


def doctor(*arguments, code=0):
    return in_process("doctor", *arguments, cwd=ROOT, code=code).stdout


def test_the_bars_are_the_published_ones():
    text = (PUBLISHED / "marc_uniaxial_end_stress.csv").read_text()
    rows = csv.DictReader(line for line in text.splitlines() if not line.startswith("#"))
    for row, bar in zip(rows, BARS, strict=True):
        assert (row["model"], row["direction"]) == (bar.model, bar.direction)
        assert [float(row[f"c{i}"]) for i in range(4)] == list(bar.modulus)
        assert float(row["end_strain_engineering"]) == bar.elongation
        assert float(row["marc_end_stress_MPa"]) == bar.stress
    # The integral of the published coefficients itself is up to 6e-5 off the published stress.
    for bar in BARS:
        antiderivative = np.polyint(1e3 * np.array(bar.modulus[::-1]))
        exact = np.polyval(antiderivative, np.log1p(bar.elongation))
        assert abs(exact / bar.stress - 1) < 6e-5


def run_deck(ccx, folder, deck):
    (folder / "job.inp").write_text(deck)
    for bar in BARS:
        for name, text in law_files(bar_law(bar.model)).items():
            (folder / name).write_text(text)
    done = subprocess.run(
        [ccx.path, "job"], cwd=folder, capture_output=True, text=True, timeout=120,
        env={**os.environ, "LD_LIBRARY_PATH": str(material_library().parent)},
    )  # fmt: skip
    return done, (folder / "job.dat").read_text() if (folder / "job.dat").exists() else ""


@pytest.mark.parametrize(
    ("angle", "axis", "orientation"),
    [
        # The deck pulls along x; in each the fill lies along x by another way.
        (0.0, 3, "*ORIENTATION, NAME=TURNED\n0., 1., 0., -1., 0., 0.\n"),
        (90.0, 3, "*ORIENTATION, NAME=TURNED\n-1., 0., 0., 0., -1., 0.\n"),
        # Far out on a cylinder about y, z is radial and x is the hoop direction.
        (0.0, 1, "*ORIENTATION, NAME=TURNED, SYSTEM=CYLINDRICAL\n0.5,0.,-1e6, 0.5,1.,-1e6\n"),
        (90.0, 1, "*ORIENTATION, NAME=TURNED, SYSTEM=CYLINDRICAL\n0.,0.,-1e6, 1.,0.,-1e6\n"),
    ],
)
def test_ccx_hands_over_the_orientation_of_the_section(ccx, tmp_path, angle, axis, orientation):
    bar = BARS[1]
    assert bar.direction == "fill"
    straight, turned = (
        ",".join(f"{v:.12e}" for v in constants(bar_law(bar.model), angle=a, normal_axis=n)[4:7])
        for a, n in ((-90.0, 3), (angle, axis))
    )
    deck = bar_deck()
    head, tail = deck.split("*MATERIAL, NAME=" + MATERIAL + "@BAR1", 1)
    spaced = straight.replace(",", ", ")
    assert spaced in tail
    tail = tail.replace(spaced, turned, 1)
    section = f"MATERIAL={MATERIAL}@BAR1"
    tail = tail.replace(section, section + ", ORIENTATION=TURNED", 1)
    deck = f"{head}{orientation}*MATERIAL, NAME={MATERIAL}@BAR1{tail}"
    done, printed = run_deck(ccx, tmp_path, deck)
    assert done.returncode == 0, done.stdout[-2000:]
    assert proof._end_stresses(printed)[1] == pytest.approx(bar.stress, rel=1e-4)


def test_a_modulus_that_runs_out_makes_ccx_cut_its_increments(ccx, tmp_path):
    law = bar_law("direct")
    beta = law.beta.copy()
    beta[8:] = 0, 0, -1e4, 500.0  # E1 is gone at 5 % strain
    gone = law.with_beta(beta)
    for name, text in law_files(gone).items():
        (tmp_path / name).write_text(text)
    number = f"{law_number(law):.12e}"
    assert bar_deck().count(number) == 2
    deck = bar_deck().replace(number, f"{law_number(gone):.12e}")
    done, printed = run_deck(ccx, tmp_path, deck.replace("*STATIC, DIRECT", "*STATIC"))
    assert "requested by a material user routine" in done.stdout
    assert done.returncode != 0 and not proof._end_stresses(printed)
    done, _ = run_deck(ccx, tmp_path, bar_deck().replace("*DEPVAR\n6", "*DEPVAR\n3"))
    assert done.returncode == 201
    assert "*ERROR in HYPOELASTIC: 9 constants and *DEPVAR 6 are needed" in done.stdout


def test_every_ccx_by_preference(bare, monkeypatch):
    with pytest.raises(SolverFailure, match=r"no ccx.*make calculix"):
        find_ccx()
    named, chosen = fake(bare / "mine" / "ccx"), fake(bare / "other" / "ccx-2")
    built = fake(bare / "cache" / "calculix" / "ccx-2.99-external" / "ccx")
    system = fake(bare / "bin" / "ccx_2.99")
    fake(bare / "bin" / "ccx2paraview")
    monkeypatch.setenv("BUBBLEFIT_CCX", str(chosen))
    # A script cannot be looked into: external is None.
    assert [(one.path, one.origin, one.version, one.external) for one in every_ccx(named)] == [
        (named, "named", "2.99", None), (chosen, "BUBBLEFIT_CCX", "2.99", None),
        (built, "make calculix", "2.99", None), (system, "PATH", "2.99", None),
    ]  # fmt: skip
    assert [one.path for one in every_ccx(chosen)].count(chosen) == 1
    assert find_ccx(named).path == named and find_ccx().path == chosen
    monkeypatch.delenv("BUBBLEFIT_CCX")
    assert find_ccx().path == built
    built.unlink()
    assert find_ccx().path == find_ccx("ccx_2.99").path == system


def test_a_ccx_without_material_libraries_is_passed_over_or_refused(bare):
    plain = bare / "bin" / "ccx"
    shutil.copy("/bin/true", plain)
    assert carries_external(plain) is False
    with pytest.raises(SolverFailure, match=f"{plain} cannot.*make calculix"):
        find_ccx()
    with pytest.raises(SolverFailure, match="cannot load material libraries"):
        find_ccx(plain)
    better = fake(bare / "bin" / "ccx_3")
    assert find_ccx().path == better


@pytest.mark.parametrize("by", ["argument", "variable"])
def test_a_ccx_that_was_named_and_is_not_there_is_bad_input(bare, monkeypatch, by):
    missing = bare / "nowhere" / "ccx"
    fake(bare / "bin" / "ccx")
    if by == "variable":
        monkeypatch.setenv("BUBBLEFIT_CCX", str(missing))
    with pytest.raises(InputError, match=r"nowhere/ccx: .*no such file"):
        find_ccx(missing if by == "argument" else None)
    missing.parent.mkdir()
    missing.write_text("")
    assert "not executable" in complaint(find_ccx, missing)


FAULTS = {
    "garbage": ("printf garbage > bars.dat", "printed no end stresses"),
    "nothing": ("exit 0", "did not end well"),
    "killed": ("kill -9 $$", "did not end well"),
    "refusing": ("echo '*ERROR reading'; exit 201", r"exit number 201\)"),
    "hanging": ("exec sleep 60", "took more than"),
    "earlier": (
        "printf ' stresses (elem, integ.pnt.,sxx) for set BAR0 and time  0.5000000E+00\\n\\n"
        "  1  1  62.677 0 0 0 0 0\\n' > bars.dat",
        "printed no end stresses",
    ),
}


@pytest.mark.parametrize("fault", FAULTS)
def test_a_program_that_is_no_ccx_is_no_proof(tmp_path, fault):
    action, words = FAULTS[fault]
    library = tmp_path / "libBUBBLEFIT.so"
    with pytest.raises(SolverFailure, match=words):
        prove(fake(tmp_path / "ccx", then=action), library, timeout=1.0)


def test_a_ccx_with_another_law_is_no_proof(tmp_path):
    rows = "".join(
        f" stresses (a) for set BAR{i} and time  0.1000000E+01\\n\\n"
        f" {i + 1}  1  {1.001 * bar.stress:.7E} 0 0 0 0 0\\n\\n"
        for i, bar in enumerate(BARS)
    )
    liar = fake(tmp_path / "ccx", then=f"printf '{rows}' > bars.dat")
    with pytest.raises(SolverFailure, match=r"does not carry the law \(direct warp bar: 62.74"):
        prove(liar, tmp_path / "libBUBBLEFIT.so")


def test_doctor_accepts_a_good_ccx(ccx, monkeypatch):
    monkeypatch.setenv("BUBBLEFIT_CCX", str(ccx.path))
    content = json.loads(doctor("--json"))
    assert content["ok"]
    by_path = {one["path"]: one for one in content["solvers"]}
    assert by_path[None]["name"] == "membrane"
    mine = by_path[str(ccx.path)]
    assert mine["usable"] and mine["external_materials"] and mine["difference"] < 1e-4
    assert mine["stresses"] == pytest.approx([bar.stress for bar in BARS], rel=1e-4)
    # The same increments in the embedded law: all seven digits that ccx prints.
    assert mine["stresses"] == pytest.approx(by_path[None]["stresses"], rel=1e-6)


def test_doctor_fails_for_a_ccx_that_was_named(bare, monkeypatch):
    broken = fake(bare / "mine" / "ccx", then="exit 3")
    cc = shutil.which("cc", path=os.defpath) or shutil.which("gcc", path=os.defpath)
    monkeypatch.setenv("CC", cc or "cc")
    monkeypatch.setenv("PATH", os.defpath)
    text = doctor("--ccx", broken, code=4)
    assert f"{broken} (named)" in text and "cannot be seen" in text
    monkeypatch.setenv("BUBBLEFIT_CCX", str(bare / "nowhere"))
    text = doctor(code=4)
    assert "no such file" in text
