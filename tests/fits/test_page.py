"""The whole page of a fit: facts, tables, figures, warnings, files, each as reckoned here."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import bubblefit as bf
import numpy as np
import pytest
from bubblefit.experiments.kinds import Exhibit
from bubblefit.reports import fit_page as page
from bubblefit.reports.charts import Charts
from bubblefit.reports.content import Download, Facts, Report, Table, Words
from bubblefit.reports.fit_page import WORDS, band_words, sigma_words
from bubblefit.reports.html import percent
from bubblefit.runs.record import versions
from bubblefit.runs.result import TITLE, two_digits

from ..projects import ELONGATION, MODULI

ENDS = {"one": 2.9, "two": 2.5}
LOADS = "Load over gauge elongation: measured and modelled"
NOISE_NOTE = (
    " on everything matched; a law or a model of the wrong form is not in it; single "
    "coefficients are far less certain than the moduli they make. Mesh: by how much a modulus "
    "would be another on ever finer meshes, from one run of a finer model at the best fit"
)


class Told:
    """What is drawn and written, without drawing it."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch) -> None:
        self.calls: dict[str, tuple[Any, ...]] = {}
        monkeypatch.setattr(page, "save", lambda path, charts: None)
        for name in ("optima_chart", "moduli_charts", "pinned_charts"):
            monkeypatch.setattr(page, name, self.keep(name, getattr(page, name)))

    def keep(self, name: str, declare: Any) -> Any:
        def kept(*args: Any) -> Any:
            self.calls[name] = args
            return declare(*args)

        return kept


@pytest.fixture
def told(monkeypatch: pytest.MonkeyPatch) -> Told:
    return Told(monkeypatch)


def reported(fit: bf.Fit, folder: Path, monkeypatch: pytest.MonkeyPatch) -> Report:
    seen: list[Report] = []

    def keep(folder: Path, report: Report) -> Path:
        seen.append(report)
        return folder / "report.html"

    monkeypatch.setattr(page, "write_report", keep)
    assert fit.report(folder) == folder / "report.html"
    # The record, which test_provenance.py looks at, comes after everything but the citation.
    (whole,) = seen
    record, cite = whole.sections[-2:]
    assert [part.title for part in record.parts] == ["The record", "The record: data files"]
    assert cite.title == "How to cite"
    own = ("provenance.json", "as-run.toml")
    assert [name for name, _ in whole.files if name in own] == list(own)
    files = [f for f in whole.files if f[0] not in own]
    return replace(whole, sections=whole.sections[:-2], files=files)


def titled(report: Report, title: str) -> Table:
    """The one table of a title."""
    (table,) = [table for table in report.tables if table.title == title]
    return table


def facts(report: Report) -> list[tuple[str, object]]:
    """Of all sections, in order."""
    return [pair for part in report.parts if isinstance(part, Facts) for pair in part.pairs]


def captions(report: Report) -> dict[str, str]:
    """Of all charts, by name."""
    return {part.name: part.caption for part in report.parts if isinstance(part, Charts)}


def said(report: Report) -> list[str]:
    """Every paragraph that is no warning."""
    return [
        words
        for part in report.parts
        if isinstance(part, Words) and not part.warning
        for words in part.lines
    ]


@pytest.fixture(scope="module")
def written(together: bf.Fit, tmp_path_factory: pytest.TempPathFactory) -> tuple[Report, Told]:
    """The page of both tests."""
    with pytest.MonkeyPatch.context() as patch:
        told = Told(patch)
        return reported(together, tmp_path_factory.mktemp("page"), patch), told


@pytest.fixture
def nothing_shown(together: bf.Fit, monkeypatch: pytest.MonkeyPatch) -> None:
    """No picture of a test, which takes longest."""
    monkeypatch.setattr(type(together.setup.tests[0]), "show", lambda *_: Exhibit())


def points(test: str, direction: str) -> tuple[np.ndarray, np.ndarray]:
    """Strain and load (N) of both specimens, as far as the model goes."""
    strain = np.log1p(ELONGATION[ELONGATION <= ENDS[test]] / 20)
    loads = [20 * e * strain for e in MODULI[test][direction]]
    return np.tile(strain, 2), np.concatenate(loads)


def rms(fit: bf.Fit, test: str, direction: str) -> float:
    """N, of a constant modulus in closed form."""
    strain, load = points(test, direction)
    modulus = fit.law.beta[11 if direction == "warp" else 7]
    return float(np.sqrt(np.mean((20 * modulus * strain - load) ** 2)))


def test_two_tests(together: bf.Fit, written: tuple[Report, Told]) -> None:
    fit, result, (found, _) = together, together.result, written
    errors = {(t, d): rms(fit, t, d) for t, own in MODULI.items() for d in own}
    largest = {key: points(*key)[1].max() for key in errors}
    means = [
        0.5 * sum(errors["one", d] / largest["one", d] for d in ("warp", "fill")),
        errors["two", "warp"] / largest["two", "warp"],
    ]
    assert fit.objective == pytest.approx(means[0] + 3 * means[1], rel=2e-3)
    relative = result["mean_relative_error"]
    assert list(relative.values()) == pytest.approx(means, rel=2e-3)
    one, two = (result["tests"][name]["directions"] for name in ("one", "two"))
    shown = {("one", d): one[d]["rms_N"] for d in one} | {("two", "warp"): two["warp"]["rms_N"]}
    assert shown == {key: pytest.approx(error, rel=2e-3) for key, error in errors.items()}

    assert found.title == "made" and [section.title for section in found.sections] == [
        "The answer", "Can it be trusted?", "The moduli over strain", "Measured beside modelled",
        "What the data determine", "How it was found",
    ]  # fmt: skip
    a, b, c = (shown[key] for key in (("one", "warp"), ("one", "fill"), ("two", "warp")))
    assert said(found)[0] == (
        f"Best of 2 starts: objective {fit.objective:.3g}; one: RMS errors in N: warp {a:.3g}, "
        f"fill {b:.3g}, together {a + b:.4g}; two: RMS errors in N: warp {c:.3g}, together {c:.4g}."
    )
    objective_is = "weighted sum of the tests' mean relative RMS errors"
    assert facts(found) == [
        ("Poisson's ratio nu12 (fixed)", 0.0),
        ("thickness", "0.8 mm, constant"),
        ("form of the moduli", "constant"),
        ("matched", "measured points"),
        ("matched", "measured points"),
        (f"objective: {objective_is}", fit.objective),
        ("method", "lm on membrane"),
        ("starts", "2 feasible of 2"),
        ("analyses", sum(r.analyses for r in fit.best.records)),
        ("wall time, s", fit.wall_s),
    ]
    assert titled(found, "Coefficients of the law").rows == [
        ["beta_3", f"{1e-3 * fit.law.beta[3]:.6g}", 0.005, 0.2],
        ["beta_7", f"{1e-3 * fit.law.beta[7]:.6g}", 0.03, 1.0],
        ["beta_11", f"{1e-3 * fit.law.beta[11]:.6g}", 0.02, 2.0],
    ]
    assert fit.law.beta[7] == pytest.approx(190, abs=0.1)  # the middle of two specimens
    reached = np.log(22.9 / 20)
    assert titled(found, "Where they end").rows == [
        ["warp", pytest.approx(0.12), pytest.approx(reached)],
        ["fill", pytest.approx(reached), pytest.approx(reached)],
        ["shear", 1e-6, 1e-6],
    ]
    best_first = sorted(fit.best.records, key=lambda r: r.objective)
    assert titled(found, "Starts, best first").rows == [
        [k, r.number, r.objective, r.analyses, r.status] for k, r in enumerate(best_first, 1)
    ]
    assert found.files == [
        ("result.json", "all numbers of this page, for programs"),
        ("material.toml", "the material card"),
        ("moduli.csv", "tangent moduli along their strains, with their bands"),
        ("coefficients.csv", "every unknown with its standard deviation and its correlations"),
        ("residuals.csv", "every matched value beside the model's"),
        ("notes.csv", "what a reader of the numbers should know, note by note"),
        ("one-loads.csv", "load curves of the best fit"),
        ("one-loads.png", "picture of the load curves"),
        ("two-loads.csv", "load curves of the best fit"),
        ("two-loads.png", "picture of the load curves"),
    ]
    assert found.versions == versions()
    (warned,) = [p for p in found.parts if isinstance(p, Words) and p.warning]
    assert warned.lines == [note.line for note in fit.notes]
    strips = [
        ("failure", "Tangent moduli up to the strains at the end of each strip"),
        ("orders", "Error of load polynomials by order, and with a specimen left out"),
    ]
    ended = [r.objective for r in fit.best.records]
    middle = float(np.median(ended))
    assert captions(found) == {
        "moduli": (
            "Tangent moduli of the best fits over the strains reached, where a dot ends them; with "
            "their bands (95 %, noise and mesh together)"
        ),
        "one loads": LOADS,
        "two loads": LOADS,
        "pinned": (
            "What each test pins down: one standard deviation of the moduli; above 1000 % a "
            "modulus is not determined: triangles"
        ),
        "optima": (
            f"Optimum of every start: {objective_is}, from worst to best. 2 starts: best "
            f"{fit.objective:.3g}, median {middle:.3g}, worst {max(ended):.3g}."
        ),
    }
    assert found.figures == [
        (f"{test}-{name}.png", words) for test in ("one", "two") for name, words in strips
    ]


def test_the_answer_in_words(
    together: bf.Fit, written: tuple[Report, Told], tmp_path: Path
) -> None:
    """At strains that tests reached, with bands, in MPa and per width; the card is inside."""
    fit, (found, _) = together, written
    sure = fit.best.certainty
    assert sure is not None
    table = titled(found, "Moduli")
    assert table.header == [
        "", "unit", "at 0 %", "at 1 %", "at 2 %", "at 5 %", "at 10 %", "known up to"
    ]  # fmt: skip
    assert "In brackets the 95 % band" in table.note and "0.8 mm" in table.note
    warp, per_width, fill, _, shear, _ = table.rows
    own = fit.law.beta[11]
    lower, upper = (float(end[0]) for end in sure.band["E1"])
    assert warp[:3] == [
        WORDS["E1"],
        "MPa",
        f"{own:.0f} ({lower:.0f} to {upper:.0f})".replace(" ", "\u00a0"),
    ]
    assert warp[3:7] == [warp[2]] * 4 and warp[7] == "12 %"
    assert per_width[1:3] == ["kN/m", band_words(0.8 * own, 0.8 * lower, 0.8 * upper)]
    assert fill[6] is not None and fill[7] == "14 %"
    # No test shears: nothing is said beyond rest.
    assert shear[3:7] == [None] * 4
    assert found.summary.startswith("At 0 % strain: Young's modulus along the warp ")
    (card,) = [part for part in found.parts if isinstance(part, Download)]
    inside = tmp_path / card.file
    inside.write_text(card.text)
    assert card.file == "material.toml"
    assert bf.read_card(inside).law.beta == pytest.approx(fit.law.beta)


def test_what_is_determined_in_closed_form(together: bf.Fit, written: tuple[Report, Told]) -> None:
    """One standard deviation of a constant modulus E is noise / sqrt(mean x^2), x the load over E.

    The noise is the misfit or the specimens' scatter about their polynomial, if that is larger. The
    loads of two specimens that differ by a factor count as one.
    """
    fit, (found, told) = together, written
    determined = titled(found, "What the data determine")
    left, pins = (
        titled(found, "Residual beside the noise"),
        titled(found, "What each test pins down"),
    )
    noise = {}
    for prepared in fit.setup.tests:
        for strip in prepared.fitted_strips(fit.tests[prepared.test.name]):
            noise[prepared.part(strip.direction)] = max(strip.rms, strip.strip.scatter)
    loads = {name: len(points(*name.split(": "))[0]) for name in noise}
    noises = ", ".join(
        f"{value:.2g} N ({name}, {loads[name]} neighbouring values err as one)"
        for name, value in noise.items()
    )
    shown = {row[0]: row[1:] for row in left.rows}
    for prepared in fit.setup.tests:
        for strip in prepared.fitted_strips(fit.tests[prepared.test.name]):
            scatter = strip.strip.scatter
            assert shown.pop(prepared.part(strip.direction)) == [
                pytest.approx(strip.rms), scatter, "N", "specimens' scatter",
                pytest.approx(strip.rms / scatter),
            ]  # fmt: skip
    assert not shown and left == Table(
        "Residual beside the noise",
        ["compared", "RMS residual", "noise", "unit", "noise is", "residual over noise"],
        left.rows,
        "Noise: as the project gives it (noise of the test), else the scatter of the specimens, "
        "else what such an instrument is good for. The uncertainty reckons with the larger of "
        "noise and residual.",
        text=(3, 4),
    )
    assert determined.note == f"noise of {noises}{NOISE_NOTE}"
    alone = {}
    for part, value in noise.items():
        test, direction = part.split(": ")
        strain, _ = points(test, direction)
        modulus = fit.law.beta[11 if direction == "warp" else 7]
        alone[part] = value / np.sqrt(np.mean((20 * modulus * strain) ** 2))
    from_one, from_two = alone["one: warp"], alone["two: warp"]
    pinned = fit.result["pinned"]
    for source, name, sigma in (
        ("one", "E1", from_one), ("one", "E2", alone["one: fill"]), ("two", "E1", from_two),
        ("all together", "E2", alone["one: fill"]),
    ):  # fmt: skip
        assert pinned[source][name]["median"] == pytest.approx(sigma, rel=5e-3)
        assert pinned[source][name]["largest"] == pytest.approx(sigma, rel=5e-3)
    e1 = fit.result["uncertainty"]["median_relative_sigma"]["E1"]
    assert min(from_one, from_two) / np.sqrt(2) < e1 < max(from_one, from_two)
    e2 = percent(pinned["one"]["E2"]["median"])
    assert determined == Table(
        "What the data determine",
        ["modulus", "median 1 sigma", "largest 1 sigma", "mesh, largest", "together, largest"],
        # Straight strips are homogeneous.
        [
            ["E1", percent(e1), percent(e1), "0 %", percent(e1)],
            ["E2", e2, e2, "0 %", e2],
            ["G12", "1000 %", "1000 %", "0 %", "1000 %"],
        ],
        determined.note,
    )
    ones, twos = (percent(pinned[name]["E1"]["median"]) for name in ("one", "two"))
    unknown = ["unknown", "unknown"]
    assert pins == Table(
        "What each test pins down",
        ["test", "modulus", "median 1 sigma", "largest 1 sigma"],
        [
            ["one", "E1", ones, ones], ["one", "E2", e2, e2], ["one", "G12", *unknown],
            ["two", "E1", twos, twos], ["two", "E2", *unknown], ["two", "G12", *unknown],
            ["all together", "E1", percent(e1), percent(e1)], ["all together", "E2", e2, e2],
            ["all together", "G12", *unknown],
        ],
        "noise of every test, its misfit or its scatter, whichever is larger, neighbours that err "
        "as one counted as one; before the "
        "tests every modulus is taken to be known to 1000 %",
    )  # fmt: skip
    strains, curves, known, band, _ = told.calls["moduli_charts"]
    assert known is None and len(curves) == 2
    assert strains == pytest.approx(np.linspace(0, fit.best.valid, len(strains[0])).T)
    assert curves[0][0] == pytest.approx(np.full(121, fit.law.beta[11]))
    lower, upper = band
    for k, (place, sigma) in enumerate(((11, e1), (7, pinned["one"]["E2"]["median"]))):
        half = 1.96 * sigma * fit.law.beta[place]
        assert fit.law.beta[place] - lower[k] == pytest.approx(np.full(121, half), rel=0.15)
        assert upper[k] - fit.law.beta[place] == pytest.approx(np.full(121, half), rel=0.15)
    # Of shear nothing is known: 95 % of what lies between its bounds is its band.
    assert lower[2] == pytest.approx(np.full(121, 5.0 + 0.025 * 195.0), rel=0.25)
    assert upper[2] == pytest.approx(np.full(121, 200.0 - 0.025 * 195.0), rel=0.03)
    strains, sigma, _ = told.calls["pinned_charts"]
    assert strains[:, -1] == pytest.approx(fit.best.valid) and strains[:, 0].tolist() == [0, 0, 0]
    assert list(sigma) == ["one", "two", "all together"]
    assert sigma["two"][0] == pytest.approx(np.full(61, 100 * pinned["two"]["E1"]["median"]))


def test_misfit_by_strip(together: bf.Fit, written: tuple[Report, Told]) -> None:
    fit, (found, _) = together, written
    one, _ = [table for table in found.tables if table.title == "Misfit by strip"]
    assert one.header == [
        "strip", "RMS error, N", "scatter of specimens, N", "R² of polynomial", "its RMSE, N",
        "points matched", "load at the end, N",
    ]  # fmt: skip
    assert one.note == (
        "RMS error: root mean square of modelled less measured load; scatter: standard deviation "
        "of the measured loads about the polynomial"
    )
    for row, direction in zip(one.rows, ("warp", "fill"), strict=True):
        # A polynomial of order four is as good as the logarithm: the scatter is half the
        # specimens' difference at every strain, also beyond the final length.
        strain = np.tile(np.log1p(ELONGATION / 20), 2)
        load = 20 * np.repeat(MODULI["one"][direction], len(ELONGATION)) * strain
        modulus = fit.law.beta[11 if direction == "warp" else 7]
        off = 10 * abs(np.subtract(*MODULI["one"][direction])) * strain
        rmse = float(np.sqrt(np.mean(off**2)))
        assert row == [
            direction,
            pytest.approx(rms(fit, "one", direction), rel=2e-3),
            pytest.approx(rmse * np.sqrt(len(off) / (len(off) - 1)), rel=1e-3),
            pytest.approx(1 - (off**2).sum() / ((load - load.mean()) ** 2).sum(), rel=1e-5),
            pytest.approx(rmse, rel=1e-4),
            22,
            pytest.approx(20 * modulus * np.log(22.9 / 20), rel=1e-5),
        ]


@pytest.mark.usefixtures("nothing_shown")
def test_starts_that_failed_other_programs_and_no_certainty(
    together: bf.Fit, told: Told, tmp_path: Path, monkeypatch
) -> None:
    """Nothing is said of what is not known."""
    one, two = together.best.records
    lost = replace(two, objective=None, external_runs=4, cached_runs=3, failure="no licence")
    best = replace(together.best, records=[one, lost], ranked=[one], certainty=None)
    fit = replace(together, best=best)
    found = reported(fit, tmp_path, monkeypatch)
    pairs = dict(facts(found))
    assert pairs["starts"] == "1 feasible of 2" and pairs["of them by membrane"] == 4
    assert pairs["of them from the cache"] == 3
    values, _ = told.calls["optima_chart"]
    assert values == pytest.approx([one.objective, np.nan], nan_ok=True)
    assert np.isnan(fit.starts()["objective"][1]) and fit.starts()["seconds"][0] == one.wall_s
    assert [table.title for table in found.tables] == [
        "Moduli", "Where they end", "Residual beside the noise", "Starts, best first",
        "Coefficients of the law",
    ]  # fmt: skip
    answer = titled(found, "Moduli")
    assert answer.rows[0][2] == f"{fit.law.beta[11]:.3g}" and "brackets" not in answer.note
    assert told.calls["moduli_charts"][3] is None
    assert captions(found)["moduli"].endswith("over the strains reached")
    assert "pinned_charts" not in told.calls and "uncertainty" not in fit.result
    assert fit.moduli()["sigma_relative"].isna().all()
    assert fit.coefficients()["sigma"].isna().all()
    assert fit.moduli().index.tolist() == list(range(3 * 61))
    assert fit.residuals().index.tolist() == list(range(len(fit.residuals())))


def test_one_test_alone(alone: bf.Fit, told: Told, tmp_path: Path, monkeypatch) -> None:
    """Its own objective whatever its weight, and its name before nothing."""
    found = reported(alone, tmp_path, monkeypatch)
    error = rms(alone, "two", "warp")
    assert alone.objective == pytest.approx(error, rel=2e-3)
    assert said(found)[0] == (
        f"Best of 1 starts: objective {alone.objective:.3g}; RMS errors in N: warp "
        f"{alone.objective:.3g}, together {alone.objective:.4g}."
    )
    told_facts = facts(found)
    assert ("objective: sum of the strips' RMS errors, N", alone.objective) in told_facts
    assert ("matched", "measured points") in told_facts
    assert [name for name, _ in found.figures] == ["failure.png", "orders.png"]
    assert list(captions(found)) == ["moduli", "two loads", "optima"]
    assert found.files[-2] == ("loads.csv", "load curves of the best fit")
    assert [t.title for t in found.tables] == [
        "Moduli", "Where they end", "Residual beside the noise", "Misfit by strip",
        "What the data determine", "Starts, best first", "Coefficients of the law", TITLE,
    ]  # fmt: skip
    source = f"objective {alone.objective:.4g}, RMS errors in N: warp {alone.objective:.4g}"
    assert alone.card.source == f"bubblefit {bf.__version__} strips, project.toml, {source}"


@pytest.mark.usefixtures("nothing_shown")
def test_a_known_solution_with_the_band_of_noise(
    together: bf.Fit, told: Told, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The charts show the deviation from it, and what noise would do."""
    monkeypatch.setattr(type(together.setup.tests[0]), "known", together.law)
    found = reported(together, tmp_path, monkeypatch)
    _, curves, known, band, _ = told.calls["moduli_charts"]
    np.testing.assert_array_equal(known, curves[0])
    assert band is not None
    assert captions(found)["moduli"].endswith(
        "over the strains reached; with their bands (95 %, noise and mesh together)"
    )
    (charts,) = (part for part in found.parts if getattr(part, "name", "") == "moduli")
    assert len(charts.charts) == 6  # the moduli, and their deviations from the known ones
    for name, chart in zip(("E1", "E2", "G12"), charts.charts, strict=False):
        best = chart.series[0]
        ends = together.best.certainty.band[name]
        assert (best.lower[0], best.upper[0]) == pytest.approx(ends[:, 0], rel=1e-5)
        assert (best.lower[-1], best.upper[-1]) == pytest.approx(ends[:, -1], rel=1e-5)
        assert "known" in [series.name for series in chart.series]


def test_the_band_is_about_the_best_fit(together: bf.Fit, told: Told, tmp_path: Path) -> None:
    """Whatever the other fits that are drawn with it."""
    one, two = together.best.ranked
    unknowns = tuple(1.5 * u for u in one.unknowns)
    best = replace(together.best, ranked=[one, replace(two, unknowns=unknowns)])
    fit = replace(together, best=best)
    page._moduli(fit, tmp_path)
    _, curves, _, band, _ = told.calls["moduli_charts"]
    assert curves[1][0] == pytest.approx(1.5 * curves[0][0])
    own = fit.best.certainty.band["E1"]
    assert band[:, 0] == pytest.approx(np.tile(own[:, :1], 121))
    # Of many, those of the five best.
    many = replace(fit, best=replace(best, ranked=[one, *[two] * 7]))
    assert len(many.laws) == 5


def test_a_modulus_known_no_better_than_before_is_unknown() -> None:
    """Before the tests each is known to 1000 %, less a thousandth for rounding."""
    said = [sigma_words(value) for value in (0.012, 1.0, 9.98, 9.99, 10.0)]
    assert said == ["1.2 %", "100 %", "998 %", "unknown", "unknown"]


def test_every_unknown_with_its_sigma_and_correlations(
    together: bf.Fit, written: tuple[Report, Told]
) -> None:
    """In the project's unit, GPa; in the file and on the page alike."""
    fit, (found, _) = together, written
    table = fit.coefficients()
    assert table["unknown"].tolist() == ["beta_3", "beta_7", "beta_11"]
    assert table["unit"].tolist() == ["GPa"] * 3
    assert table["value"].to_numpy() == pytest.approx(1e-3 * fit.law.beta[[3, 7, 11]])
    assert table["lower_bound"].tolist() == [0.005, 0.03, 0.02]
    assert table["upper_bound"].tolist() == [0.2, 1.0, 2.0]
    sure = fit.best.certainty
    assert sure is not None and sure.posterior is not None
    # A modulus that is one coefficient is as sure as that.
    for place, name in enumerate(("G12", "E2", "E1")):
        relative = table["sigma"][place] / table["value"][place]
        assert relative == pytest.approx(sure.sigma[name][0])
    assert table[["beta_3", "beta_7", "beta_11"]].to_numpy() == pytest.approx(
        sure.posterior.correlations
    )
    (shown,) = [t for t in found.tables if t.title == TITLE]
    assert shown.header == ["unknown", "value", "1 sigma", "unit", "beta_3", "beta_7", "beta_11"]
    warp = shown.rows[2]
    assert warp[:4] == ["beta_11", table["value"][2], table["sigma"][2], "GPa"]
    assert warp[4:] == ["0.00", "0.00", "1.00"] == [two_digits(value) for value in (-1e-9, 0, 1)]
