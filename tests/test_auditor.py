"""Small folders that no golden test leaves, for the auditor: unloaded yarns, an unknown beside the
moduli, frames of a camera that stands askew, a tube that is pulled and twisted."""

import json
import re
import shutil

import numpy as np
import pandas as pd
import pytest
from bubblefit.project.project import read_project
from bubblefit.runs.fit import fit

from .audit import audit, audit_printed
from .audit.checks import findings_of_estimate
from .builders.biaxial_tests import (
    BENT_LAW,
    biaxial_project,
    biaxial_rows,
    load_cycle,
    write_biaxial_rows,
)
from .builders.load_histories import load_history, write_history
from .builders.projects import computed_bubble_fields, constant_strips, known_bubble
from .experiments.test_tube import project as tube_project
from .support.commands import in_process

#: Of no strain energy: what a fill load does to the warp is not what a warp load does to the fill.
COMPLIANCE = np.array([[1 / 800, -0.35 / 640], [-0.42 / 800, 1 / 640]])


RATIOS = {"1:1": (1, 1), "2:1": (1, 0.5), "1:2": (0.5, 1), "1:0": (1, 0), "0:1": (0, 1)}


def findings(folder, base, **options):
    return [str(finding) for finding in audit(folder, base=base, **options).findings]


def test_biaxial_test_with_unloaded_yarns_and_no_energy_is_audited(tmp_path):
    rows = []
    for ratio, shares in RATIOS.items():
        for _ in range(2):
            loads = np.outer(load_cycle(0.0), shares)
            strain = 100 * loads @ COMPLIANCE.T
            rows += [(ratio, *n, *e) for n, e in zip(loads.tolist(), strain.tolist(), strict=True)]
    write_biaxial_rows(tmp_path / "test.csv", rows)
    biaxial_project(tmp_path)
    done = in_process("biaxial", "project.toml", "--free", "--out", "out", cwd=tmp_path)
    assert findings(tmp_path / "out", tmp_path, terminal=done.stdout) == []


def test_fit_to_a_biaxial_test_is_audited(tmp_path):
    rows = biaxial_rows(BENT_LAW, cycles=2, kept=0.05, rows=12)
    write_biaxial_rows(tmp_path / "test.csv", rows)
    biaxial_project(tmp_path, "noise = 0.01", form="constant")
    run = ("fit", "project.toml", "--out", "out", "--starts", 1, "--jobs", 1)
    printed = in_process(*run, cwd=tmp_path).stdout
    assert findings(tmp_path / "out", tmp_path, terminal=printed) == []
    file = tmp_path / "out" / "result.json"
    result = json.loads(file.read_text())
    for given in result["noise_given"].values():
        given["chi_square"] = (given["independent"] * given["chi_square"]) ** 0.5
    file.write_text(json.dumps(result))
    assert any("chi_square" in finding for finding in findings(tmp_path / "out", tmp_path))


def test_fit_to_a_tube_is_audited(tmp_path):
    tube_project(tmp_path)
    run = ("fit", "project.toml", "--out", "out", "--starts", 1, "--jobs", 1)
    printed = in_process(*run, cwd=tmp_path).stdout
    assert findings(tmp_path / "out", tmp_path, terminal=printed) == []
    result = fit(read_project(tmp_path / "project.toml"), starts=2)
    folder = result.report(tmp_path / "python").parent
    assert findings(folder, tmp_path) == []
    file = folder / "result.json"
    numbers = json.loads(file.read_text())
    errors = numbers["rms_percent"]
    numbers["rms_percent"] = dict(zip(errors, reversed(errors.values()), strict=True))
    file.write_text(json.dumps(numbers))
    assert any("rms_percent" in finding for finding in findings(folder, tmp_path))


@pytest.fixture(scope="module")
def beside(tmp_path_factory):
    """A fit of a bubble with the pressure's offset as an unknown."""
    folder = tmp_path_factory.mktemp("beside")
    known_bubble(folder, ("pressure_offset = false", "pressure_offset = true"))
    run = ("bubble", "project.toml", "--out", "out", "--starts", 1, "--jobs", 1)
    return folder, in_process(*run, cwd=folder).stdout


def test_fit_with_unknown_thickness_is_audited(beside):
    folder, printed = beside
    assert findings(folder / "out", folder, terminal=printed) == []


PROJECT = """
[fabric]
name = "made"
thickness = 0.8
[law]
form = "constant"
[law.bounds]
E1 = [0.05, 2.0]
E2 = [0.05, 2.0]
G12 = [0.001, 0.2]
[[bubble]]
radius = 100.0
pressures = [30, 60, 100]
elements = 108
[bubble.data.points]
files = ["f0.csv", "f1.csv", "f2.csv"]
columns = { x = "x", y = "y", z = "z", dx = "dx", dy = "dy", dz = "dz" }
length_unit = "mm"
[bubble.data.points.registration]
"""


def askew_frames(folder, prestrain=0.0, outliers=0):
    """Write frames of a camera turned by 20 degrees, with noise, and the project of them."""
    chance = np.random.default_rng(5)
    c, s = np.cos(np.radians(20.0)), np.sin(np.radians(20.0))
    turn = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
    for k, field in enumerate(computed_bubble_fields(pressures=[0.03, 0.06, 0.1], elements=300)):
        places = np.column_stack([field.points, np.zeros(len(field.points))]) @ turn.T
        strained = field.displacement + prestrain * places @ turn * (1.0, -0.2, 0.0)
        moved = strained @ turn.T + chance.normal(0.0, 0.02, field.displacement.shape)
        inner = np.flatnonzero(np.hypot(*field.points.T) < 80)
        moved[chance.choice(inner, outliers, replace=False), 2] += 9.0
        table = np.column_stack([np.add(places, (5.0, 2.0, 300.0)), moved])
        lines = [",".join(map(repr, row)) for row in table.tolist()]
        (folder / f"f{k}.csv").write_text("\n".join(["x,y,z,dx,dy,dz", *lines]) + "\n")
    warp = "warp = 20.0\n" if outliers else ""  # which outliers hide
    (folder / "project.toml").write_text(PROJECT + warp)


@pytest.mark.parametrize(("prestrain", "outliers"), [(0.0, 0), (0.02, 0), (0.0, 6)])
def test_check_of_frames_of_a_tilted_camera_is_audited(tmp_path, prestrain, outliers):
    """Strained along the warp before the first frame, or with outliers, too."""
    askew_frames(tmp_path, prestrain, outliers)
    done = in_process("check", "project.toml", "--out", "out", cwd=tmp_path)
    assert findings(tmp_path / "out", tmp_path, terminal=done.stdout) == []
    file = tmp_path / "out" / "check.json"
    text = file.read_text()
    file.write_text(re.sub(r"\d\.\d%\)", "1.9%)", text))
    assert bool(outliers) == any(
        "expected '2.1'" in f for f in findings(tmp_path / "out", tmp_path)
    )


def test_fit_to_frames_of_a_tilted_camera_is_audited(tmp_path):
    """Origin and axes of the registration are those by which residuals.csv has its places."""
    askew_frames(tmp_path)
    run = ("bubble", "project.toml", "--out", "out", "--starts", 1, "--jobs", 1)
    printed = in_process(*run, cwd=tmp_path).stdout
    assert findings(tmp_path / "out", tmp_path, terminal=printed) == []
    file = tmp_path / "out" / "result.json"
    result = json.loads(file.read_text())
    result["tests"]["bubble"]["registration"]["origin_mm"][0] += 0.01
    result["registration"]["centre"]["error_mm"] *= 2.0
    file.write_text(json.dumps(result))
    seen = " ".join(findings(tmp_path / "out", tmp_path))
    assert "are not those of f0.csv" in seen and "registration.centre" in seen


def test_fit_that_counts_from_a_pressure_is_audited(tmp_path):
    askew_frames(tmp_path)
    path = tmp_path / "project.toml"
    text = path.read_text().replace("elements = 108", "elements = 300")
    path.write_text(text + "[bubble.sheet]\nfrom_pressure = 30\n")
    run = ("bubble", "project.toml", "--out", "out", "--starts", 1, "--jobs", 1)
    printed = in_process(*run, cwd=tmp_path).stdout
    assert findings(tmp_path / "out", tmp_path, terminal=printed) == []
    file = tmp_path / "out" / "result.json"
    result = json.loads(file.read_text())
    result["tests"]["bubble"]["sheet"]["from_pressure_kPa"] = 60.0
    file.write_text(json.dumps(result))
    assert "from_pressure" in " ".join(findings(tmp_path / "out", tmp_path))


def test_estimate_is_audited(tmp_path):
    constant_strips(tmp_path)
    printed = in_process("estimate", "project.toml", "--test", "two", "--json", cwd=tmp_path).stdout
    estimate = json.loads(printed)
    assert findings_of_estimate(estimate, 0.8) == []
    assert len(findings_of_estimate(estimate, 0.81)) == sum(map(len, estimate["moduli"].values()))
    estimate["moduli"]["G12"][0]["determined"] = True
    (finding,) = findings_of_estimate(estimate, 0.8)
    assert "determined is True" in finding


def test_printed_numbers_of_tubes_are_audited(tmp_path):
    printed = in_process("verify", "--subject", "loaded tubes", cwd=tmp_path).stdout
    assert audit_printed("verify", printed, tmp_path).findings == []
    share = printed.replace("+0.0006 %", "+0.0600 %")
    assert share != printed and audit_printed("verify", share, tmp_path).findings


def test_creep_and_recorded_pressures_are_audited(tmp_path, beside):
    """Holds are evaluated anew from their file; times of a collection are its files' pressures."""
    time, load, strain = load_history(points=80)
    top = int(np.argmax(load[:90]))
    since = np.arange(1, 201) * 0.5
    held = strain[top] + 1e-4 * np.log10(1 + 100 * since)
    columns = (
        np.r_[time[: top + 1], time[top] + since, time[top + 1 :] + since[-1]],
        np.r_[load[: top + 1], np.full(200, load[top]), load[top + 1 :]],
        np.r_[strain[: top + 1], held, strain[top + 1 :]],
    )
    write_history(tmp_path / "held.csv", ["time_s,load_N,strain"], columns)
    printed = in_process("cycles", "held.csv", "--out", "out", cwd=tmp_path).stdout
    assert findings(tmp_path / "out", tmp_path, terminal=printed) == []
    file = tmp_path / "out" / "holds.csv"
    table = pd.read_csv(file)
    table["strain_per_decade"] /= np.log(10)
    table.to_csv(file, index=False)
    (finding,) = findings(tmp_path / "out", tmp_path)
    assert "strain_per_decade" in finding

    folder, _ = beside
    copied = shutil.copytree(folder / "out", tmp_path / "bubble")
    file = copied / "bubble.pvd"
    file.write_text(re.sub(r'timestep="([\d.]+)"', r'timestep="0.0\1"', file.read_text()))
    assert any("bubble.pvd" in finding for finding in findings(copied, folder))
