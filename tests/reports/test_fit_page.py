"""The page of a fit: facts, tables, figures, warnings and files, each as reckoned here."""

from dataclasses import replace
from types import SimpleNamespace

import bubblefit as bf
import numpy as np
import pytest
from bubblefit.inference.reported import BOUND_WORDS, UNKNOWN
from bubblefit.materials.forms.base import form_named
from bubblefit.materials.forms.symmetry import symmetric
from bubblefit.reports import fit_page
from bubblefit.reports import fit_page as page
from bubblefit.reports.charts import Charts, charts_of_labelled_moduli, moduli_charts, pinned_charts
from bubblefit.reports.content import Download, Exhibit, Facts, Picture, Words
from bubblefit.reports.fit_page import MODULUS_TITLES, band_words
from bubblefit.reports.html import percent
from bubblefit.reports.kinds.strips import StripsPresenter
from bubblefit.reports.vega import panel
from bubblefit.runs.fit_folder import HISTORY
from bubblefit.runs.folder import versions
from bubblefit.runs.verdict import answers

from ..builders.projects import STRIP_ELONGATION, STRIP_MODULI
from ..support.charts import check_charts, data


@pytest.mark.parametrize(
    ("values", "said"),
    [([0.0, 1e-9, 3.2], "3 starts: best 1e-16, median 1e-09, worst 3.2"),
     ([np.nan, 1.0, np.inf, 2.0], "4 starts, 2 without a result: best 1, median 1.5, worst 2"),
     ([np.nan], "1 start, 1 without a result"), ([3], "1 start: best 3, median 3, worst 3")],
)  # fmt: skip
def test_optima_are_drawn_by_start(values, said):
    ended = sorted((v for v in values if np.isfinite(v)), reverse=True)
    charts = fit_page.optima_chart(values, "Words")
    check_charts(charts)
    (chart,) = charts.charts
    (optima,) = data(chart)
    # A number of a start is whole, and so are the ticks.
    if len(ended) > 1:
        assert panel(chart, 400)["axes"][0]["tickMinStep"] == 1
    np.testing.assert_array_equal(optima[0], np.arange(1, len(ended) + 1))
    np.testing.assert_allclose(optima[1], np.maximum(ended, 1e-16))
    assert chart.log_y == (len(ended) > 0 and max(optima[1]) > 10 * min(optima[1]))
    assert chart.alt == said and said in charts.caption
    assert (chart.x_label, chart.y_label) == ("start, from worst to best", "objective")


ENDS = {"one": 2.9, "two": 2.5}


def drawn_by(monkeypatch):
    calls = {}
    monkeypatch.setattr(page, "save", lambda path, charts: None)
    for name in ("optima_chart", "moduli_charts", "pinned_charts"):
        declare = getattr(page, name)
        monkeypatch.setattr(
            page, name, lambda *a, n=name, d=declare: calls.__setitem__(n, a) or d(*a)
        )
    return calls


@pytest.fixture
def told(monkeypatch):
    return drawn_by(monkeypatch)


def reported(fit, folder, monkeypatch):
    seen = []
    monkeypatch.setattr(
        page, "write_report", lambda folder, report: seen.append(report) or folder / "report.html"
    )
    assert fit.report(folder) == folder / "report.html"
    # The record, which test_provenance.py looks at, comes after everything but the citation.
    (whole,) = seen
    record, cite = whole.sections[-2:]
    assert [part.title for part in record.parts] == ["The record", "The record: data files"]
    of_standards = [s.title for s in whole.sections for t in s.parts if "EN ISO 1421" in str(t)]
    assert of_standards == ["Reports by standards"] * len(of_standards)
    assert cite.title == "How to cite"
    own = ("provenance.json", "as-run.toml")
    assert [name for name, _ in whole.files if name in own] == list(own)
    files = [f for f in whole.files if f[0] not in own]
    return replace(whole, sections=whole.sections[:-2], files=files)


def titled(report, title):
    (table,) = [p for p in report.parts if p.part == "table" and p.title == title]
    return table


def facts(report):
    return [pair for part in report.parts if isinstance(part, Facts) for pair in part.pairs]


def captions(report):
    return {part.name: part.caption for part in report.parts if isinstance(part, Charts)}


@pytest.fixture(scope="module")
def written(strips_fit, tmp_path_factory):
    with pytest.MonkeyPatch.context() as patch:
        told = drawn_by(patch)
        return reported(strips_fit, tmp_path_factory.mktemp("page"), patch), told


@pytest.fixture
def nothing_shown(strips_fit, monkeypatch):
    monkeypatch.setattr(StripsPresenter, "show", lambda *_: Exhibit())


def points(test, direction):
    strain = np.log1p(STRIP_ELONGATION[STRIP_ELONGATION <= ENDS[test]] / 20)
    loads = [20 * e * strain for e in STRIP_MODULI[test][direction]]
    return np.tile(strain, 2), np.concatenate(loads)


def rms(fit, test, direction):
    strain, load = points(test, direction)
    modulus = fit.law.beta[11 if direction == "warp" else 7]
    return float(np.sqrt(np.mean((20 * modulus * strain - load) ** 2)))


def test_page_of_two_tests_shows_facts_tables_and_figures(strips_fit, written):
    fit, result, (found, _) = strips_fit, strips_fit.result, written
    errors = {(t, d): rms(fit, t, d) for t, own in STRIP_MODULI.items() for d in own}
    largest = {key: points(*key)[1].max() for key in errors}
    means = [
        0.5 * sum(errors["one", d] / largest["one", d] for d in ("warp", "fill")),
        errors["two", "warp"] / largest["two", "warp"],
    ]
    assert fit.objective == pytest.approx(means[0] + 3 * means[1], rel=2e-3)
    assert list(result["mean_relative_error"].values()) == pytest.approx(means, rel=2e-3)
    for (test, direction), error in errors.items():
        own = result["tests"][test]["directions"][direction]
        assert own["rms_N"] == pytest.approx(error, rel=2e-3)
    shown = dict(facts(found))
    assert shown["Poisson's ratio nu12 (fixed)"] == 0.0
    assert fit.objective in shown.values() and shown["wall time, s"] == fit.wall_s
    assert shown["starts"] == "2 feasible of 2"
    assert shown["analyses"] == sum(r.analyses for r in fit.best.records)
    assert titled(found, "Coefficients of the law").rows == [
        ["beta_3", f"{1e-3 * fit.law.beta[3]:.6g}", 0.005, 0.2],
        ["beta_7", f"{1e-3 * fit.law.beta[7]:.6g}", 0.03, 1.0],
        ["beta_11", f"{1e-3 * fit.law.beta[11]:.6g}", 0.02, 2.0],
    ]
    assert fit.law.beta[7] == pytest.approx(190, abs=0.1)  # the middle of two specimens
    reached = np.log(22.9 / 20)
    assert titled(found, "Where they end").rows == [
        ["warp", pytest.approx(12.0), pytest.approx(100 * reached)],
        ["fill", pytest.approx(100 * reached), pytest.approx(100 * reached)],
        ["shear", pytest.approx(1e-4), pytest.approx(1e-4)],
    ]  # fmt: skip
    best_first = sorted(fit.best.records, key=lambda r: r.objective)
    assert titled(found, "Starts, best first").rows == [
        [k, r.number, r.objective, r.analyses, r.status] for k, r in enumerate(best_first, 1)
    ]
    assert [name for name, _ in found.files] == [
        "result.json", "material.toml", "moduli.csv", "coefficients.csv", "residuals.csv",
        "notes.csv", "one-loads.csv", "one-loads.png", "one-en-iso-1421.csv", "two-loads.csv",
        "two-loads.png", "two-en-iso-1421.csv",
    ]  # fmt: skip
    assert found.versions == versions()
    (warned,) = [p for p in found.parts if isinstance(p, Words) and p.warning]
    weights = [note.kind.weight for note in fit.notes]
    assert sorted(warned.lines) == sorted(note.line for note in fit.notes)
    assert warned.lines[0] == fit.notes[int(np.argmax(weights))].line
    ended, texts = [r.objective for r in fit.best.records], captions(found)
    names = ["moduli", "one loads", "two loads", "sensitivity", "pinned", "optima"]
    assert list(texts) == names
    for value in (fit.objective, float(np.median(ended)), max(ended)):
        assert f"{value:.3g}" in texts["optima"]


def test_answer_table_gives_moduli_with_bands_in_words(strips_fit, written, tmp_path):
    fit, (found, _) = strips_fit, written
    warp, fill, shear = (titled(found, MODULUS_TITLES[name]).rows for name in ("E1", "E2", "G12"))
    own, (lower, upper) = fit.law.beta[11], fit.best.certainty.moduli["E1"].band[:, 0]
    words = f"{own:.0f} ({lower:.0f} to {upper:.0f})".replace(" ", "\u00a0")
    per_width = band_words(answers(fit.best, 0.8)[0], 0.8)
    strains = ["0 %", "1 %", "2 %", "5 %", "10 %", "12 %, its end"]
    assert warp == [[strain, words, per_width] for strain in strains]
    assert fill[-1][0] == "14 %, its end" and len(fill) == 6
    # No test shears: nothing is said beyond rest.
    assert [row[0] for row in shear] == ["0 %"]
    assert shear[0][1].endswith("* to 195*)".replace(" ", "\u00a0"))
    notes = [line for p in found.sections[0].parts if isinstance(p, Words) for line in p.lines]
    assert BOUND_WORDS in notes[0]
    assert [section.title for section in found.sections][:2] == ["The answer", "Can it be trusted?"]
    assert isinstance(found.sections[1].parts[0], Words) and found.sections[1].parts[0].warning
    assert [label for label, _ in found.about] == ["date", "fabric", "laboratory"]
    assert found.about[0][1] == fit.record.runs[-1]["date"][:10] and found.about[2][1] == "L 7"
    (card,) = [part for part in found.parts if isinstance(part, Download)]
    inside = tmp_path / card.file
    inside.write_text(card.text)
    assert card.file == "material.toml"
    assert bf.read_card(inside).law.beta == pytest.approx(fit.law.beta)


def test_sigma_of_page_is_the_closed_form_of_each_test(strips_fit, written):
    """One standard deviation of a modulus E is noise / sqrt(mean x^2), with x the load over E."""
    fit, (found, told) = strips_fit, written
    shown = {row[0]: row[1:] for row in titled(found, "Residual beside the noise").rows}
    noise, alone = {}, {}
    for prepared in fit.setup.tests:
        for strip in prepared.fitted_parts(fit.tests[prepared.test.name]):
            scatter, part = strip.data.scatter, prepared.part(strip.data.direction)
            noise[part] = max(strip.rms, scatter)
            rms, of, unit, _, times = shown.pop(part)
            assert (of, unit) == (scatter, "N") and times == pytest.approx(strip.rms / scatter)
            assert rms == pytest.approx(strip.rms)
    assert not shown
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
    # Straight strips are homogeneous.
    assert titled(found, "What the data determine").rows == [
        ["E1", *[percent(e1)] * 3, "0 %"], ["E2", e2, e2, e2, "0 %"],
        ["G12", *[UNKNOWN] * 3, "0 %"],
    ]  # fmt: skip
    twos, pins = percent(pinned["two"]["E1"]["median"]), titled(found, "What each test pins down")
    assert pins.rows[3:5] == [["two", "E1", twos, twos], ["two", "E2", UNKNOWN, UNKNOWN]]
    strains, curves, known, band, _ = told["moduli_charts"]
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
    strains, sigma, _ = told["pinned_charts"]
    assert strains[:, -1] == pytest.approx(fit.best.valid) and strains[:, 0].tolist() == [0, 0, 0]
    assert list(sigma) == ["one", "two", "all together"]
    assert sigma["two"][0] == pytest.approx(np.full(61, 100 * pinned["two"]["E1"]["median"]))


def test_quantity_that_alone_feels_a_modulus_decides_it(strips_fit):
    """A strip feels the modulus along it, and no other; all together are the reported sigma."""
    charts, table = fit_page.sensitivity_parts(strips_fit)
    check_charts(charts)
    rows = {row[0]: row[1:] for row in table.rows}
    quantities = ["one: warp", "one: fill", "two: warp", "all together"]
    assert list(rows) == quantities and charts.name == "sensitivity"
    reported = strips_fit.best.certainty.moduli
    least = {name: percent(modulus.sigma.min()) for name, modulus in reported.items()}
    assert rows["all together"] == [least["E1"], least["E2"], UNKNOWN]
    assert rows["one: fill"] == [UNKNOWN, least["E2"], UNKNOWN]
    # Two strips of the warp, of which each leaves more than both.
    sensitivity = strips_fit.sensitivity
    alone = [sensitivity[name]["E1"] for name in ("one: warp", "two: warp")]
    together = 1 / np.sqrt(1 / alone[0] ** 2 + 1 / alone[1] ** 2)
    assert together == pytest.approx(reported["E1"].sigma, rel=1e-3)
    assert table.header == ["quantity", "E1", "E2", "G12"] and "reported 1 sigma" in table.note
    curves = {series.name: series.y for series in charts.charts[0].series if series.y}
    assert list(curves)[:4] == quantities
    assert curves["all together"] == pytest.approx(100 * reported["E1"].sigma, rel=1e-4)
    unknown = replace(strips_fit, best=replace(strips_fit.best, certainty=None))
    assert fit_page.sensitivity_parts(unknown) == []


def test_sharpest_sigma_has_its_strain_in_percent():
    strain = np.array([0.0, 0.05, 0.12])
    assert fit_page._sharpest(strain, np.array([0.4, 0.04, 0.3])) == "4 % at 5 % strain"
    assert fit_page._sharpest(strain, np.array([3.0, 1.5, 2.0])) == UNKNOWN
    assert fit_page._sharpest(strain, np.full(3, 0.04)) == "4 %"


def test_convergence_shows_the_best_start_mesh_by_mesh(strips_fit, tmp_path):
    assert fit_page.convergence(strips_fit, tmp_path) == []
    best = strips_fit.best.ranked[0].number
    rows = [
        (best, "coarse", 40.0), (99, "coarse", 7.0), (best, "coarse", 4.0), (best, "full", 0.0),
    ]  # fmt: skip
    lines = ["start,mesh,objective", *(f"{s},{m},{o}" for s, m, o in rows)]
    (tmp_path / HISTORY).write_text("\n".join(lines) + "\n")
    (charts,) = fit_page.convergence(strips_fit, tmp_path)
    check_charts(charts)
    (chart,) = charts.charts
    assert [series.name for series in chart.series] == ["coarse mesh", "full mesh"]
    coarse, full = data(chart)
    np.testing.assert_allclose(coarse, [[1, 2], [40.0, 4.0]])
    np.testing.assert_allclose(full, [[3], [1e-16]])
    assert chart.log_y and charts.caption.startswith("The best start: weighted sum of")


@pytest.mark.usefixtures("nothing_shown")
def test_failed_starts_and_missing_certainty_leave_gaps(strips_fit, told, tmp_path, monkeypatch):
    one, two = strips_fit.best.records
    lost = replace(two, objective=None, external_runs=4, cached_runs=3, failure="no licence")
    best = replace(strips_fit.best, records=[one, lost], ranked=[one], certainty=None)
    fit = replace(strips_fit, best=best)
    found = reported(fit, tmp_path, monkeypatch)
    pairs = dict(facts(found))
    assert pairs["starts"] == "1 feasible of 2" and pairs["of them by membrane"] == 4
    assert pairs["of them from the cache"] == 3
    assert told["optima_chart"][0] == pytest.approx([one.objective, np.nan], nan_ok=True)
    assert np.isnan(fit.starts()["objective"][1]) and fit.starts()["seconds"][0] == one.wall_s
    assert titled(found, MODULUS_TITLES["E1"]).rows[0][1] == f"{fit.law.beta[11]:.3g}"
    assert not any(
        "brackets" in line for p in found.parts if isinstance(p, Words) for line in p.lines
    )
    assert told["moduli_charts"][3] is None
    assert "pinned_charts" not in told and "uncertainty" not in fit.result
    assert fit.moduli()["sigma_relative"].isna().all()
    assert fit.coefficients()["sigma"].isna().all()
    for table, count in ((fit.moduli(), 3 * 61), (fit.residuals(), len(strips_fit.residuals()))):
        assert table.index.tolist() == list(range(count))


def test_page_of_one_test_shows_its_rms_error(one_strip_fit, told, tmp_path, monkeypatch):
    found = reported(one_strip_fit, tmp_path, monkeypatch)
    assert one_strip_fit.objective == pytest.approx(rms(one_strip_fit, "two", "warp"), rel=2e-3)
    assert ("objective: sum of the strips' RMS errors, N", one_strip_fit.objective) in facts(found)
    files = [part.file for part in found.parts if isinstance(part, Picture)]
    assert files == ["failure.png", "orders.png"]
    assert list(captions(found)) == ["moduli", "two loads", "sensitivity", "optima"]
    assert f"objective {one_strip_fit.objective:.4g}, RMS errors in N" in one_strip_fit.card.source
    assert one_strip_fit.result["directions"] == one_strip_fit.result["tests"]["two"]["directions"]
    assert one_strip_fit.result["e_uniaxial_N"] == pytest.approx(one_strip_fit.objective)
    assert (
        "weights" not in one_strip_fit.result and "mean_relative_error" not in one_strip_fit.result
    )


def test_errors_of_moduli_are_told_with_their_range_of_strain():
    result = {
        "moduli_error": {"E1": 0.0123, "G12": 0.2},
        "moduli_error_range": {"E1": [0.0, 0.05], "G12": [0.001, 0.1]},
    }
    (table,) = page._error_tables(SimpleNamespace(result=result))
    assert table.header[2:] == ["from strain, %", "to strain, %"]
    assert table.rows == [
        ["E1", "1.2 %", 0.0, pytest.approx(5.0)],
        ["G12", "20 %", pytest.approx(0.1), pytest.approx(10.0)],
    ]
    assert page._error_tables(SimpleNamespace(result={})) == []


def test_charts_of_an_isotropic_law_show_one_modulus():
    form = symmetric(form_named("constant", {}, [0.1] * 3), "isotropic", 0.3)
    strains = np.linspace(0.0, [0.1] * 3, 5).T
    moduli = moduli_charts(strains, np.full((1, 3, 5), 200.0))
    sigma = pinned_charts(strains, {"bubble": np.full((3, 5), 2.0)}, "Words")
    for charts in (moduli, sigma):
        (chart,) = charts_of_labelled_moduli(charts, form).charts
        assert chart.title == "E" and "E1" not in chart.alt
    balanced = symmetric(form_named("constant", {}, [0.1] * 3), "balanced", 0.3)
    titles = [chart.title for chart in charts_of_labelled_moduli(moduli, balanced).charts]
    assert titles == ["E1 = E2", "G12, in shear"]
