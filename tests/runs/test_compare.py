"""Comparison of forms: folds, errors at points left out, the simplest form, going on."""

import json
import math
from dataclasses import asdict
from pathlib import Path
from types import SimpleNamespace

import bubblefit as bf
import numpy as np
import pytest
from bubblefit.errors import OutputError
from bubblefit.materials.forms.polynomial import Polynomial
from bubblefit.notes import Note, Verdict
from bubblefit.reports import study_pages
from bubblefit.runs import compare as study
from bubblefit.runs.compare import (
    FOLD,
    NOT_JUDGED,
    FoldError,
    FormFit,
    LawComparison,
    compare,
    folds,
)
from bubblefit.runs.result import Fit
from bubblefit.runs.simulation import StudyRecord
from bubblefit.runs.starts import BestFit
from bubblefit.solvers.base import SNAP

from ..builders.projects import STRIP_ELONGATION, STRIP_MODULI, constant_strips, fit_setup
from ..support.refusals import raised

#: Logarithmic strains of the points of "one", whose gauges end at 22.9 mm.
STRAIN = np.log1p(STRIP_ELONGATION[STRIP_ELONGATION <= 2.9] / 20)


def off_by(modulus, true):
    """RMS (N) of a constant modulus (MPa) at a specimen of another, and over its largest load."""
    rms = 20 * abs(modulus - true) * float(np.sqrt(np.mean(STRAIN**2)))
    return rms, rms / (20 * true * STRAIN.max())


def test_error_of_fold_is_difference_between_specimens(project):
    found = study.errors_of_folds(fit_setup(project, "one"), 5, 1, None, lambda event: None, None)
    assert [fold.fold for fold in found] == [0, 1]
    expected = {f"one: {name}": off_by(*both)[0] for name, both in STRIP_MODULI["one"].items()}
    for fold in found:
        assert fold.rms == pytest.approx(expected, rel=1e-3)
        assert fold.value == pytest.approx(sum(expected.values()), rel=1e-3)


def test_error_of_fold_is_of_data_alone_without_priors(tmp_path, monkeypatch):
    keys = 'name = "one"\n', 'name = "one"\ncompliance = 2e-4\ncompliance_prior = 1e-4\n'
    setup = fit_setup(constant_strips(tmp_path, keys), "one")
    unknowns = setup.problem().unknowns.at(np.array([10.0, 200.0, 300.0]))
    unknowns[-1] = 4e-4  # two standard deviations off
    monkeypatch.setattr(study, "fit_of", lambda *_: (setup, unknowns, 1))
    fold = study.fold_error(setup, folds(setup, 5)[0], 0, 1)
    assert fold.value == pytest.approx(sum(fold.rms.values()), rel=1e-9)


def setup_of(**specimens):
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
def test_number_of_folds_follows_specimens(specimens, count):
    assert len(folds(setup_of(**specimens), 5)) == count


#: mm at the last point of specimens a, b and c.
ENDS = (2.9, 2.8, 3.0)


LEFT_OUT = 2


def three_specimens(folder, factor=1.0, objective="N"):
    """Three specimens a direction; the loads of the last are bent up by a factor at their end."""
    own = f'increments = 4\nobjective = "{objective}"'
    path = constant_strips(
        folder, ('form = "constant"\nnu12 = 0.0', 'form = "trilinear"'), ("starts = 2", "jobs = 1"),
        ("[0.12, 0.14, 0.1]", "[0.14, 0.18, 0.1]"), (", final_length = 22.9", ""),
        (", final_length = 22.9", ""), ("increments = 8", own),
    )  # fmt: skip
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
    (folder / "one.csv").write_text("\n".join(lines) + "\n")
    return fit_setup(path, "one")


def without_the_last(setup):
    specimens = study.specimens_of(setup).items()
    return {name: np.array(whose) != LEFT_OUT for name, whose in specimens}


@pytest.mark.parametrize("objective", ["N", "relative"])
def test_fold_does_not_depend_on_omitted_points(tmp_path, objective):
    fits = []
    for factor in (1.0, 1.8):
        setup = three_specimens(tmp_path, factor, objective)
        fits.append((setup, *study.fit_of(setup, without_the_last(setup), starts=1)[:2]))
    (whole, own, unknowns), (other_whole, other, same) = fits
    assert own.law.form.to_card() == other.law.form.to_card()
    np.testing.assert_array_equal(own.law.strain_range, other.law.strain_range)
    np.testing.assert_array_equal(unknowns, same)
    assert whole.law.form.to_card() != other_whole.law.form.to_card()


def test_every_specimen_is_left_out_once(tmp_path):
    setup = three_specimens(tmp_path)
    (test,) = setup.tests
    reach = test.reach(without_the_last(setup))
    for strain, end in ((test.test.reach.strain, 3.0), (reach.strain, 2.9)):
        assert strain[:2] == pytest.approx((np.log1p(end / 20),) * 2)
    parts = folds(setup, 5)
    assert len(parts) == len(ENDS)
    for name, whose in study.specimens_of(setup).items():
        left = [{whose[i] for i in np.flatnonzero(~part[name])} for part in parts]
        assert sorted(map(list, left)) == [[0], [1], [2]]


@pytest.fixture(autouse=True)
def without_pages(monkeypatch):
    monkeypatch.setattr(Fit, "report", lambda self, folder: Path(folder))


class Run:
    def __init__(self, folder, patch):
        self.out, self.events, self.pages, self.drawn = folder / "out", [], [], []
        self.path = constant_strips(folder, ("starts = 2", "jobs = 1"))
        patch.setattr(study_pages, "save", lambda *args: self.drawn.append(args))
        patch.setattr(study_pages, "_responses", lambda *_: [])
        patch.setattr(bf.Fit, "report", lambda *_: None)
        patch.setattr(study_pages, "write_report", lambda folder, page: self.pages.append(page))

    def compare(self, **options):
        self.events.clear()
        options = {"progress": self.events.append, **options}
        return compare(
            bf.read_project(self.path), ["one"], ("constant", "linear"), folds=5, starts=1,
            fold_starts=1, out=self.out, **options,
        )  # fmt: skip

    @property
    def judged(self):
        return [event for event in self.events if isinstance(event, FoldError)]


@pytest.fixture(scope="module")
def run(tmp_path_factory):
    with pytest.MonkeyPatch.context() as patch:
        yield Run(tmp_path_factory.mktemp("laws"), patch)


@pytest.fixture(scope="module")
def compared(run):
    done = run.compare()
    told = [event for event in run.events if isinstance(event, str | FoldError)]
    assert told[0] == "constant moduli" and told[3] == "linear moduli" and len(told) == 6
    return done


def test_resumed_comparison_validates_nothing_twice(compared, run):
    before = [form.folds for form in compared.forms]
    raised(OutputError, "--resume", run.compare)
    again = run.compare(resume=True)
    assert [form.folds for form in again.forms] == before and not run.judged
    path = run.out / "linear" / "validation.json"
    written = json.loads(path.read_text())
    assert path.read_text() == json.dumps(written, indent=1) + "\n" and len(written["folds"]) == 2
    for change, numbers in (({"of": "another"}, {0, 1}), ({"folds": written["folds"][:1]}, {1})):
        path.write_text(json.dumps({**written, **change}))
        assert [form.folds for form in run.compare(resume=True).forms] == before
        made = {json.dumps(written["folds"][k]) for k in numbers}
        assert {json.dumps(asdict(fold)) for fold in run.judged} == made
    assert json.loads(path.read_text()) == written


def test_replaced_form_is_not_resumed(run, compared):
    other = run.path.read_text().replace("seed = 7", "seed = 8")
    assert other != run.path.read_text()
    run.path.write_text(other)

    def stop(event):
        if event == "constant moduli":
            raise KeyboardInterrupt

    raised(KeyboardInterrupt, "", run.compare, progress=stop, overwrite=True)
    again = run.compare(resume=True)
    assert [form.fit.project.fit.seed for form in again.forms] == [8, 8]


def test_rows_of_another_fit_are_not_used(tmp_path):
    def rows(of, folder=tmp_path):
        return StudyRecord(folder, "rows.json", "folds", FoldError, {"of": of}).rows

    path = tmp_path / "rows.json"
    row = FoldError(1, 0.5, {})
    StudyRecord(tmp_path, path.name, "folds", FoldError, {"of": "this"}).write(row)
    mark = json.loads(path.read_text())["of"]
    for stored, wanted in (([], {}), ([asdict(row)], {1: row}), ([{"colour": 1}], {})):
        path.write_text(json.dumps({"of": mark, "folds": stored}))
        assert rows("this") == wanted and rows("another") == {}
    path.write_text("{")
    assert rows("this") == {} and rows("this", tmp_path / "none") == {}


class Form(FormFit):
    coefficients, fitted, rms = 0, 3.0, {"warp": 2.0, "fill": 4.0}


def test_project_of_a_comparison_is_that_of_its_first_form():
    fits = [SimpleNamespace(project=name) for name in ("first", "second")]
    forms = tuple(SimpleNamespace(fit=fit) for fit in fits)
    assert study.LawComparison(forms, fold_starts=1).project == "first"


def form(name, coefficients, *folds):
    objective = SimpleNamespace(unit="N")
    parts = [SimpleNamespace(name=part, objective=objective) for part in ("warp", "fill", "b")]
    start = SimpleNamespace(objective=9.0, analyses=5, coarse_analyses=2)
    fit = SimpleNamespace(
        law=SimpleNamespace(form=Polynomial(0)), problem=SimpleNamespace(comparisons=parts),
        objective=9.0, notes=[Note(SNAP, "snaps", "warp")],
        verdict=Verdict("usable", "E1 is known"),
        project=SimpleNamespace(
            title="made", fabric=SimpleNamespace(lab="", thickness=0.5)
        ),
        setup=SimpleNamespace(test_names=[], objective_is="error"),
        best=BestFit(None, None, None, ranked=[start], records=[start, start], reached=None),
    )  # fmt: skip
    errors = tuple(
        FoldError(k, value, {} if value is None else {"warp": value / 2, "fill": value / 4})
        for k, value in enumerate(folds)
    )
    own = Form(name, fit, errors, ("warp", "fill"))
    object.__setattr__(own, "coefficients", coefficients)
    return own


def test_simplest_form_that_is_as_good_is_chosen(monkeypatch):
    every = {"warp": 0.5, "fill": 0.25, "b": 7.0}
    monkeypatch.setattr(study, "noise_of", lambda problem: every)
    forms = (
        form("cubic", 12, 99.0, 101.0), form("linear", 6, 104.0, 105.8),
        form("constant", 3, 105.0, 105.2), form("quadratic", 9, 1.0, None),
    )  # fmt: skip
    result = LawComparison(forms, 2).result
    assert (result["least_cross_validated"], result["simplest_as_good"]) == ("cubic", "linear")
    assert (result["noise"], result["noise_by_part"]) == (0.75, {"warp": 0.5, "fill": 0.25})
    assert result["units"] == {"warp": "N", "fill": "N"}
    first, *_, last = result["forms"]
    assert first["cross_validated"] == 100.0 and first["folds"] == [99.0, 101.0]
    assert first["cross_validated_by_part"] == {"warp": 50.0, "fill": 25.0}
    assert last["cross_validated"] is None and last["folds"] == [1.0, None]
    assert last["cross_validated_by_part"] == {"warp": None, "fill": None}
    table = LawComparison(forms, 2).table()
    assert table["cross_validated"].tolist()[:3] == pytest.approx([100.0, 104.9, 105.1])
    assert math.isnan(table["cross_validated"][3]) and np.isnan(table["left out warp, N"][3])
    assert table["left out fill, N"].tolist()[:2] == pytest.approx([25.0, 26.225])
    assert table["rms fill, N"].tolist() == [4.0] * 4
    lines = LawComparison(forms[2:], 2).lines()
    for line, words in zip(lines[2:5], ("105.1", "failed", "0.75"), strict=True):
        assert words in line
    assert lines[5] == "28 analyses of the tests" and "constant" in lines[6]
    lost = LawComparison(forms[3:], 2)
    assert lost.result["least_cross_validated"] is lost.result["simplest_as_good"] is None
    assert not any("simplest within" in line for line in lost.lines())
    forms = form("constant", 3, 1.0, 2.0), form("cubic", 12, None, 1.0, None)
    said = [(note.kind, note.line) for note in LawComparison(forms, 2).notes]
    assert said == [
        (SNAP, "constant, warp: snaps"), (SNAP, "cubic, warp: snaps"),
        (FOLD, f"cubic, fold 1: {NOT_JUDGED}"), (FOLD, f"cubic, fold 3: {NOT_JUDGED}"),
    ]  # fmt: skip


def test_folds_begin_at_the_fit_to_all_points(tmp_path, monkeypatch):
    setup = three_specimens(tmp_path)
    masks = without_the_last(setup)
    _, optimum, drawn_analyses = study.fit_of(setup, masks, starts=1)
    monkeypatch.setattr(study, "feasible_start", None)  # nothing is drawn
    _, unknowns, analyses = study.fit_of(setup, masks, 1, optimum)
    np.testing.assert_allclose(unknowns, optimum, rtol=1e-4)
    assert 0 < analyses < drawn_analyses / 2
    assert study.fold_error(setup, masks, 0, 1, optimum).analyses == analyses


def test_fold_that_cannot_begin_at_the_fit_begins_at_random(tmp_path):
    setup = three_specimens(tmp_path)
    masks = without_the_last(setup)
    assert study.fit_of(setup, masks, 1, np.full(2, np.nan)).unknowns is not None


@pytest.mark.parametrize(
    ("starts", "setting", "has_coarse", "expected"),
    [(5, None, True, True), (5, False, True, False), (1, None, True, None), (5, None, False, None)],
)
def test_starts_of_forms_run_coarse_to_fine(
    tmp_path, monkeypatch, starts, setting, has_coarse, expected
):
    project = bf.read_project(constant_strips(tmp_path))
    setup = SimpleNamespace(project=project.with_fit(starts=starts, coarse_to_fine=setting))
    monkeypatch.setattr(study, "coarse_problem", lambda _: has_coarse or None)
    assert study._coarse_to_fine(setup).fit.coarse_to_fine is expected


@pytest.mark.parametrize(
    ("name", "keys"),
    [("spline:6", 'form = "spline" and knots = 6'), ("linear", 'form = "linear"')],
)
def test_next_step_names_keys_that_a_project_has(name, keys):
    assert study._keys_of_form(name) == keys
