"""`bubblefit study` as a user runs it: files, lines, levels that fail, bad input."""

import re

import numpy as np
import pandas as pd
import pytest
from bubblefit.materials.card import MaterialCard, write_card
from bubblefit.materials.law import HypoelasticLaw

from ..commands import in_process, result_in
from ..drawings import check_convergence
from ..places import KNOWN
from ..projects import project_file
from ..published_laws import TABLE_4_2

#: Seconds of a level, in the table on the terminal.
SECONDS = re.compile(r"(?m)^( +\d+ +\d+) +\d+\.\d+")


def study(*arguments, cwd, code=0, card="card.toml"):
    name, *options = arguments
    run = ("study", name, "project.toml", "--card", card, *options)
    return in_process(*run, cwd=cwd, code=code).output


@pytest.fixture
def bubble(tmp_path):
    project_file(tmp_path, KNOWN.read_text(), ("elements = 800", "elements = 80"))
    law = HypoelasticLaw(1000 * np.array(TABLE_4_2), strain_range=[0.13] * 3)
    write_card(MaterialCard(law, 0.81, "Table 4.2"), tmp_path / "card.toml")
    return tmp_path


def test_mesh_of_a_bubble(bubble, drawn, golden):
    run = ("mesh", "--levels", 3, "--coarser", 0, "--out", "out")
    done = study(*run, cwd=bubble)
    result = result_in(bubble / "out")
    model = result["models"]["bubble"]
    counts = [level["elements"] for level in model["levels"]]
    assert counts[2] == 4 * counts[1]
    assert all(level["seconds"] > 0 and level["iterations"] > 0 for level in model["levels"])
    apex = model["quantities"]["apex at 300 kPa, mm"]
    assert apex["limit"] == pytest.approx(39.7838, abs=0.02)  # of 12800 quads on the quarter
    assert abs(apex["own_error"]) < 5e-3 and apex["own_error_against"] == "limit"
    assert len(model["quantities"]) == 8 and "rms_N" not in model
    table = pd.read_csv(bubble / "out/convergence.csv")
    assert len(table) == 3 * 8
    assert (table[table.elements == counts[-1]].off_finest == 0).all()
    coarse = table[(table.factor == 1) & (table.quantity == "apex at 300 kPa, mm")].iloc[0]
    assert coarse.value - coarse.off_finest == pytest.approx(apex["finest"])
    assert (bubble / "out/convergence.png").stat().st_size > 10_000
    check_convergence(drawn[-1], table, "elements")
    names = {s.name for s in drawn[-1].charts[0].series[:-2]}
    assert names == set(model["quantities"])
    golden("study-mesh", SECONDS.sub(r"\1  N", done), bubble)
    assert "--overwrite" in study(*run, cwd=bubble, code=2)


def test_nothing_that_ends_well_is_exit_code_4(bubble):
    card = MaterialCard(HypoelasticLaw(1000 * np.array([*TABLE_4_2[:11], -0.1])), 0.81)
    write_card(card, bubble / "bad.toml")
    for command in ("mesh", "nu12"):
        done = study(command, cwd=bubble, code=4, card="bad.toml")
        assert len(done.splitlines()) == 1 and not (bubble / "out").exists()
