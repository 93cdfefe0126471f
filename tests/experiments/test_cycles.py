"""experiments/cycles: [[cycles]] of a project, fits of whole histories, commands."""

import json
import re
from dataclasses import replace

import bubblefit as bf
import numpy as np
import pytest
from bubblefit import cycles
from bubblefit.experiments.cycles import specimen_of
from bubblefit.experiments.cycles.evaluation import SLIP, evaluate_history
from bubblefit.materials.card import MaterialCard, write_card
from bubblefit.materials.forms.spline import Spline
from bubblefit.materials.law import HypoelasticLaw
from bubblefit.materials.memory import NAMES
from bubblefit.readers.histories import read_history
from bubblefit.runs.setup import prepare_fit

from ..builders.load_histories import THREE_CYCLES, write_history
from ..support.commands import in_process
from ..support.refusals import complaint
from .cycles.cases import CYCLES_BETA, CYCLES_MEMORY, CYCLES_PROJECT, loops_project


def test_fit_of_histories_gives_moduli_and_memory(tmp_path):
    project = loops_project(tmp_path, 100, 25)
    found = bf.fit(project, starts=1)
    assert found.objective < 1e-6
    memory = np.array(found.law.memory.constants[:8])
    assert memory == pytest.approx(np.array(CYCLES_MEMORY.constants[:8]), rel=2e-6)
    assert found.law.beta[2:] == pytest.approx(CYCLES_BETA[2:], rel=1e-5)
    sigma = {one.name: one.sigma for one in found.verdicts if one.shared}
    assert {*sigma} == {*NAMES[:8]} and all(0 < own < 1 for own in sigma.values())
    written = found.report(tmp_path / "out")
    card = bf.read_card(tmp_path / "out" / "material.toml")
    assert card.law.memory == found.law.memory and "cycles.png" in written.read_text()
    table = found.residuals()
    assert {*table["cycle"]} == {1, 2, 3} and table["difference"].abs().max() < 1e-3
    # Every cycle that the others reach is predicted without it.
    left = bf.validate(project, leave="cycles", starts=1).table()
    assert {*left["test"]} == {f"loops: cycle 2 of {yarn} {yarn}" for yarn in ("warp", "fill")}
    assert left["foretold_relative"].max() < 1e-5


def test_history_slopes_are_differences_and_reloading_stays_below(tmp_path):
    problem = prepare_fit(
        project := loops_project(tmp_path, 12, 9), list(project.tests.values())
    ).problem()
    y = np.r_[np.ones(8), 0.4, 1.5, 1.2, 3.0, 0.5, 1.6, 1.3, 2.0]
    point = problem.evaluate(y, True, warm=False)
    for k in range(len(y)):
        step = 1e-5 * np.eye(len(y))[k]
        ends = [problem.evaluate(y + s * step, False, warm=False).residual for s in (1, -1)]
        slope = (ends[0] - ends[1]) / 2e-5
        assert point.jacobian[:, k] == pytest.approx(slope, abs=1e-6 * np.abs(slope).max() + 1e-9)
    rows, least = problem.unknowns.inequalities
    crossed = y.copy()
    crossed[[9, 10]] = 1.2, 1.5
    assert (rows @ y >= least).all() and not (rows @ crossed >= least).all()
    law = problem.unknowns.law(problem.law, crossed)
    assert law.memory.reloading[0] == law.memory.unloading[0] == 1.2


def test_readings_are_averaged_over_each_branch_and_turns_stay(plain_history_file):
    one = specimen_of("warp", evaluate_history(read_history(plain_history_file), 100.0), 10)
    assert np.unique(one.branch).tolist() == list(range(6)) and one.predictable == (2,)
    counts = np.unique(one.branch, return_counts=True)[1]
    assert (counts <= 10).all() and (counts >= 8).all()
    for number, (_, top, peak) in enumerate(THREE_CYCLES):
        last = np.flatnonzero(one.branch == 2 * number)[-1]
        assert one.strain[last] == pytest.approx(top - one.evaluated.zero)
        assert one.load[last] == pytest.approx(peak - 100.0)
    # Straight branches stay straight.
    own = one.branch == 4
    assert np.polyfit(one.strain[own], one.load[own], 1, full=True)[1] < 1e-6


@pytest.mark.parametrize(
    ("old", "new", "field"),
    [
        ('[law.memory]\nwarp = "fitted"\nfill = "fitted"\n', "", "law.memory"),
        ('fill = "fitted"', 'fill = "fit"', "law.memory.fill"),
        ('fill = "fitted"', "fill = { unloading = 0.5 }", "law.memory.fill.unloading"),
        ('fill = "fitted"', "fill = { reloading = 1.5 }", "law.memory.unloading"),
        ('["fill.csv"]', '["fill.csv", "fill.csv"]', "files.fill[1]"),
        ('["fill.csv"]', '["weft.csv"]', "files.fill[0]"),
        ("reference_load = 5.0", "reference_load = 5000.0", "reference load"),
        ('fill = ["fill.csv"]', 'bias = ["fill.csv"]', "gauge_length"),
    ],
)
def test_wrong_cycles_section_names_its_key(tmp_path, old, new, field):
    loops_project(tmp_path, 12, 9)
    path = tmp_path / "project.toml"
    path.write_text(path.read_text().replace(old, new))

    def begun():
        project = bf.read_project(path)
        prepare_fit(project, list(project.tests.values()))

    assert field in complaint(begun)


def test_left_out_cycles_are_predicted_by_fits_of_histories(shared_data, tmp_path):
    text = CYCLES_PROJECT.format(increments=12).replace('fill = "fitted"\n', "").replace(
        'files = { warp = ["warp.csv"], fill = ["fill.csv"] }',
        f'files = {{ warp = ["cord_typ_test1.csv"] }}\nfolder = "{shared_data / "webbing"}"',
    )  # fmt: skip
    text = text.replace("0.04, 0.08], fill", "0.004, 0.008, 0.0145], fill")
    text = text.replace("[0.08, 0.08, 1.0]", "[0.0145, 0.08, 1.0]")
    text = text.replace("[20.0, 2000.0]", "[50.0, 50000.0]").replace("= 5.0", "= 89.0")
    (tmp_path / "project.toml").write_text(text)
    table = bf.validate(bf.read_project(tmp_path / "project.toml"), leave="cycles", starts=1)
    errors = table.table()["foretold_relative"]
    assert len(errors) == 2 and errors.max() < 0.05


@pytest.fixture
def slipped_project(tmp_path):
    """A project of two histories, of which the extensometer along the warp slips; a card."""
    loops_project(tmp_path, 12, 25)
    load, strain = np.loadtxt(tmp_path / "warp.csv", delimiter=",", skiprows=1).T
    strain[24 * 2 + 2 :] -= 0.004
    write_history(tmp_path / "warp.csv", ["load_N,strain"], (load, strain))
    form = Spline.at([[0.0, 0.04, 0.08], [0.0, 0.04, 0.08], [0.0, 1.0]])
    law = HypoelasticLaw(CYCLES_BETA, 0.24, [0.08, 0.08, 1.0], form=form, memory=CYCLES_MEMORY)
    write_card(MaterialCard(law, 0.8, "made"), tmp_path / "card.toml")
    return tmp_path


def test_check_simulate_and_validate_note_slip_as_cycles_does(slipped_project):
    found = cycles(slipped_project / "warp.csv", reference_load=5.0)
    (slip,) = [str(note) for note in found.notes if note.kind == SLIP]
    checked = in_process("check", "project.toml", "--out", "check", cwd=slipped_project).stdout
    card = ("--card", "card.toml")
    simulated = in_process(
        "simulate", "test", "project.toml", *card, "--out", "s", cwd=slipped_project
    )
    validated = in_process("validate", "project.toml", *card, "--out", "v", cwd=slipped_project)
    for text in (checked, simulated.stdout, validated.stdout):
        assert slip in " ".join(text.split())
        assert "one specimen of the fill" in " ".join(text.split())
    assert "loops: warning [extensometer slip]: warp.csv: " in checked
    assert "loops: note: fill fill: 3 cycles to" in checked
    for folder in ("s", "v"):
        notes = json.loads((slipped_project / folder / "result.json").read_text())["notes"]
        assert slip in [note["note"] for note in notes]
    page = (slipped_project / "check" / "report.html").read_text()
    assert "carry 1 doubt with it" in page.replace("\u00a0", " ")


def test_help_lists_what_can_be_left_out(tmp_path):
    project = loops_project(tmp_path, 12, 9)
    setup = prepare_fit(project, list(project.tests.values()))
    text = " ".join(in_process("validate", "--help", cwd=tmp_path).stdout.split())
    listed = re.search(r"Left out in turn: (.*?)\.", text).group(1)
    for sort in setup.tests[0].parts:
        assert sort in listed


def test_finer_elements_of_a_bias_strip_are_not_those_of_finer_increments(tmp_path):
    project = loops_project(tmp_path, 12, 9)
    (test,) = project.tests.values()
    specimen = replace(next(iter(test.matched.values())), direction="bias")
    bias = replace(test, matched={"bias": specimen}, grip_distance=200.0)
    plain, finer_increments, finer = (
        len(bias.models(refined=refined, factor=factor)["bias"].mesh.quads)
        for refined, factor in (("elements", 1.0), ("increments", 2.0), ("elements", 2.0))
    )
    assert (plain, finer_increments, finer) == (4 * 12, 4 * 12, 8 * 24)
