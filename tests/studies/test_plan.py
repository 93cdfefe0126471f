"""Which test next: predicted uncertainties against closed forms, ranks, what is written."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest
from bubblefit.errors import InputError, SolverFailure
from bubblefit.experiments.bubble import candidates as bubbles
from bubblefit.experiments.strips import candidates as strips
from bubblefit.inference.assessment import uncertainty_from
from bubblefit.inference.noise import Noise
from bubblefit.materials.card import MaterialCard, write_card
from bubblefit.materials.law import HypoelasticLaw
from bubblefit.notes import NoteKind
from bubblefit.project.project import read_project
from bubblefit.runs import plan as module
from bubblefit.runs.plan import NOW, Plan, Planned, Present, plan

from ..commands import in_process
from ..page_charts import charts_of
from ..projects import ELONGATION, constant_strips, small
from ..published_laws import TABLE_4_2

ENDS = (0.1, 0.1, 0.05)
#: MPa; without contraction loads of strips along the yarns are 20 mm^2 E ln(1 + u/20).
CARD = MaterialCard(HypoelasticLaw.linear(330.0, 190.0, 10.0, 0.0), 0.8, "linear")
STRAIN = np.log1p(ELONGATION / 20)


@pytest.fixture
def few(monkeypatch: pytest.MonkeyPatch) -> None:
    """Coarse models of candidates."""
    monkeypatch.setattr(bubbles, "ELEMENTS", 32)
    monkeypatch.setattr(bubbles, "ANGLES", ())
    monkeypatch.setattr(strips, "ANGLES", ())
    monkeypatch.setattr(strips, "INCREMENTS", 4)


def known(made: Plan) -> dict[str, Planned]:
    return {planned.name: planned for planned in made.candidates}


def test_strips_of_constant_moduli(
    tmp_path: Path, few: None, monkeypatch: pytest.MonkeyPatch
) -> None:
    """In closed form: sigma of a modulus is noise over the root of the sum of squared slopes."""
    monkeypatch.setattr(bubbles, "ANGLES", (45.0,))
    project = read_project(constant_strips(tmp_path))
    made = plan(project, CARD, strain=ENDS)
    one = np.tile(STRAIN[ELONGATION <= 2.9], 2)
    two = np.tile(STRAIN[ELONGATION <= 2.5], 2)

    def spread(loads: tuple[float, float], strain: np.ndarray, law: float) -> float:
        """RMS of two specimens about a law: the noise that a fit reckons with."""
        half = len(strain) // 2
        off = np.concatenate([20 * (m - law) * strain[:half] for m in loads])
        return float(np.sqrt(np.mean(off**2)))

    scatter = [project.tests[name].strips["warp"].scatter for name in ("one", "two")]
    noise = [
        max(spread((300.0, 360.0), one, 330.0), scatter[0]),
        max(spread((330.0, 410.0), two, 330.0), scatter[1]),
    ]
    # The loads of a specimen count as one; one of two is taken up by their mean.
    each = [np.mean((20 * s) ** 2) / n**2 for s, n in zip((one, two), noise, strict=True)]
    assert made.now.summary["E1"] == pytest.approx(sum(each) ** -0.5 / 330, rel=2e-3)
    assert made.now.summary["G12"] == pytest.approx(10.0)  # nothing is known of it
    # Three more specimens as those of the first test, of which there are two.
    more = known(made)["warp strip"]
    assert more.specimens == 3
    levels = np.log1p(2.9 * np.arange(1, 5) / 4 / 20)
    value = noise[0] * np.sqrt(2 * len(levels))
    added = 3 * np.sum((20 * levels) ** 2) / value**2
    assert more.summary["E1"] == pytest.approx((sum(each) + added) ** -0.5 / 330, rel=2e-3)
    assert more.summary["E2"] == pytest.approx(made.now.summary["E2"], rel=1e-9)
    assert more.noise == f"{value:.3g} N at 4 values (that of one)"
    # Only what shears the sheet says anything of G12.
    sheared = [p.name for p in made.candidates if p.summary["G12"] < 1]
    assert set(sheared) == {"strip at 45 degrees", "bubble, elliptic rim at 45 degrees"} | {
        p.name for p in made.candidates if p.name.startswith("bubble") and p.summary["G12"] < 1
    }
    worst = [max(p.summary.values()) for p in made.candidates]
    assert worst == sorted(worst)
    assert made.candidates[0].name in sheared
    # By E1 alone a strip across the yarns is no good.
    by_warp = plan(project, CARD, strain=ENDS, rank="E1")
    values = [p.summary["E1"] for p in by_warp.candidates]
    assert values == sorted(values) and by_warp.criterion.startswith("1 sigma of E1,")
    following = by_warp.following
    assert following is not None and following.summary["E1"] < values[0]


def test_a_test_made_again_halves_the_variance(tmp_path: Path, few: None) -> None:
    """Whatever the model's mesh: the same bubble counts as much as it does in the fit."""
    # So little noise that what is known before any test does not count.
    project = read_project(small(tmp_path, ('objective = "e"', 'objective = "e"\nnoise = 1e-3')))
    made = plan(project, bubble_card())
    again = known(made)["the same bubble again"]
    for name in ("E1", "E2"):
        ratio = again.summary[name] / made.now.summary[name]
        assert ratio == pytest.approx(0.5**0.5, rel=1e-3)
    # Twice noisier values of the new bubble alone: 1 + 1/4 of what is known now.
    noisy = plan(project, bubble_card(), noise={"bubble": 2e-3})
    ratio = known(noisy)["the same bubble again"].summary["E1"] / noisy.now.summary["E1"]
    assert ratio == pytest.approx(1.25**-0.5, rel=1e-3)
    assert "(given)" in known(noisy)["the same bubble again"].noise
    # Four specimens say as much as four tests.
    four = plan(project, bubble_card(), specimens=4)
    ratio = known(four)["the same bubble again"].summary["E2"] / four.now.summary["E2"]
    assert ratio == pytest.approx(0.2**0.5, rel=1e-3)


def bubble_card() -> MaterialCard:
    law = HypoelasticLaw(1000 * np.array(TABLE_4_2), strain_range=[0.1, 0.1, 0.08])
    return MaterialCard(law, 0.81, "Table 4.2")


def test_what_is_known_now_is_what_a_fit_says_its_tests_pin_down(tmp_path: Path, few: None) -> None:
    """The same from `uncertainty_from`, which inverts the whole at once; with offsets unknown."""
    path = small(tmp_path, ("displacement_offset = false", "displacement_offset = true"),
                 ("pressure_offset = false", "pressure_offset = true"))  # fmt: skip
    here: list[Present] = []
    original = module.present_tests

    def remember(*given: Any) -> Present:
        here.append(original(*given))
        return here[0]

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(module, "present_tests", remember)
        made = plan(read_project(path), bubble_card())
    present = here[0]
    noise = Noise.of(present.problem, present.point.residual).rows
    pinned = uncertainty_from(present.problem, present.point, present.law, made.ends, [0], noise)
    for name, sigma in made.now.sigma.items():
        np.testing.assert_allclose(sigma, pinned[name], rtol=1e-6)


def test_what_cannot_be_computed_is_left_out_and_named(
    tmp_path: Path, few: None, monkeypatch: pytest.MonkeyPatch
) -> None:
    made = strips._made

    def fails(pull, *rest):
        if pull.direction == "fill":
            raise SolverFailure("no equilibrium", "membrane")
        return made(pull, *rest)

    monkeypatch.setattr(strips, "_made", fails)
    told: list[tuple[int, int, str]] = []
    found = plan(read_project(constant_strips(tmp_path)), CARD, strain=ENDS,
                 progress=lambda *event: told.append(event))  # fmt: skip
    assert "fill strip" not in known(found)
    failed = [note for note in found.notes if note.kind == NoteKind.FAILED]
    assert [note.of for note in failed] == ["fill strip"] and "no equilibrium" in failed[0]
    assert [done for done, _, _ in told] == list(range(len(told)))
    assert {total for _, total, _ in told} == {len(told)}
    assert "fill strip" in [name for _, _, name in told]


def test_strains_at_which_moduli_are_asked_for(tmp_path: Path, few: None) -> None:
    project = read_project(constant_strips(tmp_path))
    limited = replace(CARD, law=replace(CARD.law, strain_range=np.array([0.09, 0.2, 0.03])))
    # The card's valid range, but no further than the law of the project goes.
    np.testing.assert_allclose(plan(project, limited).ends, [0.09, 0.14, 0.03])
    # A card without one: as far as the present tests are strained.
    reached = plan(project, CARD).ends
    np.testing.assert_allclose(reached[:2], np.log([22.9 / 20] * 2), rtol=1e-3)
    for strain in ((0.1, 0.1), (0.1, 0.0, 0.1)):
        with pytest.raises(InputError, match="--strain: expected three strains above 0"):
            plan(project, CARD, strain=strain)


@pytest.mark.parametrize(
    ("given", "said"),
    [
        ({"rank": "G23"}, "--rank: expected one of worst, E1, E2, G12, got 'G23'"),
        ({"noise": {"strips": 0.0}}, "--noise: expected KIND=VALUE above 0, KIND of: "),
        ({"noise": {"torsion": 1.0}}, "got torsion=1"),
        ({"card": None}, "fit first"),
    ],
)
def test_what_cannot_be_meant(tmp_path: Path, given: dict, said: str) -> None:
    project = read_project(constant_strips(tmp_path))
    with pytest.raises(InputError, match=said):
        plan(project, **{"card": CARD, **given})


def test_the_command(tmp_path: Path, few: None) -> None:
    """Table, page, figure and json say the same; the card is the one that the fit left."""
    constant_strips(tmp_path)
    with_range = replace(CARD, law=replace(CARD.law, strain_range=np.array(ENDS)))
    (tmp_path / "out" / tmp_path.name).mkdir(parents=True)
    write_card(with_range, tmp_path / "out" / tmp_path.name / "material.toml")
    done = in_process("plan", "project.toml", "--out", "plan", cwd=tmp_path)
    result = json.loads((tmp_path / "plan" / "result.json").read_text())
    table = pd.read_csv(tmp_path / "plan" / "plan.csv")
    assert result["card"] == "of the fit" and result["tests"] == ["one", "two"]
    assert table["test"].tolist() == [NOW, *(c["test"] for c in result["candidates"])]
    assert table["rank"].tolist() == list(range(len(table)))
    first = result["candidates"][0]
    assert table.loc[1, "sigma_G12"] == pytest.approx(first["sigma"]["G12"], rel=1e-5)
    assert table.loc[1, "sigma_E1_at_0.1"] == pytest.approx(first["sigma_at"]["E1"][2], rel=1e-5)
    assert result["now"]["unknown"] == ["G12"]
    said = done.output.splitlines()
    now = next(line for line in said if line.split()[:1] == [NOW])
    assert now.split()[-1] == "unknown"
    assert next(line for line in said if line.startswith(" 1. ")).split()[1] in first["test"]
    assert any(line.startswith("Assumed:") for line in said)
    page = (tmp_path / "plan" / "report.html").read_text()
    assert first["test"] in page and "unknown" in page
    (chart,) = charts_of(tmp_path / "plan")["plan"]
    assert chart.x_names[0] == "the present tests alone"
    for rank, (own, one) in enumerate(zip(chart.x_names[1:], result["candidates"], strict=True), 1):
        assert own.startswith(f"{rank}. {one['test']}")
    for series in chart.series:
        own = 100 * table[f"sigma_{series.name}"].to_numpy()
        assert series.y == [pytest.approx(v, rel=1e-4) if v < 100 else None for v in own]
    assert "Assumed:" in page
    again = in_process("plan", "project.toml", "--out", "plan", cwd=tmp_path, code=2)
    assert "already holds a result" in again.output
    bad = in_process("plan", "project.toml", "--noise", "strips", "--out", "p", cwd=tmp_path,
                     code=2)  # fmt: skip
    assert "--noise: expected KIND=VALUE, such as strips=20" in bad.output
