"""[fit.unknowns]: what a fit says of nu12 and thickness on terminal, page, card and in numbers."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from bubblefit.errors import InputError
from bubblefit.materials.card import read_card
from bubblefit.project.project import read_project
from bubblefit.runs.fit import fit
from bubblefit.runs.setup import prepare_fit, shared_unknowns

from ..commands import in_process
from ..projects import constant_strips

FIT = "[fit]\nstarts = 2\nseed = 7\n"


def project(folder: Path, unknowns: str, *changes: tuple[str, str]):
    return read_project(constant_strips(folder, (FIT, f"{FIT}[fit.unknowns]\n{unknowns}\n"),
                                        *changes))  # fmt: skip


def test_a_fit_with_the_thickness_unknown(tmp_path: Path) -> None:
    """Strips know modulus times thickness: 5 % of thickness are 5 % of every modulus.

    Terminal, page, table of history, result.json and card say the same of it.
    """
    unknown = "[fit.unknowns]\nthickness = { bounds = [0.7, 0.9], prior = 0.04 }\n"
    fixed = fit(read_project(constant_strips(tmp_path)), starts=1, jobs=1).result
    constant_strips(tmp_path, (FIT, FIT + unknown))
    done = in_process("uniaxial", "project.toml", "--starts", 1, "--jobs", 1, "--out", "free",
                      cwd=tmp_path)  # fmt: skip
    free = json.loads((tmp_path / "free" / "result.json").read_text())
    said = free["unknowns"]["thickness"]
    assert said["value"] == pytest.approx(0.8, abs=1e-3)
    assert said["sigma"] == pytest.approx(0.04, rel=0.01) and not said["determined"]
    assert "unknowns" not in fixed
    words = f"thickness: {said['verdict']}"
    assert words in done.output.splitlines()
    assert "the data say nothing of it (known to 0.04 mm before); a membrane" in words
    page = (tmp_path / "free" / "report.html").read_text()
    assert said["verdict"] in page and "Unknowns beside the moduli" in page
    assert "thickness (fitted)" in page and "nu12 (fixed)" in page
    assert [n["kind"] for n in free["notes"] if n["note"].startswith("thickness is")] == [
        "uncertain"
    ]
    for name in ("E1", "E2"):
        own, without = (r["uncertainty"]["median_relative_sigma"][name] for r in (free, fixed))
        assert own == pytest.approx(np.hypot(without, 0.05), rel=0.02)
    assert read_card(tmp_path / "free" / "material.toml").thickness == pytest.approx(said["value"])
    assert "thickness" in pd.read_csv(tmp_path / "free" / "history.csv").columns


def test_what_is_shared_stands_before_each_comparisons_own(tmp_path: Path) -> None:
    both = "nu12 = {}\nthickness = { prior = 0.02 }"
    problem = prepare_fit(own := project(tmp_path, both), own.chosen(None, fitted=True)).problem()
    assert problem.unknowns.nuisance_names == ("nu12", "thickness")
    nu12, thickness = problem.unknowns.nuisance.shared
    assert (nu12.lower, nu12.upper, nu12.start, nu12.prior) == (0.0, 0.6, 0.0, None)
    assert (thickness.lower, thickness.upper) == pytest.approx((0.4, 1.2))
    assert (thickness.start, thickness.prior, thickness.unit) == (0.8, 0.02, "mm")
    # Noise of a block's norm: the median of what the strips' objectives have.
    weights = [
        c.objective.least_noise / c.objective.scale[0] / np.sqrt(c.objective.sizes[0])
        for c in problem.comparisons
    ]
    assert thickness.weight == pytest.approx(np.median(weights))
    # The start of every comparison's model is its own thickness.
    y = problem.unknowns.at(np.array([10.0, 200.0, 300.0]))
    assert y[3:].tolist() == [0.0, 0.8]


def test_thickness_is_in_the_units_of_the_file(tmp_path: Path) -> None:
    pull = "{ gauge_length = %s, final_length = %s }"
    said = project(
        tmp_path, "thickness = { bounds = [7e-4, 9e-4], prior = 3e-5 }",
        ('modulus = "GPa"', 'modulus = "GPa"\nlength = "m"'),
        ("thickness = 0.8", "thickness = 8e-4"),
        (f"warp = {pull % (20, 22.9)}", f"warp = {pull % (0.02, 0.0229)}"),
        (f"fill = {pull % (20, 22.9)}", f"fill = {pull % (0.02, 0.0229)}"),
        (f"warp = {pull % (20, 22.5)}", f"warp = {pull % (0.02, 0.0225)}"),
    )  # fmt: skip
    (thickness,) = shared_unknowns(said)
    assert (thickness.lower, thickness.upper) == pytest.approx((0.7, 0.9))
    assert (thickness.start, thickness.prior) == pytest.approx((0.8, 0.03))


@pytest.mark.parametrize(
    ("unknowns", "key", "words"),
    [
        ("nu12 = { bounds = [0.3, 0.1] }", "nu12.bounds", "expected [least, largest], got [0.3,"),
        ("nu12 = { bounds = [0.1, 0.3] }", "nu12.bounds", "expected bounds around 0, from which"),
        ("nu12 = { bounds = [-0.1, 0.3] }", "nu12.bounds", "expected numbers from 0 to below 1,"),
        ("nu12 = { bounds = [0.0, 1.0] }", "nu12.bounds", "expected numbers from 0 to below 1,"),
        (
            "thickness = { bounds = [0.0, 1.0], prior = 1.0 }",
            "thickness.bounds",
            "expected thicknesses above",
        ),
        (
            "thickness = { bounds = [0.9, 1.0], prior = 1.0 }",
            "thickness.bounds",
            "expected bounds around 0.8,",
        ),
        ("thickness = {}", "thickness.prior", "this key is missing; a membrane under load knows"),
        ("thickness = { prior = 0.0 }", "thickness.prior", "greater than 0"),
        ("nu21 = {}", "nu21", "allowed here: nu12, thickness"),
    ],
)
def test_what_cannot_be_meant(tmp_path: Path, unknowns: str, key: str, words: str) -> None:
    with pytest.raises(InputError) as told:
        own = project(tmp_path, unknowns)
        prepare_fit(own, own.chosen(None, fitted=True))
    assert told.value.field == f"fit.unknowns.{key}"
    assert words in told.value.problem
