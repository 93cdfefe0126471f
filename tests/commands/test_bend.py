"""`bubblefit bend` and `simulate bend` as whole commands: files, failures, going on."""

import json
from dataclasses import replace
from pathlib import Path

import bubblefit as bf
import numpy as np
import pandas as pd
import pytest
from bubblefit.cli.options import LiveLine
from bubblefit.experiments.cylinder.predicted import quantities
from bubblefit.materials.card import MaterialCard, write_card
from bubblefit.materials.law import HypoelasticLaw
from bubblefit.reports import run_pages
from bubblefit.reports.content import Exhibit
from bubblefit.reports.kinds.cylinder import CylinderPresenter
from bubblefit.solvers import registry

from ..builders.bent_cylinders import (
    FAILS,
    STOPS,
    TOLD,
    ClosedFormCylinder,
    Counted,
    write_cylinder_project,
    write_cylinder_readings,
)
from ..support.commands import in_process, one_line, result_in

#: Warp modulus (MPa) of the card with which `Falling` has a knee and a limit point.
FALLS = 500.0


class Falling(ClosedFormCylinder):
    """Knee and limit point with one card; with others a knee at high pressure, a line below it."""

    def run(self, model, law, *arguments, **named):
        history = super().run(model, law, *arguments, **named)
        way = np.array([0.0, *model.deflections])
        peak = 300.0 + 1e3 * model.pressure
        load = 4.0 * way
        if law.beta[11] == FALLS:
            load = peak * np.sin(np.pi * way / 280.0)
        elif model.pressure > 0.1:
            load = np.minimum(load, 300.0 + way)
        return replace(history, load=load)


@pytest.fixture(autouse=True)
def formula(monkeypatch, tmp_path_factory):
    """The solver of these tests, by name; and the file that counts its runs."""
    told = tmp_path_factory.mktemp("told") / "runs"
    monkeypatch.setenv(TOLD, str(told))
    monkeypatch.setitem(registry.SOLVERS, "formula", Counted)
    return told


@pytest.fixture
def undrawn(monkeypatch):
    monkeypatch.setattr(CylinderPresenter, "show_outcome", lambda *_: Exhibit())
    monkeypatch.setattr(run_pages, "write_report", lambda folder, page: folder)


def bend(*arguments, cwd, code=0, command=("bend",)):
    return in_process(*command, *arguments, cwd=cwd, code=code)


def measured(folder):
    write_cylinder_readings(folder / "made-up.csv", 3.5, noise=0.02)
    return write_cylinder_project(folder, 'measured.files = ["made-up.csv"]')


@pytest.fixture(scope="module")
def study(tmp_path_factory):
    folder = tmp_path_factory.mktemp("bend")
    with pytest.MonkeyPatch.context() as patch:
        patch.setitem(registry.SOLVERS, "formula", ClosedFormCylinder)
        done = bend(measured(folder), "--out", "out", cwd=folder)
    return folder / "out", done.stdout


def test_files_of_bending_study_agree(study, golden):
    out, text = study
    golden("bend", text, out.parent)
    result = result_in(out)
    assert result["command"] == "predict" and result["solver"] == "formula"
    keys = [(r["test"], r["card"]) for r in result["runs"]]
    tests, cards = ("150 mm, 90 kPa", "high"), ("soft", "stiff")
    assert keys == [(test, card) for test in tests for card in cards]
    curves = pd.read_csv(out / "load_deflection.csv")
    table = pd.read_csv(out / "runs.csv").set_index(["test", "card"])
    assert list(table.index) == keys
    for key, run in zip(keys, result["runs"], strict=True):
        rows = curves[(curves["test"] == key[0]) & (curves["card"] == key[1])]
        assert len(rows) == 25 and run["ended"] == "finished" and run["warnings"][0] == "made up"
        d, load = rows["deflection_mm"].to_numpy(), rows["load_N"].to_numpy()
        for place in (40, 100, 240):
            expected = pytest.approx(np.interp(place, d, load))
            assert run["load_N"][f"{place} mm"] == expected
            assert table.loc[key, f"load_at_{place}_mm_N"] == expected
        slope = np.polyfit(d[:3], load[:3], 1)[0]
        assert table.loc[key, "stiffness_N_per_mm"] == pytest.approx(slope)
        amount = (rows["gauge_pressure_kPa"] + 101.0) * rows["volume_mm3"]
        np.testing.assert_allclose(amount, amount.iloc[0])
    assert set(pd.read_csv(out / "measured.csv")["test"]) == {tests[0]}
    for card in cards:  # against the readings
        own = curves[(curves["test"] == tests[0]) & (curves["card"] == card)]
        masses = np.arange(0.0, 30.1, 5.0)
        load = np.tile(9.80665 * masses, 2)
        way = np.concatenate([9.80665 * masses / 3.5 * s for s in (1.02, 0.98)])
        off = np.interp(way, own["deflection_mm"], own["load_N"]) - load
        row = table.loc[tests[0], card]
        assert row["rms_N"] == pytest.approx(np.sqrt(np.mean(off**2)))
        assert row["rms_relative"] == pytest.approx(row["rms_N"] / load.max())
    assert table.loc["high", "rms_N"].isna().all()
    assert result["worst_relative_error"] == pytest.approx(table["rms_relative"].max())


def test_knee_and_limit_point_are_the_same_figures_everywhere(tmp_path, monkeypatch):
    """Terminal, page, runs.csv, result.json, Python, a study: knee and limit point, never mixed."""
    monkeypatch.setitem(registry.SOLVERS, "formula", Falling)
    path = write_cylinder_project(tmp_path, soft=FALLS)
    text = bend(path, "--out", "out", cwd=tmp_path).stdout
    project = bf.read_project(path)
    frame = bf.predict(project).runs().set_index(["test", "card"])
    table = pd.read_csv(tmp_path / "out" / "runs.csv").set_index(["test", "card"])
    page = json.loads((tmp_path / "out" / "page.json").read_text().replace("\u00a0", " "))
    parts = [part for section in page["sections"] for part in section["parts"]]
    tables = {part["title"]: part for part in parts if "header" in part}
    runs, first = tables["Runs"], tables["Stiffness, knee and limit point"]
    assert text.splitlines()[0].index("knee") < text.splitlines()[0].index("limit point")
    for i, run in enumerate(result_in(tmp_path / "out")["runs"]):
        test, card = run["test"], run["card"]
        row = dict(zip(runs["header"], runs["rows"][i], strict=True))
        line = text.splitlines()[1 + i]
        assert line.startswith(test) and row["test"] == test and "buckl" not in line
        study = quantities(project.tests[test].model(), Falling().run(
            project.tests[test].model(), project.cards[card].card.law))  # fmt: skip
        for name, key in {"knee": "knee", "limit point": "limit"}.items():
            point = run[name.replace(" ", "_")]
            load, deflection = point["load_N"], point["deflection_mm"]
            at = next(k for k, head in enumerate(first["header"]) if name in head)
            cells = first["rows"][i][at : at + 2]  # no bands, and no column of them
            if card == "soft" or (name, test) == ("knee", "high"):
                words = f"{load:.0f} N, {deflection:.0f} mm"
                assert study[f"load at the {name}, N"] == pytest.approx(load)
                assert cells == [f"{load:.0f}", f"{deflection:.0f}"]
                assert f"{name} at {load:.0f} N and {deflection:.0f} mm" in page["summary"]
            else:
                words = "none up to 240 mm"
                assert load is None and point["none_up_to_mm"] == 240.0
                assert study[f"no {name} up to, mm"] == 240.0 and cells == [words, None]
                assert f"{name} none up to 240 mm" in page["summary"]
            assert row[name] == words and words in line
            for own in (frame, table):
                values = own.loc[(test, card), [f"{key}_mm", f"{key}_N"]].astype(float)
                wanted = [np.nan if v is None else v for v in (deflection, load)]
                np.testing.assert_allclose(values, wanted, rtol=1e-9)
                assert own.loc[(test, card), "reached_mm"] == 240.0
        if card == "soft":
            assert run["knee"]["load_N"] < 0.95 * run["limit_point"]["load_N"]


@pytest.mark.usefixtures("undrawn")
def test_finished_run_is_not_repeated(tmp_path, formula, monkeypatch):
    run = (write_cylinder_project(tmp_path), "--out", "out", "--jobs")
    bend(*run, 2, cwd=tmp_path)
    before = result_in(tmp_path / "out")
    kept = sorted((tmp_path / "out" / "runs").glob("*.npz"))
    assert len(kept) == 4 and formula.read_text() == "...."
    one_line(bend(*run, 1, cwd=tmp_path, code=2), "already holds results", "--resume")
    kept[0].unlink()
    kept[1].write_bytes(kept[1].read_bytes()[:100])
    bend(*run, 1, "--resume", cwd=tmp_path)
    assert formula.read_text() == "......"
    after = result_in(tmp_path / "out")
    for result in (before, after):
        result.pop("wall_s")
        for one in result["runs"]:
            one.pop("seconds")
    assert after == before
    # A card that changed is another run; the others are the same.
    write_cylinder_project(tmp_path, soft=501.0)
    bend(*run, 1, "--resume", cwd=tmp_path)
    assert formula.read_text() == "........"
    # Without a terminal progress is a plain line.
    monkeypatch.setattr(LiveLine, "line_interval", 0.0)
    done = bend(*run, 1, "--overwrite", cwd=tmp_path)
    assert formula.read_text() == "............"
    lines = [line for line in done.stderr.splitlines() if line.startswith("4 of 4 runs")]
    assert lines and "high with stiff: finished in" in lines[-1] and "0 s left" in lines[-1]


def test_failed_or_stopped_run_is_a_row_with_its_reason(tmp_path, monkeypatch):
    monkeypatch.setattr(CylinderPresenter, "show_outcome", lambda *_: Exhibit())
    project = write_cylinder_project(tmp_path, soft=FAILS)
    done = bend(project, "--out", "failed", cwd=tmp_path, code=4)
    one_line(done, "2 of 4 runs failed (150 mm, 90 kPa with soft: made to fail)", "--resume")
    runs = result_in(tmp_path / "failed")["runs"]
    assert [r["ended"] for r in runs] == ["failed: made to fail", "finished"] * 2
    assert "load_N" not in runs[0]
    # What was measured cannot be compared with a run that failed.
    measured(tmp_path)
    run = ("project.toml", "--test", "150 mm, 90 kPa", "--out", "m", "--overwrite", "--fail-above")
    bend(*run, 10.0, cwd=tmp_path)
    assert "above 0.01" in bend(*run, 0.01, cwd=tmp_path, code=1).stderr
    write_cylinder_project(tmp_path, 'measured.files = ["made-up.csv"]', soft=FAILS)
    assert "--fail-above" in bend(*run, 10.0, cwd=tmp_path, code=1).stderr
    assert done.stdout.count("soft   failed: made to fail") == 2
    table = pd.read_csv(tmp_path / "failed" / "runs.csv")
    assert table["ended"].tolist() == ["failed: made to fail", "finished"] * 2

    done = bend(project, "--out", "out", "--card", "soft", cwd=tmp_path, code=4)
    one_line(done, "formula: no run ended well: made to fail")
    assert not (tmp_path / "out" / "result.json").exists()
    page = (tmp_path / "out" / "report.html").read_text().replace("\u00a0", " ")
    assert "this failed, and there is no result: " in page
    for test in ("150 mm, 90 kPa", "high"):
        assert f"{test} with soft: failed: made to fail" in page

    done = bend(write_cylinder_project(tmp_path, soft=STOPS), "--out", "stopped", cwd=tmp_path)
    run = result_in(tmp_path / "stopped")["runs"][0]
    assert run["ended"] == "stopped at 120 of 240 mm: the run stopped early: so asked"
    assert run["load_N"]["240 mm"] is None and "stopped at 120 of 240 mm" in done.stdout


@pytest.mark.usefixtures("undrawn")
def test_card_of_a_fit_is_used_and_its_folder_left_unchanged(tmp_path):
    path = write_cylinder_project(tmp_path)
    text = path.read_text()
    cards = text[text.index("[[card]]") : text.index("[fit]")]
    bubble = "[[bubble]]\nradius = 100\npressures = [20]\n[bubble.data.known_solution]\n"
    path.write_text(text.replace(cards, f"{bubble}beta = [0,0,0,20,0,0,0,150,0,0,0,500]\n"))
    own = Path("out") / tmp_path.name
    one_line(bend(path, cwd=tmp_path, code=2), "project.toml: --card: ", f"{own}/material.toml")
    law = HypoelasticLaw.linear(700.0, 150.0, 20.0)
    write_card(MaterialCard(law, 0.81, "just fitted"), tmp_path / own / "material.toml")
    (tmp_path / own / "result.json").write_text("{}")
    bend(path, "--quiet", cwd=tmp_path)
    runs = result_in(tmp_path / f"{own}-bend")["runs"]
    assert [(r["test"], r["card"]) for r in runs] == [
        ("150 mm, 90 kPa", "just fitted"), ("high", "just fitted")
    ]  # fmt: skip
    assert sorted(p.name for p in (tmp_path / own).iterdir()) == ["material.toml", "result.json"]


@pytest.fixture
def card(tmp_path):
    path = tmp_path / "card.toml"
    write_card(MaterialCard(HypoelasticLaw.linear(600.0, 300.0, 40.0), 0.81, "linear"), path)
    return path


@pytest.mark.parametrize(
    ("option", "value", "words"),
    [
        ("--pressure", 140_000, "is this in Pa? Divide by 1000"),
        ("--diameter", 0.15, "is this in m? Multiply by 1000"),
        ("--span", 0.2, "is this in m? Multiply by 1000"),
    ],
)
def test_simulate_bend_doubts_units_before_it_runs(tmp_path, card, option, value, words):
    options = {"--diameter": 150, "--pressure": 140, option: value}
    given = [item for pair in options.items() for item in pair]
    done = bend(*given, "--card", card, cwd=tmp_path, command=("simulate", "bend"), code=2)
    assert done.stderr.startswith(f"bubblefit: {option}")
    assert done.stderr.strip().endswith(words)
    assert not (tmp_path / "out").exists()


def test_simulate_bend_runs_on_the_membrane(tmp_path, card, golden):
    short = ("--element-size", 30, "--deflection", 12, "--frames", 3, "--seam-width", 30)

    (tmp_path / "b.csv").write_text("deflection (mm),load (kg)\n0,0\n5,2\n10,4\n")
    done = bend("--diameter", 150, "--pressure", 140, "--card", card, *short, "--measured", "b.csv",
                cwd=tmp_path, command=("simulate", "bend"))  # fmt: skip
    golden("simulate-bend", done.stdout, tmp_path)
    out = tmp_path / "out" / "bend-150mm-140kPa"
    result = result_in(out)
    run, stiff = result["runs"]
    assert (result["command"], run["card"], run["ended"]) == ("predict", "linear", "finished")
    assert (run["wall"], stiff["wall"]) == ("tension field", "stiff wall")
    curves = pd.read_csv(out / "load_deflection.csv")
    assert curves["wall"].tolist() == ["tension field"] * 4 + ["stiff wall"] * 4
    curve, other = curves[:4], curves[4:]
    assert (np.diff(curve["load_N"]) > 0).all()
    # Nothing folds yet: what differs is the seam and the caps.
    np.testing.assert_allclose(other["load_N"], curve["load_N"], rtol=0.1)
    assert (other["load_N"].to_numpy()[1:] > curve["load_N"].to_numpy()[1:]).all()
    amount = (curve["gauge_pressure_kPa"] + 101.0) * curve["volume_mm3"]
    np.testing.assert_allclose(amount, amount.iloc[0], rtol=1e-9)
    # Closed form of a long tube: fill stress p r / t, warp half of it.
    assert run["inflation_strain"]["body"]["fill"] == pytest.approx(0.042, abs=0.003)
    assert run["error"]["compared"] == 3
    assert (out / "figures" / "150-mm-140-kPa-beam.png").exists()
