"""Single frames, specimens and directions left out of a fit, in closed form and on bubbles."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from bubblefit.errors import InputError
from bubblefit.experiments.kinds import Weighting
from bubblefit.project.project import read_project
from bubblefit.runs import validation as left_out
from bubblefit.runs.result import Fit
from bubblefit.runs.setup import FitSetup, prepare_fit
from bubblefit.runs.validation import parts_of, validate, without

from ..commands import in_process
from ..projects import BUBBLE, ELONGATION, constant_strips, project_file


@pytest.fixture(autouse=True)
def without_pages(monkeypatch: pytest.MonkeyPatch) -> None:
    """The pages of the fits are no matter here, and take most of the time."""
    monkeypatch.setattr(Fit, "report", lambda self, folder: Path(folder))


#: Logarithmic strains of the points of "one", whose gauges end at 22.9 mm.
STRAIN = np.log1p(ELONGATION[ELONGATION <= 2.9] / 20)


def off_by(modulus: float, true: float) -> tuple[float, float]:
    """RMS (N) of a constant modulus (MPa) at a specimen of another, and over its largest load."""
    rms = 20 * abs(modulus - true) * float(np.sqrt(np.mean(STRAIN**2)))
    return rms, rms / (20 * true * STRAIN.max())


def test_a_specimen_is_foretold_by_the_other(tmp_path: Path) -> None:
    """Of two specimens a direction (E1 300 and 360, E2 200 and 180 MPa) one knows only itself."""
    constant_strips(tmp_path)
    command = ("validate", "project.toml", "--test", "one", "--leave", "specimens")
    done = in_process(*command, "--starts", "1", "--out", "out", cwd=tmp_path)
    table = pd.read_csv(tmp_path / "out" / "validation.csv").set_index("test")
    expected = {
        "one: warp, specimen a": (off_by(360, 300), off_by(330, 300)),
        "one: warp, specimen b": (off_by(300, 360), off_by(330, 360)),
        "one: fill, specimen a": (off_by(180, 200), off_by(190, 200)),
        "one: fill, specimen b": (off_by(200, 180), off_by(190, 180)),
    }
    assert sorted(table.index) == sorted(expected)
    for name, (foretold, fitted) in expected.items():
        row = table.loc[name]
        own = row["foretold_rms"], row["foretold_relative"]
        assert own == pytest.approx(foretold, rel=1e-3), name
        own = row["fitted_rms"], row["fitted_relative"]
        assert own == pytest.approx(fitted, rel=1e-3), name
    mean = np.mean([foretold[1] for foretold, _ in expected.values()])
    assert f"constant: foretold {100 * mean:.3g} % on average" in done.output
    said = json.loads((tmp_path / "out" / "result.json").read_text())
    assert said["left_out"] == "specimens"
    assert said["mean_foretold"]["constant"] == pytest.approx(mean, rel=1e-3)


def test_a_direction_is_foretold_by_the_other_test(tmp_path: Path) -> None:
    """The warp of "one" by that of "two", 330 and 410 MPa; the fit goes on where it was."""
    project = read_project(constant_strips(tmp_path))
    found = validate(project, leave="directions", starts=1, out=tmp_path / "out")
    warp, fill = found.judged
    assert (warp.foretold.test, fill.foretold.test) == ("one: warp", "one: fill")
    loads = np.concatenate([20 * e * STRAIN for e in (300, 360)])
    rms = float(np.sqrt(np.mean((20 * 370 * np.tile(STRAIN, 2) - loads) ** 2)))
    assert warp.foretold.rms == {"one: warp": pytest.approx(rms, rel=1e-3)}
    assert warp.foretold.error == pytest.approx(rms / loads.max(), rel=1e-3)

    record = tmp_path / "out" / "constant-without-directions.json"
    content = json.loads(record.read_text())
    content["parts"][0]["error"] = 0.5  # as it is written, it is not fitted again
    record.write_text(json.dumps(content))
    again = validate(project, leave="directions", starts=1, out=tmp_path / "out", resume=True)
    assert [one.foretold.error for one in again.judged] == [0.5, fill.foretold.error]
    record.write_text(json.dumps({**content, "of": "another fit"}))
    again = validate(project, leave="directions", starts=1, out=tmp_path / "out", resume=True)
    assert again.judged[0].foretold.error == pytest.approx(rms / loads.max(), rel=1e-3)


@pytest.fixture(scope="module")
def bubble(tmp_path_factory: pytest.TempPathFactory) -> FitSetup:
    """A computed bubble of two frames, the second of which is 10 % too large."""
    project = read_project(project_file(tmp_path_factory.mktemp("bubble"), BUBBLE))
    setup = prepare_fit(project, project.chosen(None, fitted=True))
    (test,) = setup.tests
    first, second = test.fields
    off = replace(second, displacement=1.1 * second.displacement)
    return replace(setup, tests=(replace(test, fields=(first, off)),))


def test_a_frame_is_foretold_by_the_others(bubble: FitSetup) -> None:
    """The first frame has the true moduli, and so the second its true displacements."""
    first, second = parts_of(bubble, "frames")
    assert (first.name, second.name) == ("22 kPa", "59 kPa")
    found = without(bubble, second, 1)
    measured = bubble.tests[0].fields[1].displacement
    off = measured - measured / 1.1
    assert found.test == "bubble: 59 kPa"
    assert found.rms == {"bubble": pytest.approx(np.sqrt(np.mean(off**2)), rel=1e-4)}
    relative = np.sqrt(np.mean(off**2, axis=0)) / np.abs(measured).max(axis=0)
    assert found.error == pytest.approx(relative.mean(), rel=1e-4)
    # The other way round the moduli are those of a sheet that is a tenth too high: not exact.
    assert without(bubble, first, 1).error > 0.02


def test_what_is_kept_of_a_bubble_is_as_in_the_whole(bubble: FitSetup) -> None:
    (test,) = bubble.tests
    (whole,) = test.comparisons(bubble.make_solver, Weighting())
    history = whole.solver.run(whole.model, test.known)
    residual = whole.objective.residual(history)
    halves = [*np.split(residual, 2)]
    for part, own, other in zip(parts_of(bubble, "frames"), halves, halves[::-1], strict=True):
        for masks, rows in ((part.alone, own), (part.masks, other)):
            (kept,) = test.comparisons(bubble.make_solver, Weighting(), masks)
            np.testing.assert_allclose(kept.objective.residual(history), rows, rtol=1e-12)
    # A mask may also leave some of the points of a frame.
    some = np.arange(len(residual) // 3) % 3 > 0
    (kept,) = test.comparisons(bubble.make_solver, Weighting(), {"bubble": some})
    points = np.split(some, 2)
    for k, (own, part) in enumerate(zip(kept.objective.targets, points, strict=True)):
        np.testing.assert_array_equal(own.of(history.displacement, k),
                                      history.displacement[k][part])  # fmt: skip
    assert test.comparisons(bubble.make_solver, Weighting(), {"bubble": 0 * some > 0}) == ()


def test_a_constant_field_is_of_all_frames(bubble: FitSetup) -> None:
    (test,) = bubble.tests
    sheet = replace(test.test.sheet, constant=(0, 1))
    off = replace(test, test=replace(test.test, sheet=sheet))
    with pytest.raises(InputError, match=r"--leave: no test has two or more frames .*: none, or"):
        parts_of(replace(bubble, tests=(off,)), "frames")


def test_what_cannot_be_left_out_is_said_before_any_fit(tmp_path: Path, monkeypatch) -> None:
    constant_strips(tmp_path)
    command = ("validate", "project.toml", "--leave", "frames")
    done = in_process(*command, cwd=tmp_path, code=2)
    assert "no test has two or more frames" in done.output
    assert "what can be left out of the tests chosen: directions, specimens" in done.output
    done = in_process(*command, "--weights", "two", cwd=tmp_path, code=2)
    assert "--leave, --weights: give one of them" in done.output


def test_a_part_without_a_fit_is_told(bubble: FitSetup, monkeypatch) -> None:
    part = parts_of(bubble, "frames")[0]
    monkeypatch.setattr(left_out, "fit_of", lambda setup, masks, starts: (setup, None))
    found = without(bubble, part, 1)
    assert found.error is None
    assert [note.line for note in found.notes] == ["bubble: 22 kPa: no fit without it ended well"]
