"""Profile likelihood of moduli: closed forms of strips, bounds, what is written and said."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from bubblefit.errors import InputError
from bubblefit.inference.likelihood import BOUND, THRESHOLD, Side
from bubblefit.materials.card import MaterialCard, write_card
from bubblefit.materials.law import HypoelasticLaw
from bubblefit.notes import NoteKind
from bubblefit.project.project import read_project
from bubblefit.runs.profile import Profile, profile

from ..commands import in_process
from ..page_charts import charts_of
from ..projects import ELONGATION, constant_strips

#: MPa; not quite the optimum of test "one", which is at 330 and 190.
CARD = MaterialCard(HypoelasticLaw.linear(328.0, 190.5, 10.0, 0.0), 0.8, "near")
STRAIN = np.log1p(ELONGATION[ELONGATION <= 2.9] / 20)


def sigma_of(specimens: tuple[float, float], scatter: float) -> float:
    """One standard deviation (MPa) of the mean modulus of two specimens, from their loads.

    A specimen is stiffer along all of its curve: its loads count as one, and of two specimens one
    is taken up by their mean.
    """
    best = np.mean(specimens)
    off = np.concatenate([20 * (m - best) * STRAIN for m in specimens])
    noise = max(float(np.sqrt(np.mean(off**2))), scatter)
    return float(noise / np.sqrt(np.mean((20 * STRAIN) ** 2)))


def test_a_linear_modulus_has_the_ends_of_its_sigma(tmp_path: Path) -> None:
    """A load is linear in a constant modulus: -2 log L is a parabola, and nothing is curved."""
    project = read_project(constant_strips(tmp_path)).with_fit(jobs=1)
    told: list[tuple[int, int, str]] = []
    found = profile(project, {"E1": [0.05], "E2": [0.0]}, CARD, "one",
                    progress=lambda *event: told.append(event))  # fmt: skip
    strips = project.tests["one"].strips  # type: ignore[attr-defined]
    for one, specimens, direction in zip(
        found.each, ((300.0, 360.0), (200.0, 180.0)), ("warp", "fill"), strict=True
    ):
        best, sigma = np.mean(specimens), sigma_of(specimens, strips[direction].scatter)
        assert one.best == pytest.approx(best, rel=1e-5)
        assert one.sigma == pytest.approx(sigma, rel=1e-3)
        away = np.sqrt(THRESHOLD) * sigma
        assert one.ends == pytest.approx((best - away, best + away), rel=1e-4)
        values, ratios = (np.array(v) for v in one.curve)
        assert (np.diff(values) > 0).all() and len(values) >= 7
        np.testing.assert_allclose(ratios, ((values - best) / sigma) ** 2, atol=0.01)
        assert one.asymmetry == pytest.approx(1.0, abs=1e-3) and "asymmetric" not in one.words
        # Four places and no refits: one analysis each, at a linear problem.
        assert one.analyses <= 2 * len(values)
    # The card's moduli are not the optimum's, but near them.
    assert not found.notes
    assert [done for done, _, _ in told] == sorted(done for done, _, _ in told)
    assert told[-1][:2] == (4, 4) and "E1 at 0.05" in {name for _, _, name in told}


def test_what_no_test_knows_is_not_closed(tmp_path: Path) -> None:
    """No strip along a yarn says anything of shear: its modulus goes from bound to bound."""
    project = read_project(constant_strips(tmp_path)).with_fit(jobs=1)
    far = replace(CARD, law=HypoelasticLaw.linear(360.0, 190.0, 10.0, 0.0))
    found = profile(project, {"G12": []}, far, "one")
    (one,) = found.each
    assert one.ends == (None, None) and one.numbers["lower_MPa"] is None
    assert one.below.why == one.above.why == BOUND
    assert one.allowed == pytest.approx((5.0, 200.0), rel=1e-6)
    assert [one.below.values[-1], one.above.values[-1]] == pytest.approx([5.0, 200.0], rel=1e-6)
    assert one.words.startswith("10 MPa, 95 % from the bound, 5, to the bound, 200,")
    kinds = [note.kind for note in found.notes]
    assert kinds == [NoteKind.NOT_THE_CARD, NoteKind.NOT_CLOSED, NoteKind.NOT_CLOSED]
    assert "moved E1 by -8.3 %" in found.notes[0]
    assert found.notes[1].startswith(
        "not closed below: it meets the bound of the fit, 5 MPa; -2 log L is 0 of"
    )


def test_words_of_what_is_uneven() -> None:
    below = Side((10.0, 9.0, 8.0), (0.0, 1.0, 4.0), "", 2)
    above = Side((10.0, 12.0, 14.0), (0.0, 1.0, 4.0), "", 2)
    one = Profile("G12", 0.02, 10.0, 1.0, (8.0, 12.0), below, above, (1.0, 99.0))
    root = np.sqrt(THRESHOLD)
    assert one.ends == pytest.approx((10 - root, 10 + 2 * root), rel=0.01)
    assert one.asymmetry == pytest.approx(2.0)
    assert one.words.endswith("; asymmetric: 1.96 below, 3.92 above")
    better = replace(one, above=Side((10.0, 12.0), (0.0, -3.0), "bound", 2))
    kinds = {note.kind: str(note) for note in better.notes}
    assert "another optimum fits the data better" in kinds[NoteKind.NOT_THE_CARD]
    assert kinds[NoteKind.NOT_CLOSED].startswith("not closed above")


@pytest.mark.parametrize(
    ("given", "said"),
    [
        ({"moduli": {"G23": []}}, "--modulus: expected one of E1, E2, G12, got 'G23'"),
        ({"moduli": {"E1": [-0.1]}}, "--modulus: expected strains of 0 or more, got -0.1"),
        ({"moduli": {"E1": [0.3]}}, "E1 is fitted up to strain 0.12; got 0.3"),
        ({"card": MaterialCard(HypoelasticLaw(np.ones(12)), 0.8, "cubic")}, "of this project's"),
        ({"card": None}, "fit first"),
    ],
)
def test_what_cannot_be_meant(tmp_path: Path, given: dict, said: str) -> None:
    project = read_project(constant_strips(tmp_path)).with_fit(jobs=1)
    with pytest.raises(InputError, match=said):
        profile(project, **{"card": CARD, **given})


def test_the_command(tmp_path: Path) -> None:
    """Curve, page, figure and json say the same; the card is the one that the fit left."""
    constant_strips(tmp_path)
    (tmp_path / "out" / tmp_path.name).mkdir(parents=True)
    write_card(CARD, tmp_path / "out" / tmp_path.name / "material.toml")
    command = ("profile", "project.toml", "--modulus", "E1", "--modulus", "E2=0.02,0.1",
               "--strain", "0.04", "--test", "one", "--out", "there")  # fmt: skip
    done = in_process(*command, "--quiet", "--jobs", "2", cwd=tmp_path)
    folder = tmp_path / "there"
    said = json.loads((folder / "result.json").read_text())
    names = [(one["modulus"], one["strain"]) for one in said["profiles"]]
    assert names == [("E1", 0.04), ("E2", 0.02), ("E2", 0.1)]
    table = pd.read_csv(folder / "profile.csv")
    first = said["profiles"][0]
    own = table[(table["modulus"] == "E1") & (table["strain"] == 0.04)]
    np.testing.assert_allclose(own["MPa"], first["curve_MPa"], rtol=1e-8)
    np.testing.assert_allclose(own["minus_2_log_L"], first["curve_minus_2_log_L"], rtol=1e-8)
    np.testing.assert_allclose(own["by_sigma"], own["minus_2_log_L"], atol=0.01)
    words = f"E1 at strain 0.04: 330 MPa, 95 % from {first['lower_MPa']:.4g} to "
    assert words in done.output and words in (folder / "report.html").read_text()
    assert said["analyses"] > sum(one["analyses"] for one in said["profiles"])
    assert f"{said['analyses']} analyses" in done.output
    charts = charts_of(folder)["profiles"]
    assert len(charts) == 3 and charts[0].series[0].x == pytest.approx(own["MPa"], rel=1e-5)
    assert charts[0].series[0].y == pytest.approx(own["minus_2_log_L"], rel=1e-5, abs=1e-9)
    ends = [series.x[0] for series in charts[0].series if series.name == "ends"]
    assert ends == pytest.approx([first["lower_MPa"], first["upper_MPa"]], rel=1e-5)
    assert (folder / "profile.png").stat().st_size > 10_000
    refused = in_process(*command, "--quiet", cwd=tmp_path, code=2)
    assert "already holds a result" in refused.output + refused.stderr
