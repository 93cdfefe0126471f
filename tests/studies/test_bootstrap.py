"""Bootstrap over specimens, tests and frames: closed forms, what is kept, written and said."""

from __future__ import annotations

import json
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pandas as pd
import pytest
from bubblefit.errors import InputError, OutputError
from bubblefit.materials.card import MaterialCard, write_card
from bubblefit.materials.law import HypoelasticLaw
from bubblefit.notes import NoteKind
from bubblefit.project.project import read_project
from bubblefit.reports.html import percent
from bubblefit.runs import bootstrap as module
from bubblefit.runs.bootstrap import MOST, Bootstrap, bootstrap
from scipy.optimize import minimize_scalar

from ..commands import in_process
from ..page_charts import charts_of
from ..projects import BUBBLE, ELONGATION, MODULI, constant_strips, project_file

#: MPa, near the optima of the tests.
CARD = MaterialCard(HypoelasticLaw.linear(330.0, 190.0, 10.0, 0.0), 0.8, "near")
ENDS = {"one": 2.9, "two": 2.5}


def moduli(done: Bootstrap, name: str) -> np.ndarray:
    """(samples,) MPa at rest."""
    return np.array(done.moduli[name][:, 0])


def test_specimens_drawn_again(tmp_path: Path) -> None:
    """A block is the mean of the squares over what was drawn: its modulus the mean of theirs."""
    project = read_project(constant_strips(tmp_path)).with_fit(jobs=1)
    done = bootstrap(project, "specimens", 8, CARD, "one")
    assert [g.name for g in done.groups] == ["one: warp", "one: fill"]
    assert [u.name for u in done.groups[0].units] == [
        "one: warp, specimen a", "one: warp, specimen b"
    ]  # fmt: skip
    for k, (name, direction) in enumerate((("E1", "warp"), ("E2", "fill"))):
        counts = np.array([sample.counts[k] for sample in done.samples])
        assert (counts.sum(axis=1) == 2).all() and len({*counts[:, 0].tolist()}) > 1
        expected = counts @ np.array(MODULI["one"][direction]) / 2
        np.testing.assert_allclose(moduli(done, name), expected, rtol=1e-4)
        own, _ = done.sigma[name]
        assert own == pytest.approx(expected.std(ddof=1) / moduli_of_fit(name), rel=1e-3)
        low, high = np.quantile(expected, [0.025, 0.975])
        np.testing.assert_allclose(done.bands[name][:, 0], [low, high], rtol=1e-4)
    assert all(1 <= s.analyses <= MOST or s.counts == [[1, 1], [1, 1]] for s in done.samples)
    assert done.analyses == done.before + sum(s.analyses for s in done.samples)
    # Two specimens and eight samples are few.
    assert [(n.kind, n.of) for n in done.notes] == [
        (NoteKind.FEW_UNITS, "one: warp"), (NoteKind.FEW_UNITS, "one: fill"),
        (NoteKind.FEW_UNITS, ""),
    ]  # fmt: skip
    correlations = done.coefficients()
    assert correlations["unknown"].to_list() == ["beta_3", "beta_7", "beta_11"]
    both = correlations["beta_7"].to_list()[1:]
    assert both == pytest.approx([1.0, np.corrcoef(moduli(done, "E1"), moduli(done, "E2"))[0, 1]])


def moduli_of_fit(name: str) -> float:
    return {"E1": 330.0, "E2": 190.0}[name]


def relative_error(test: str, direction: str, modulus: float) -> float:
    """RMS error of a constant modulus (MPa) over the largest load."""
    strain = np.log1p(ELONGATION[ELONGATION <= ENDS[test]] / 20)
    loads = np.array([20 * e * strain for e in MODULI[test][direction]])
    return float(np.sqrt(np.mean((20 * modulus * strain - loads) ** 2)) / loads.max())


def test_tests_drawn_again(tmp_path: Path) -> None:
    """A test that was drawn twice weighs twice."""
    project = read_project(constant_strips(tmp_path, ("weight = 3.0", "weight = 0.5")))
    done = bootstrap(project.with_fit(jobs=1, seed=3), "tests", 6, CARD)
    (group,) = done.groups
    assert (group.name, [u.name for u in group.units]) == ("strips", ["one", "two"])
    seen = set()
    for sample, found in zip(done.samples, moduli(done, "E1"), strict=True):
        (counts,) = sample.counts
        seen.add(tuple(counts))

        def total(modulus: float, one: int = counts[0], two: int = counts[1]) -> float:
            own = one * relative_error("one", "warp", modulus) / 2
            return own + 0.5 * two * relative_error("two", "warp", modulus)

        best = minimize_scalar(total, bounds=(200, 500), method="bounded")
        assert found == pytest.approx(best.x, rel=1e-3)
    assert seen == {(2, 0), (1, 1), (0, 2)}


def test_frames_drawn_again(tmp_path: Path) -> None:
    """The objective is that of as many blocks as were drawn, whatever their order in the data."""
    text = BUBBLE.replace("pressures = [22, 59]", "pressures = [22, 40, 59]")
    project = read_project(project_file(tmp_path, text)).with_fit(jobs=1)
    law = HypoelasticLaw.linear(790.0, 395.0, 85.0, 0.24)
    card = MaterialCard(law, 0.81, "near")
    found = module.refound(project, card, None)
    (group,) = module.groups_of(found, "frames")
    assert [u.name.split(": ")[-1] for u in group.units] == ["22 kPa", "40 kPa", "59 kPa"]
    problem = found.problem
    norms = problem.blocks.norms(found.point.residual).reshape(3, 3).sum(axis=1)
    factors = module.factors_of(problem, [group], [[2, 0, 1]])
    weighted = problem.blocks.value(factors * found.point.residual)
    assert weighted == pytest.approx(2 * norms[0] + norms[2])
    # As a fit to the rest has it, which is not given the frame at all.
    setup = found.setup
    (part,) = [p for p in module.parts_of(setup, "frames") if p.name == "40 kPa"]
    y = problem.unknowns.at(np.array([80.0, 390.0, 790.0]))
    rest = setup.problem(part.masks).evaluate(y, False)
    whole = problem.evaluate(y, False)
    assert rest is not None and whole is not None
    factors = module.factors_of(problem, [group], [[1, 0, 1]])
    assert problem.blocks.value(factors * whole.residual) == pytest.approx(rest.value, rel=1e-6)


def test_a_bootstrap_goes_on_where_it_was(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    project = read_project(constant_strips(tmp_path)).with_fit(jobs=1)
    whole = bootstrap(project, "specimens", 4, CARD, "one")
    write = module.BootstrapRecord.write

    def stops(record: module.BootstrapRecord, sample: module.Sample) -> None:
        write(record, sample)
        if len(record.samples) == 2:
            raise KeyboardInterrupt

    monkeypatch.setattr(module.BootstrapRecord, "write", stops)
    with pytest.raises(KeyboardInterrupt):
        bootstrap(project, "specimens", 4, CARD, "one", out=tmp_path / "out")
    fitted: list[int] = []

    def counts(record: module.BootstrapRecord, sample: module.Sample) -> None:
        fitted.append(sample.number)
        write(record, sample)

    monkeypatch.setattr(module.BootstrapRecord, "write", counts)
    with pytest.raises(OutputError, match="already holds results"):
        bootstrap(project, "specimens", 4, CARD, "one", out=tmp_path / "out")
    given = {"card": CARD, "tests": "one", "out": tmp_path / "out", "resume": True}
    done = bootstrap(project, "specimens", 4, **given)
    assert fitted == [2, 3]
    assert [s.counts for s in done.samples] == [s.counts for s in whole.samples]
    np.testing.assert_allclose(done.unknowns, whole.unknowns, rtol=1e-6)
    # Samples of other draws are others.
    bootstrap(project, "specimens", 2, **given, seed=8)
    assert fitted == [2, 3, 0, 1]


@pytest.mark.parametrize(
    ("given", "said"),
    [
        ({"over": "frames"}, "--over: no test has two or more frames"),
        ({"over": "tests"}, "--over: no kind of which the project has two tests or more"),
        ({"samples": 1}, "--samples: expected two or more, got 1"),
    ],
)
def test_what_cannot_be_meant(tmp_path: Path, given: dict, said: str) -> None:
    project = read_project(constant_strips(tmp_path)).with_fit(jobs=1)
    with pytest.raises(InputError, match=said):
        bootstrap(project, **{"over": "specimens", "card": CARD, "tests": "one", **given})


def test_values_of_no_known_part(tmp_path: Path) -> None:
    """A kind of another distribution may not tell; a complaint says which test."""
    project = read_project(constant_strips(tmp_path)).with_fit(jobs=1)
    problem = module.refound(project, CARD, "one").problem
    (warp, _) = problem.comparisons
    warp.objective = SimpleNamespace(sizes=warp.objective.sizes)  # type: ignore[assignment]
    with pytest.raises(InputError, match="--over: one: warp does not tell which"):
        module.rows_of(problem, {"one: warp": np.ones(22, dtype=bool)})


def test_the_command(tmp_path: Path) -> None:
    constant_strips(tmp_path)
    (tmp_path / "out" / tmp_path.name).mkdir(parents=True)
    write_card(CARD, tmp_path / "out" / tmp_path.name / "material.toml")
    command = ("bootstrap", "project.toml", "--over", "specimens", "--samples", "5",
               "--test", "one", "--out", "there", "--jobs", "2", "--seed", "4")  # fmt: skip
    done = in_process(*command, "--quiet", cwd=tmp_path)
    folder = tmp_path / "there"
    said = json.loads((folder / "result.json").read_text())
    assert (said["samples"], said["over"], said["seed"]) == (5, "specimens", 4)
    assert said["groups"]["one: fill"] == ["one: fill, specimen a", "one: fill, specimen b"]
    assert f"; {said['analyses']} analyses" in done.output
    sigma = f"E1 {percent(said['sigma_relative']['E1'])} (fit "
    page = (folder / "report.html").read_text()
    assert sigma in done.output and sigma[:-6] in page
    table = pd.read_csv(folder / "bootstrap.csv")
    own = table[(table["modulus"] == "E1")]
    assert (own["lower_MPa"] <= own["median_MPa"]).all()
    assert own["sigma_relative"].iloc[0] == pytest.approx(said["sigma_relative"]["E1"], rel=1e-6)
    _, low, high = charts_of(folder)["bootstrap"][0].series
    assert low.y == pytest.approx(own["lower_MPa"], rel=1e-5)
    assert high.y == pytest.approx(own["upper_MPa"], rel=1e-5)
    assert (folder / "bootstrap.png").stat().st_size > 10_000
    assert len(pd.read_csv(folder / "coefficients.csv")) == 3
    assert {row["kind"] for row in said["notes"]} == {"few to draw from"}
