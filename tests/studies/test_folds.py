"""Folds: a fit is not given the points left out, and is judged at those."""

import json
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pandas as pd
import pytest
from bubblefit.errors import InputError, NoFeasibleStart
from bubblefit.experiments.kinds import Weighting
from bubblefit.materials.law import HypoelasticLaw
from bubblefit.project.project import read_project
from bubblefit.runs import compare, validation
from bubblefit.runs.compare import FoldError, folds
from bubblefit.runs.result import Fit
from bubblefit.runs.setup import prepare_fit
from bubblefit.runs.validation import fit_without, parts_of
from bubblefit.solvers.base import History

from .. import projects
from ..commands import in_process
from ..projects import BUBBLE, MODULI, constant_strips, project_file

#: Logarithmic strains of the points of "one", whose gauges end at 22.9 mm.
STRAIN = np.log1p(projects.ELONGATION[projects.ELONGATION <= 2.9] / 20)


def off_by(modulus, true):
    """RMS (N) of a constant modulus (MPa) at a specimen of another, and over its largest load."""
    rms = 20 * abs(modulus - true) * float(np.sqrt(np.mean(STRAIN**2)))
    return rms, rms / (20 * true * STRAIN.max())


def test_a_fold_errs_by_what_the_specimens_differ_by(tmp_path):
    project = read_project(constant_strips(tmp_path))
    setup = prepare_fit(project, project.chosen("one", fitted=True))
    found = [fold for fold in compare.validate(setup, 5, 1) if fold is not None]
    # As many as specimens, whichever of two processes is first.
    assert sorted(fold.fold for fold in found) == [0, 1]
    expected = {f"one: {name}": off_by(*both)[0] for name, both in MODULI["one"].items()}
    for fold in found:
        assert fold.rms == pytest.approx(expected, rel=1e-3)
        assert fold.value == pytest.approx(sum(expected.values()), rel=1e-3)


def setup_of(**specimens):
    """As much of a fit as its folds look at."""
    return SimpleNamespace(
        tests=[SimpleNamespace(specimens=specimens)], options="options",
        project=SimpleNamespace(fit=SimpleNamespace(seed=3)),
    )  # fmt: skip


@pytest.mark.parametrize(
    ("specimens", "count"),
    [
        # No more than the fewest specimens; a single one loses points, as many as are asked for.
        ({"warp": [0, 0, 1, 2], "fill": [4, 5, 5, 6, 7]}, 3),
        ({"warp": [0] * 6, "fill": [0, 1, 2, 3, 4, 5]}, 5),
        ({"warp": [0] * 6}, 5),
        ({"warp": [0, 1] * 3, "fill": [0] * 3}, 2),
    ],
)
def test_how_many_folds(specimens, count):
    assert len(folds(setup_of(**specimens), 5)) == count


def test_the_best_start_of_a_fold_counts(monkeypatch):
    ends, drawn, reset = [3.0, None, NoFeasibleStart("none"), 1.0, 2.0], [], []

    def feasible_start(problem, seed, number):
        drawn.append((seed, number))
        if isinstance(ends[number], NoFeasibleStart):
            raise ends[number]
        return number

    def fit_from(problem, start, options):
        best = SimpleNamespace(unknowns=f"of start {start} by {options}")
        return ends[start] and SimpleNamespace(value=ends[start], best=best)

    monkeypatch.setattr(compare, "feasible_start", feasible_start)
    monkeypatch.setattr(compare, "fit_from", fit_from)
    problem = SimpleNamespace(reset=lambda: reset.append(1))
    assert compare.best_of(setup_of(), problem, 5) == "of start 3 by options"
    assert drawn == [(3, number) for number in range(5)] and len(reset) == 5
    assert compare.best_of(setup_of(), problem, 3) == "of start 0 by options"
    ends[0] = None
    assert compare.best_of(setup_of(), problem, 3) is None


def test_a_fold_without_a_fit_or_an_analysis(monkeypatch):
    part = SimpleNamespace(evaluate=lambda unknowns, jacobian, warm: None)
    parts = (SimpleNamespace(name="bubble"), SimpleNamespace(name="warp"))
    whole = SimpleNamespace(comparisons=parts, part=lambda numbers: {(1,): part}[tuple(numbers)])
    own = SimpleNamespace(problem=lambda masks: {(False, True): whole}[tuple(masks["warp"])])
    for unknowns in (None, "unknowns"):
        monkeypatch.setattr(compare, "fit_of", lambda *_, y=unknowns: (own, y))
        masks = {"warp": np.array([True, False])}
        assert compare._fold(setup_of(), 4, masks, 1) == FoldError(4, None, {})


THREE = """
[fabric]
name = "made"
thickness = 0.8
[law]
form = "trilinear"
strain_range = [0.14, 0.18, 0.1]
[law.bounds]
E1 = [0.02, 2.0]
E2 = [0.02, 1.0]
G12 = [0.005, 0.2]
[[strips]]
increments = 4
match = "points"
objective = "OBJECTIVE"
warp = { gauge_length = 20 }
fill = { gauge_length = 20 }
[strips.data]
files = ["points.csv"]
[fit]
seed = 3
jobs = 1
"""
#: mm at the last point of specimens a, b and c.
ENDS = (2.9, 2.8, 3.0)
LEFT_OUT = 2


def three_specimens(folder, factor=1.0, objective="N"):
    """Three specimens a direction; the loads of the last are bent up by a factor at their end."""
    lines = ["direction,specimen,elongation (mm),load (N)"]
    for direction, stiff in (("warp", 400.0), ("fill", 250.0)):
        for number, end in enumerate(ENDS):
            u = np.linspace(0.2, end, 9)
            strain = np.log1p(u / 20) * (1 + 0.01 * number)
            load = 20 * stiff * strain * (1 - 3 * strain + 14 * strain**2)
            if number == LEFT_OUT:
                load *= 1 + (factor - 1) * (u / end) ** 3
            points = zip(u, load.tolist(), strict=True)
            lines += [f"{direction},{'abc'[number]},{a:.4f},{b!r}" for a, b in points]
    (folder / "points.csv").write_text("\n".join(lines) + "\n")
    (folder / "project.toml").write_text(THREE.replace("OBJECTIVE", objective))
    project = read_project(folder / "project.toml")
    return prepare_fit(project, list(project.tests.values()))


def without_the_last(setup):
    """The masks of the fold that leaves the last specimen of both directions out."""
    specimens = compare.specimens_of(setup).items()
    return {name: np.array(whose) != LEFT_OUT for name, whose in specimens}


@pytest.mark.parametrize("objective", ["N", "relative"])
def test_a_fold_knows_nothing_of_what_it_leaves_out(tmp_path, objective):
    fits = []
    for factor in (1.0, 1.8):
        setup = three_specimens(tmp_path, factor, objective)
        fits.append((setup, *compare.fit_of(setup, without_the_last(setup), starts=1)))
    (whole, own, unknowns), (other_whole, other, same) = fits
    assert own.law.form.to_card() == other.law.form.to_card()
    np.testing.assert_array_equal(own.law.strain_range, other.law.strain_range)
    np.testing.assert_array_equal(unknowns, same)
    # What is left out does change the fit of all points, and the breaks of its law.
    assert whole.law.form.to_card() != other_whole.law.form.to_card()


def test_every_specimen_is_left_out_once_with_its_strains(tmp_path):
    setup = three_specimens(tmp_path)
    (test,) = setup.tests
    reach = test.reach(without_the_last(setup))
    for strain, end in ((test.test.reach.strain, 3.0), (reach.strain, 2.9)):
        assert strain[:2] == pytest.approx((np.log1p(end / 20),) * 2)
    parts = folds(setup, 5)
    assert len(parts) == len(ENDS)
    for name, numbers in compare.specimens_of(setup).items():
        left = [{numbers[i] for i in np.flatnonzero(~part[name])} for part in parts]
        assert sorted(map(list, left)) == [[0], [1], [2]]


LAW = replace(
    HypoelasticLaw.linear(350.0, 190.0, 60.0, 0.0), strain_range=np.array([0.1, 0.14, 0.1])
)


def history(warp, shear, unstable=()):
    least, most = np.array([0.0, 0.0, shear]), np.array([warp, 0.14, 0.0])
    return History(np.ones(1), np.zeros((1, 1, 3)), least, most, iterations=1, unstable=unstable)


def notes(*histories):
    names = ("one: warp", "one: fill")[: len(histories)]
    problem = SimpleNamespace(comparisons=[SimpleNamespace(name=name) for name in names])
    found = validation._notes(problem, SimpleNamespace(histories=histories), LAW)
    return [note.about("one").line for note in found]


def test_strains_beyond_the_law_and_unstable_equilibria_with_their_part():
    for histories, words in (
        ((history(0.1181, 0.0), history(0.05, -0.25, ("2 mm",))),
         ["warp: warp strain 0.118", "fill: shear strain 0.250", "fill: unstable"]),
        # Of the only comparison nothing else could be meant.
        ((history(0.1181, 0.0, ("2 mm",)),), ["one: warp strain 0.118", "one: unstable"]),
        ((history(0.1, -0.1),), []),
    ):  # fmt: skip
        assert all(word in line for word, line in zip(words, notes(*histories), strict=True))


@pytest.fixture(autouse=True)
def without_pages(monkeypatch):
    """The pages of the fits are no matter here, and take most of the time."""
    monkeypatch.setattr(Fit, "report", lambda self, folder: Path(folder))


def test_a_specimen_is_foretold_by_the_other(tmp_path):
    """Of two specimens a direction (E1 300 and 360, E2 200 and 180 MPa) one knows only itself."""
    constant_strips(tmp_path)
    command = ("validate", "project.toml", "--test", "one", "--leave", "specimens")
    done = in_process(*command, "--starts", "1", "--out", "out", cwd=tmp_path)
    table = pd.read_csv(tmp_path / "out" / "validation.csv").set_index("test")
    assert len(table) == 4
    mean = 0.0
    for direction, both in MODULI["one"].items():
        for specimen, own, other in zip("ab", both, both[::-1], strict=True):
            row = table.loc[f"one: {direction}, specimen {specimen}"]
            for way, modulus in (("foretold", other), ("fitted", np.mean(both))):
                found = row[f"{way}_rms"], row[f"{way}_relative"]
                assert found == pytest.approx(off_by(modulus, own), rel=1e-3)
            mean += off_by(other, own)[1] / 4
    assert f"constant: predicted {100 * mean:.3g} % on average" in done.output
    said = json.loads((tmp_path / "out" / "result.json").read_text())
    assert said["left_out"] == "specimens"
    assert said["mean_foretold"]["constant"] == pytest.approx(mean, rel=1e-3)


def test_a_direction_is_foretold_by_the_other_test(tmp_path):
    """The warp of "one" by that of "two", 330 and 410 MPa; the fit goes on where it was."""
    project = read_project(constant_strips(tmp_path))

    def judged(**options):
        found = validation.validate(
            project, leave="directions", starts=1, out=tmp_path / "out", **options
        )
        return [one.predicted for one in found.judged]

    warp, fill = judged()
    assert (warp.test, fill.test) == ("one: warp", "one: fill")
    loads = np.concatenate([20 * e * STRAIN for e in (300, 360)])
    rms = float(np.sqrt(np.mean((20 * 370 * np.tile(STRAIN, 2) - loads) ** 2)))
    assert warp.rms == {"one: warp": pytest.approx(rms, rel=1e-3)}
    assert warp.error == pytest.approx(rms / loads.max(), rel=1e-3)
    # As it is written, it is not fitted again; nor is that of another fit taken.
    record = tmp_path / "out" / "constant-without-directions.json"
    content = json.loads(record.read_text())
    content["parts"][0]["error"] = 0.5
    for change, error in (({}, 0.5), ({"of": "another fit"}, warp.error)):
        record.write_text(json.dumps({**content, **change}))
        again = [one.error for one in judged(resume=True)]
        assert again == pytest.approx([error, fill.error], rel=1e-3)


@pytest.fixture(scope="module")
def bubble(tmp_path_factory):
    """A computed bubble of two frames, the second of which is 10 % too large."""
    project = read_project(project_file(tmp_path_factory.mktemp("bubble"), BUBBLE))
    setup = prepare_fit(project, project.chosen(None, fitted=True))
    (test,) = setup.tests
    first, second = test.fields
    off = replace(second, displacement=1.1 * second.displacement)
    return replace(setup, tests=(replace(test, fields=(first, off)),))


def test_a_frame_is_foretold_by_the_others(bubble, monkeypatch):
    first, second = parts_of(bubble, "frames")
    assert (first.name, second.name) == ("22 kPa", "59 kPa")
    found = fit_without(bubble, second, 1)
    measured = bubble.tests[0].fields[1].displacement
    off = measured - measured / 1.1
    assert found.test == "bubble: 59 kPa"
    assert found.rms == {"bubble": pytest.approx(np.sqrt(np.mean(off**2)), rel=1e-4)}
    relative = np.sqrt(np.mean(off**2, axis=0)) / np.abs(measured).max(axis=0)
    assert found.error == pytest.approx(relative.mean(), rel=1e-4)
    # The other way round the moduli are those of a sheet that is a tenth too high: not exact.
    assert fit_without(bubble, first, 1).error > 0.02
    monkeypatch.setattr(validation, "fit_of", lambda setup, masks, starts: (setup, None))
    lost = fit_without(bubble, first, 1)
    (note,) = lost.notes
    assert lost.error is None and note.of == "bubble: 22 kPa"


def test_what_is_kept_of_a_bubble_is_as_in_the_whole(bubble):
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
        seen = own.of(history.displacement, k)
        np.testing.assert_array_equal(seen, history.displacement[k][part])
    assert test.comparisons(bubble.make_solver, Weighting(), {"bubble": 0 * some > 0}) == ()


def test_what_cannot_be_left_out_is_said_before_any_fit(bubble, tmp_path):
    # A constant field is of all frames.
    (test,) = bubble.tests
    off = replace(test, test=replace(test.test, sheet=replace(test.test.sheet, constant=(0, 1))))
    with pytest.raises(InputError, match=r"--leave: no test has two or more frames .*: none, or"):
        parts_of(replace(bubble, tests=(off,)), "frames")
    constant_strips(tmp_path)
    for options, words in (
        (["--leave", "frames"], "chosen: directions, specimens"),
        (["--leave", "frames", "--weights", "two"], "--leave, --weights: give one of them"),
        (["--test", "one"], "there is only one"),
    ):
        done = in_process("validate", "project.toml", *options, cwd=tmp_path, code=2)
        assert words in done.output
