"""Each test left out of the fit in turn: what is foretold of it, in closed form and on bubbles."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from bubblefit.errors import InputError, SolverFailure
from bubblefit.materials.card import MaterialCard, write_card
from bubblefit.materials.law import HypoelasticLaw
from bubblefit.notes import NoteKind
from bubblefit.project.project import read_project
from bubblefit.runs.setup import prepare_fit
from bubblefit.runs.validation import held_out, judge_cards, validate
from bubblefit.solvers.membrane.solver import MembraneSolver

from ..commands import bubblefit, in_process
from ..places import KNOWN
from ..projects import ELONGATION, MODULI, changed, constant_strips


def warp_of_two(modulus: float) -> tuple[float, float]:
    """RMS (N) of a constant E1 (MPa) at the test "two", and over its largest load.

    Its gauge ends at 22.5 mm; loads are 20 E ln(1 + u/20).
    """
    strain = np.log1p(ELONGATION[ELONGATION <= 2.5] / 20)
    loads = np.concatenate([20 * e * strain for e in MODULI["two"]["warp"]])
    rms = float(np.sqrt(np.mean((20 * modulus * np.tile(strain, 2) - loads) ** 2)))
    return rms, rms / loads.max()


def test_what_a_fit_to_the_other_test_foretells(tmp_path: Path) -> None:
    """The fit to "one" has the mean of its specimens' moduli, 330 MPa; "two" has 330 and 410."""
    project = read_project(constant_strips(tmp_path))
    told: list[str] = []
    found = validate(
        project, starts=1, out=tmp_path / "out",
        progress=lambda event: told.append(event) if isinstance(event, str) else None,
    )  # fmt: skip
    assert told == ["constant: all tests", "constant: without one", "constant: without two"]
    assert [one.foretold.test for one in found.judged] == ["one", "two"]
    two = found.judged[1]
    rms, relative = warp_of_two(330.0)
    assert two.foretold.rms == {"two: warp": pytest.approx(rms, rel=1e-4)}
    assert two.foretold.error == pytest.approx(relative, rel=1e-4)
    assert two.foretold.units == {"two: warp": "N"}
    # Given the test itself, it is nearer to it: both tests' warp strips pull at E1.
    assert two.fitted is not None and two.fitted.error < two.foretold.error
    found.write(tmp_path / "out")
    table = pd.read_csv(tmp_path / "out" / "validation.csv")
    pd.testing.assert_frame_equal(table, found.table(), rtol=1e-8)
    row = table[table["test"] == "two"].iloc[0]
    assert row["foretold_rms"] == pytest.approx(rms, rel=1e-4)
    assert row["fitted_rms"] == pytest.approx(two.fitted.rms["two: warp"])
    said = json.loads((tmp_path / "out" / "result.json").read_text())
    assert said["mean_foretold"]["constant"] == pytest.approx(
        (found.judged[0].foretold.error + relative) / 2, rel=1e-4
    )
    folders = {path.name for path in (tmp_path / "out").iterdir() if path.is_dir()}
    assert folders == {"constant-all", "constant-without-1", "constant-without-2"}
    assert all((tmp_path / "out" / name / "report.html").exists() for name in folders)
    # In the test's own words, too, as after a fit.
    own = two.foretold.rms["two: warp"]
    assert f"constant, two: RMS errors in N: warp {own:.4g}" in found.lines()
    assert two.foretold.numbers["e_uniaxial_N"] == pytest.approx(rms, rel=1e-4)
    assert found.lines()[-1] == (
        f"constant: foretold {100 * said['mean_foretold']['constant']:.3g} % on average"
    )


def test_a_card_is_judged_without_a_fit(tmp_path: Path) -> None:
    path = constant_strips(tmp_path)
    law = HypoelasticLaw.linear(350.0, 190.0, 60.0, 0.0)
    law = replace(law, strain_range=np.array([0.1, 0.14, 0.1]))
    write_card(MaterialCard(law, 0.8, "made"), tmp_path / "card.toml")
    command = ("validate", "project.toml", "--card", "card.toml", "--out", "judged")
    done = bubblefit(*command, cwd=tmp_path)
    table = pd.read_csv(tmp_path / "judged" / "validation.csv")
    rms, relative = warp_of_two(350.0)
    row = table[table["test"] == "two"].iloc[0]
    assert (row["foretold_rms"], row["foretold_relative"]) == pytest.approx(
        (rms, relative), rel=1e-4
    )
    assert np.isnan(row["fitted_rms"])
    assert (
        "made, two: warp strain 0.118 is beyond 0.100, up to which the law is known" in done.stdout
    )
    assert f"{rms:12.4g}" in done.stdout and path.exists()
    again = bubblefit(*command, cwd=tmp_path, code=2)
    assert "judged" in again.stderr and "--overwrite" in again.stderr


def test_a_card_of_another_thickness_is_refused(tmp_path: Path) -> None:
    project = read_project(constant_strips(tmp_path))
    card = MaterialCard(HypoelasticLaw.linear(350.0, 190.0, 60.0, 0.0), 1.0, "thick")
    with pytest.raises(InputError, match=r"fabric\.thickness: thick: .* 1 mm"):
        judge_cards(project, {"thick": card})


def test_one_test_cannot_be_left_out(tmp_path: Path) -> None:
    constant_strips(tmp_path)
    done = in_process("validate", "project.toml", "--test", "one", cwd=tmp_path, code=2)
    assert "one test is left out of two or more: there is only one" in done.output


def test_what_is_no_law_is_fitted_to_the_test_left_out(tmp_path: Path) -> None:
    """Displacement offsets of a bubble belong to its camera, not to the fabric."""
    text = changed(
        KNOWN.read_text(),
        ("elements = 800", "elements = 48"),
        ("displacement_offset = false", "displacement_offset = true"),
    )
    (tmp_path / "project.toml").write_text(text)
    project = read_project(tmp_path / "project.toml")
    setup = prepare_fit(project, project.chosen(None, fitted=True))
    (prepared,) = setup.tests
    moved = tuple(
        replace(f, displacement=f.displacement + np.array([0.0, 0.0, 1.5])) for f in prepared.fields
    )
    law = prepared.known
    plain = held_out(prepared, law, setup.make_solver)
    shifted = held_out(replace(prepared, fields=moved), law, setup.make_solver)
    assert plain.error < 1e-6
    assert shifted.error < 1e-3
    off = setup.project.tests["bubble"]
    without = replace(prepared, fields=moved, test=replace(off, displacement_offset=False))
    found = held_out(without, law, setup.make_solver)
    assert found.error > 0.015
    assert found.rms == {"bubble": pytest.approx(1.5 / np.sqrt(3.0), rel=1e-6)}


def test_a_law_that_cannot_be_run_is_told(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    project = read_project(constant_strips(tmp_path))
    setup = prepare_fit(project, project.chosen(None, fitted=True))

    def tired(*_: object, **__: object) -> None:
        raise SolverFailure("too tired", "membrane")

    monkeypatch.setattr(MembraneSolver, "run", tired)
    law = HypoelasticLaw.linear(350.0, 190.0, 60.0, 0.0)
    law = replace(law, strain_range=np.array([0.1, 0.14, 0.1]))
    found = held_out(setup.tests[1], law, setup.make_solver)
    assert found.error is None and found.rms == {}
    (note,) = found.notes
    assert note.kind is NoteKind.FAILED and note.of == "two"
    assert "too tired" in note
