"""Folders of studies, simulations and bent cylinders: audited, and found out when disturbed."""

import json
from contextlib import suppress

import numpy as np
import pytest
from bubblefit.solvers import registry

from .audit import audit
from .builders.bent_cylinders import (
    STOPS,
    ClosedFormCylinder,
    CylinderWithBand,
    write_cylinder_project,
    write_cylinder_readings,
)
from .builders.projects import constant_strips, known_bubble
from .experiments.cylinder.cases import BEAM
from .support.commands import in_process
from .support.disturbed_folders import (
    DISTURBANCES,
    disturb_cell,
    disturb_json,
    disturb_page,
    disturb_rows,
    disturbed,
)

PLACES = 'measured.files = ["read.csv"]\nplaces'


CARD = ("--card", "out/material.toml")


#: By the folder that a command leaves: what is typed beside a fit of constant strips. Further
#: ones are audited where their golden files are compared.
STUDIES = {
    "profile": ("profile", "project.toml", "--modulus", "E1=0.05", "--modulus", "G12", *CARD),
    "bootstrap": ("bootstrap", "project.toml", "--over", "specimens", "--samples", 4, *CARD),
    "plan": ("plan", "project.toml", "--rank", "E2", *CARD),
    "specimens": ("validate", "project.toml", "--leave", "specimens", "--starts", 1),
    "weights": ("validate", "project.toml", "--weights", "one", "--starts", 1),
    "mesh": ("study", "mesh", "project.toml", "--levels", 2, *CARD),
    "increments": (
        *("study", "mesh", "project.toml", "--what", "increments", "--levels", 3),
        *("--test", "two", *CARD),
    ),
    "nu12": ("study", "nu12", "project.toml", "--nu12", 0.1, "--nu12", 0.3, *CARD),
    "test": ("simulate", "test", "project.toml", *CARD),
    "within": ("simulate", "uniaxial", "project.toml", "--within-range", *CARD),
}


#: Options that not all of them have.
QUIET = {"profile", "bootstrap", "plan", "validate"}


@pytest.fixture(scope="module")
def ran(tmp_path_factory):
    """Return a function that runs a study once and returns its folder and what it printed."""
    folder, printed = tmp_path_factory.mktemp("studies"), {}
    constant_strips(folder, ("seed = 7", "seed = 7\njobs = 1"))
    in_process("fit", "project.toml", "--out", "out", "--starts", 1, "--quiet", cwd=folder)

    def run(name):
        if name not in printed:
            words = [*STUDIES[name], "--out", name]
            words += ["--quiet"] if STUDIES[name][0] in QUIET else []
            printed[name] = in_process(*words, cwd=folder).stdout
        return folder, printed[name]

    return run


def share_unclaimed(ledger):
    counts = ledger.counts()
    total = sum(sum(own.values()) - own["exempt"] for own in counts.values())
    return sum(own["unclaimed"] for own in counts.values()) / total


@pytest.mark.parametrize("name", STUDIES)
def test_study_reports_what_the_auditor_computes(ran, name):
    folder, printed = ran(name)
    ledger = audit(folder / name, terminal=printed, base=folder)
    assert [str(finding) for finding in ledger.findings] == []
    assert share_unclaimed(ledger) == 0 and printed


def missed_of(folder, printed, base, target, disturbances, count, seed):
    """Disturb copies of a folder; return what the auditor did not see, and how many there were."""
    random, missed, total = np.random.default_rng(seed), [], 0
    for disturb in disturbances:
        for _ in range(count):
            change = disturbed(folder, target, disturb, random)
            if change is None:
                continue
            total += 1
            with suppress(AssertionError):  # a table that does not fit itself is found, too
                if not audit(target, terminal=printed, base=base).findings:
                    missed.append(change)
    return missed, total


@pytest.mark.parametrize("name", ["profile", "bootstrap", "plan", "specimens", "nu12", "mesh"])
def test_disturbed_study_is_noticed(ran, name, tmp_path):
    folder, printed = ran(name)
    missed, total = missed_of(folder / name, printed, folder, tmp_path / "x", DISTURBANCES, 2, 5)
    assert total >= 6 and len(missed) <= 1, missed


def test_wrong_log_likelihood_is_found(ran, tmp_path):
    folder, printed = ran("profile")
    target = tmp_path / "x"

    def halve(place, _):
        file = place / "result.json"
        result = json.loads(file.read_text())
        for profile in result["profiles"]:
            curve = np.array(profile["curve_minus_2_log_L"])
            profile["curve_minus_2_log_L"] = (0.5 * curve).tolist()
        file.write_text(json.dumps(result))
        return "halved"

    disturbed(folder / "profile", target, halve, None)
    found = [str(finding) for finding in audit(target, terminal=printed, base=folder).findings]
    assert any("times what 1 sigma gives" in finding for finding in found)


@pytest.fixture(scope="module")
def bubble(tmp_path_factory):
    folder = tmp_path_factory.mktemp("bubble")
    known_bubble(folder)
    (folder / "card.toml").write_text(
        'format = 2\nname = "plain"\nsource = ""\nlaw = "hypoelastic orthotropic"\n'
        'form = "constant"\nunit = "GPa"\nbeta = [0.0, 0.0, 0.0, 0.02, 0.0, 0.0, 0.0, 0.2,'
        ' 0.0, 0.0, 0.0, 0.5]\nnu12 = 0.24\nthickness_mm = 0.81\nthickness_change = "constant"\n'
    )
    run = ("simulate", "bubble", "project.toml", "--card", "card.toml", "--out", "simulated")
    return folder, in_process(*run, cwd=folder).stdout


def test_simulated_bubble_is_audited(bubble, tmp_path):
    folder, printed = bubble
    ledger = audit(folder / "simulated", terminal=printed, base=folder)
    assert [str(finding) for finding in ledger.findings] == []
    missed, total = missed_of(
        folder / "simulated", printed, folder, tmp_path / "x", [disturb_json], 4, 2
    )
    assert total == 4 and missed == []


@pytest.fixture
def formula(monkeypatch):
    monkeypatch.setitem(registry.SOLVERS, "formula", ClosedFormCylinder)
    monkeypatch.setitem(registry.SOLVERS, "banded", CylinderWithBand)


@pytest.mark.usefixtures("formula")
def test_bands_of_bent_cylinders_by_card_and_wall_are_audited(ran, tmp_path):
    folder, _ = ran("profile")
    (tmp_path / "made.toml").write_text((folder / "out" / "material.toml").read_text())
    project = write_cylinder_project(tmp_path)
    text = project.read_text().replace('solver = "formula"', 'solver = "banded"')
    project.write_text(text.replace("thickness = 0.81", "thickness = 0.8"))
    run = ("bend", project, "--card", "made.toml", "--out", "out", "--quiet", "--jobs", 1)
    printed = in_process(*run, "--test", "high", cwd=tmp_path).stdout
    ledger = audit(tmp_path / "out", terminal=printed, base=tmp_path)
    assert [str(finding) for finding in ledger.findings] == []


def test_braided_beam_is_audited(tmp_path):
    text = BEAM.replace("angle = 65.0", "angle = 56.5").replace("places", PLACES)
    (tmp_path / "project.toml").write_text(text)
    (tmp_path / "read.csv").write_text("deflection [mm],load [N]\n0,0\n20,200\n40,400\n")
    printed = in_process("bend", "project.toml", "--out", "out", "--quiet", cwd=tmp_path).stdout
    ledger = audit(tmp_path / "out", terminal=printed, base=tmp_path)
    assert [str(finding) for finding in ledger.findings] == []
    assert "half a degree" in printed


@pytest.mark.usefixtures("formula")
def test_bent_cylinders_are_audited(tmp_path):
    write_cylinder_readings(tmp_path / "made-up.csv", 3.5, noise=0.02)
    project = write_cylinder_project(tmp_path, 'measured.files = ["made-up.csv"]', soft=STOPS)
    printed = in_process("bend", project, "--out", "out", "--quiet", cwd=tmp_path).stdout
    ledger = audit(tmp_path / "out", terminal=printed, base=tmp_path)
    assert [str(finding) for finding in ledger.findings] == []
    every = (disturb_json, disturb_cell, disturb_rows, disturb_page)
    missed, total = missed_of(tmp_path / "out", printed, tmp_path, tmp_path / "x", every, 4, 3)
    assert total == 16 and len(missed) <= 1, missed

    # A run that stopped early is not counted among those that finished.
    def finished(place, _):
        page = place / "report.html"
        text = page.read_text().replace("2 of 4 runs", "4 of 4 runs")
        page.write_text(text.replace("2\u00a0of\u00a04\u00a0runs", "4\u00a0of\u00a04\u00a0runs"))
        return text

    disturbed(tmp_path / "out", tmp_path / "x", finished, None)
    assert audit(tmp_path / "x", terminal=printed, base=tmp_path).findings


def test_information_of_each_test_is_audited(ran, tmp_path):
    folder, printed = ran("profile")
    target = tmp_path / "x"

    def exchange(place, _):
        file = place / "result.json"
        result = json.loads(file.read_text())
        pinned = result["pinned"]
        pinned["one"], pinned["two"] = pinned["two"], pinned["one"]
        file.write_text(json.dumps(result))
        return "exchanged"

    disturbed(folder / "out", target, exchange, None)
    found = [str(finding) for finding in audit(target, terminal=printed, base=folder).findings]
    assert any("without fill strips knows more" in finding for finding in found)


def test_wrong_moduli_in_study_of_weights_are_found(ran, tmp_path):
    folder, printed = ran("weights")
    target = tmp_path / "x"

    def stale(place, _):
        file = place / "result.json"
        result = json.loads(file.read_text())
        first = next(row for row in result["rows"] if row["weight_times"] == 1)
        for row in result["rows"]:
            row["moduli_MPa"] = first["moduli_MPa"]
        file.write_text(json.dumps(result))
        return "stale"

    disturbed(folder / "weights", target, stale, None)
    found = [str(finding) for finding in audit(target, terminal=printed, base=folder).findings]
    assert any("rows.0.moduli_MPa.E1" in finding for finding in found)
