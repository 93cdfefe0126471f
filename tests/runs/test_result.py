"""The result of a fit: moduli, card, tables, laws drawn within the band, drawings, exports."""

from dataclasses import replace
from types import SimpleNamespace

import bubblefit as bf
import numpy as np
import pandas as pd
import pytest
from bubblefit.errors import InputError, OutputError
from bubblefit.materials.card import write_card
from bubblefit.materials.forms.base import COMPONENTS
from bubblefit.processes import may_run_at_once
from bubblefit.reports.presenter import page_presenter_of
from bubblefit.runs.result import COMPARED, TOGETHER, notes_of_pinned
from bubblefit.runs.verdict import answers
from bubblefit.version import __version__

from ..support.commands import in_process, result_in
from ..support.paths import ROOT
from ..support.refusals import raised


def test_table_of_moduli_has_values_and_bands_up_to_valid_strain(fitted):
    moduli = fitted.moduli()
    sigma = ["sigma_relative", "noise_relative", "mesh_relative"]
    band = ["lower_MPa", "upper_MPa"]
    flags = ["at_lower_bound", "at_upper_bound", "determined"]
    assert list(moduli.columns) == ["modulus", "strain", "MPa", *band, *sigma, *flags]
    sure = fitted.best.certainty
    for name, reported in sure.moduli.items():
        own = moduli[moduli["modulus"] == name]
        for column, end in zip(band, reported.band, strict=True):
            expected = np.interp(own["strain"], sure.strain[name], end)
            assert own[column].to_numpy() == pytest.approx(expected)
    e1 = moduli[moduli["modulus"] == "E1"]
    assert e1["strain"].max() == pytest.approx(fitted.best.valid[0])
    assert e1["MPa"].to_numpy() == pytest.approx(fitted.law.E1(e1["strain"]))


def test_table_of_a_notebook_has_strains_in_percent(fitted):
    page = fitted._repr_html_()
    for answer in answers(fitted.best, fitted.thickness):
        cells = (f"{100 * answer.strain:.3g} %", f"{answer.value:.4g}", f"{answer.per_width:.4g}")
        assert all(f">{cell}<" in page for cell in cells), answer


def test_bands_reach_from_rest_to_the_valid_strain(fitted):
    end = float(fitted.best.valid[0])
    bands = fitted.bands([-1e-6, 0.0, end, 1.001 * end]).query("modulus == 'E1'")
    is_known = bands[["lower_MPa", "upper_MPa"]].notna().to_numpy()
    assert is_known.tolist() == [[False] * 2, [True] * 2, [True] * 2, [False] * 2]


def test_residuals_are_modelled_minus_measured(fitted):
    residuals = fitted.residuals()
    assert set(residuals["quantity"]) == {"dx", "dy", "dz"}
    off = residuals["modelled"] - residuals["measured"]
    assert residuals["difference"].to_numpy() == pytest.approx(off.to_numpy())
    assert residuals["difference"].abs().max() < 1e-4


def test_folder_has_tables_card_and_valid_strain_of_fit(fitted, bubble):
    for name, table in (("residuals", fitted.residuals()), ("moduli", fitted.moduli())):
        assert len(pd.read_csv(bubble.out / f"{name}.csv")) == len(table)
    card = bf.read_card(bubble.out / "material.toml")
    assert card.law.beta == pytest.approx(fitted.law.beta)
    assert card.law.strain_range == pytest.approx(fitted.best.valid)
    said = result_in(bubble.out)["valid_strain"]["warp"]
    assert said == pytest.approx(card.law.strain_range[0])


def test_listed_uncertainty_is_one_standard_deviation(fitted):
    sure, moduli = fitted.best.certainty, fitted.moduli()
    for name, sigma in sure.sigma.items():
        own = moduli[moduli["modulus"] == name]
        assert own["sigma_relative"].to_numpy() == pytest.approx(sigma)
        said = fitted.result["uncertainty"]
        assert said["largest_relative_sigma"][name] == pytest.approx(float(sigma.max()))
        assert said["median_relative_sigma"][name] == pytest.approx(float(np.median(sigma)))


def test_card_is_valid_up_to_strains_reached(fitted):
    (history,) = fitted.best.point.histories
    reached = np.maximum(history.strain_max, np.abs(history.strain_min) * [0, 0, 1])
    assert (reached < 0.95 * fitted.law.strain_range).any()
    assert fitted.best.reached == pytest.approx(reached)
    expected = np.minimum(reached, fitted.law.strain_range)
    assert fitted.card.law.strain_range == pytest.approx(expected)
    assert list(fitted.result["valid_strain"].values()) == pytest.approx(expected.tolist())


def test_card_says_by_which_fit_it_was_made(fitted, strips_fit):
    for fit, kind in ((fitted, "bubble"), (strips_fit, "strips")):
        qualities = {name: findings.quality for name, findings in fit.findings.items()}
        words = ", ".join(f"{name}: {quality}" for name, quality in qualities.items())
        if kind == "bubble":
            (words,) = qualities.values()
        taken_out = ", error of the mesh taken out" * bool(fit.best.certainty.taken_out)
        assert fit.card.source == (
            f"bubblefit {__version__} {kind}, {fit.project.path.name}, "
            f"objective {fit.objective:.4g}, {words}{taken_out}"
        )
    both = SimpleNamespace(
        setup=SimpleNamespace(tests=[*fitted.setup.tests, *strips_fit.setup.tests])
    )
    assert type(fitted).command.fget(both) == "fit"


def test_all_tests_and_quantities_together_have_the_sigma_of_the_fit(fitted, strips_fit):
    assert fitted.pinned == {}
    assert list(strips_fit.pinned) == ["one", "two", TOGETHER]
    for fit in (fitted, strips_fit):
        together = fit.sensitivity[TOGETHER]
        for name, modulus in fit.best.certainty.moduli.items():
            expected = np.where(modulus.determined, modulus.sigma, np.inf)
            np.testing.assert_allclose(together[name], expected)
        for alone in fit.sensitivity.values():
            assert all((alone[name] >= (1 - 1e-9) * together[name]).all() for name in together)


def test_tests_looked_at_side_by_side_pin_the_same_moduli(strips_fit):
    with may_run_at_once(2):
        pinned = type(strips_fit).pinned.func(strips_fit)
    assert list(pinned) == list(strips_fit.pinned)
    for source, moduli in pinned.items():
        for name, modulus in moduli.items():
            np.testing.assert_array_equal(modulus.upper, strips_fit.pinned[source][name].upper)
            np.testing.assert_array_equal(modulus.sigma, strips_fit.pinned[source][name].sigma)


def test_modulus_that_a_test_alone_determines_nowhere_is_noted():
    open_, known = (SimpleNamespace(numbers={"not_determined": share}) for share in (1.0, 0.9))
    pinned = {
        "a": {"E1": known, "G12": open_},
        "two": {"E1": open_, "G12": known},
        TOGETHER: {"E1": known, "G12": open_},
    }
    assert [str(note) for note in notes_of_pinned(SimpleNamespace(pinned=pinned))] == [
        "a alone does not determine G12 at any strain",
        "two alone does not determine E1 at any strain",
    ]


@pytest.mark.parametrize("table", ["residuals", "moduli", "coefficients", "starts"])
def test_every_table_is_written_and_read_back(strips_fit, tmp_path, table):
    path = strips_fit.write_table(tmp_path / "new folder" / f"{table}.csv", table)
    own, read = getattr(strips_fit, table)(), pd.read_csv(path)
    pd.testing.assert_frame_equal(read, own, check_dtype=False, rtol=1e-8)
    if table == "residuals":
        unless_asked_otherwise = strips_fit.write_table(tmp_path / "fit.csv")
        assert unless_asked_otherwise.read_text() == path.read_text()
        assert list(read.columns)[-5:] == list(COMPARED)
        assert set(read["test"]) == {"one", "two"} and set(read["unit"]) == {"N"}
        assert (read["modelled"] - read["measured"] - read["difference"]).abs().max() < 1e-5
    if table in ("moduli", "residuals"):
        text = (ROOT / "docs/reference/files.md").read_text()
        assert [name for name in own if f"`{name}`" not in text] == []


def test_drawn_laws_agree_with_band(strips_fit):
    laws = strips_fit.draw_laws(1500, seed=1)
    first, again, other = (strips_fit.draw_laws(3, seed=s)[0].beta for s in (1, 1, 2))
    np.testing.assert_array_equal(first, again)
    assert np.abs(first - other).max() > 0 and len(laws) == 1500
    for name, own in strips_fit.bands().groupby("modulus"):
        row = own.iloc[len(own) // 2]
        moduli = np.array([float(law.modulus(name, row["strain"])) for law in laws])
        inside = np.mean((moduli >= row["lower_MPa"]) & (moduli <= row["upper_MPa"]))
        assert inside == pytest.approx(0.95, abs=0.02), name
        ends = np.quantile(moduli, [0.025, 0.975])
        wide = row["upper_MPa"] - row["lower_MPa"]
        assert np.abs(ends - row[["lower_MPa", "upper_MPa"]].to_numpy(float)).max() < 0.1 * wide
    unknown = replace(strips_fit, best=replace(strips_fit.best, certainty=None))
    raised(InputError, "draw_laws", unknown.draw_laws)


def test_fit_gives_its_analyses_by_comparison(strips_fit, bubble):
    found = strips_fit.history()
    assert list(found) == [c.name for c in strips_fit.problem.comparisons]
    one = found["one: warp"]
    np.testing.assert_array_equal(one.load, strips_fit.best.point.histories[0].load)
    area = 25.0 * strips_fit.thickness * np.exp(one.strain()[:, 0, 1])
    np.testing.assert_allclose(one.stress()[:, 0, 0] * area, one.load, rtol=1e-8)
    assert bubble.fit.history()["bubble"].stress()[-1].min(axis=0)[:2].min() > 0


DRAWN = ("moduli", "starts", "residuals", "heights", "history")


@pytest.mark.parametrize("what", DRAWN)
def test_drawings_are_those_of_page(bubble, tmp_path, what):
    drawing = getattr(bubble.fit, f"plot_{what}")()
    bundle = drawing._repr_mimebundle_()
    assert bundle["application/vnd.vega.v6+json"] == drawing.spec
    assert drawing.spec["$schema"].endswith("v6.json") and bundle["image/svg+xml"].startswith(
        "<svg"
    )
    assert drawing.save(tmp_path / "one.svg").read_text().startswith("<svg")
    of_page = [charts.charts for charts in bubble.drawn]
    if what in ("moduli", "starts", "heights"):
        assert drawing.charts.charts in of_page
    raised(InputError, "png", drawing.save, tmp_path / "one.txt")


def test_drawings_of_loads_are_given_for_one_test(strips_fit):
    table = strips_fit.residuals()
    for test in (None, "two"):
        (chart,) = strips_fit.plot_residuals(test).charts.charts
        own = table if test is None else table[table["test"] == test]
        assert sum(len(s.x) for s in chart.series) == len(own)
        (_, first), *_ = own.groupby(["test", "part"], sort=False)
        assert chart.series[0].y == pytest.approx(first["difference"].tolist(), rel=1e-4)
    strips = strips_fit.setup.tests[1]
    loads = strips_fit.plot_loads("two").charts
    kind = page_presenter_of("strips").charts["loads"]
    assert loads == kind(strips, strips_fit.tests["two"])
    for call, words in (
        (strips_fit.plot_heights, "heights"), (lambda: strips_fit.plot_loads("three"), "one, two"),
        (lambda: strips_fit.plot_residuals("three"), "one, two"),
        (lambda: strips_fit.plot_history("three"), "one: warp"),
        (lambda: strips_fit.plot_history(quantity="load"), "quantity"),
        (lambda: strips_fit.plot_history(component=3), "component"),
        (lambda: strips_fit.plot_history(frame=10**6), "frame"),
    ):  # fmt: skip
        raised(InputError, words, call)


def test_tables_in_notebooks_are_escaped(strips_fit, strips_project):
    evil = replace(strips_project.fabric, name="<script>&")
    setup = replace(strips_fit.setup, project=replace(strips_project, fabric=evil))
    fit = replace(strips_fit, setup=setup)
    for thing in (fit, fit.card, fit.law, bf.check(setup.project)):
        text = thing._repr_html_()
        assert "<script" not in text and text.startswith("<table>") and text.endswith("</table>")
        assert ("&lt;script&gt;&amp;" in text) == (thing is not fit.law)
    answers = {
        row["modulus"]: row for _, row in fit.moduli().groupby("modulus").nth([-1]).iterrows()
    }
    for name in COMPONENTS:
        assert f"<td>{answers[name]['MPa']:.4g}</td>" in fit._repr_html_()
        assert f"<td>{answers[name]['MPa']:.4g}</td>" in fit.card._repr_html_()


def test_card_exports_as_the_command(strips_fit, tmp_path):
    name = "csv"
    write_card(strips_fit.card, tmp_path / "material.toml")
    in_process("export", "material.toml", "--format", name, cwd=tmp_path)
    card = bf.read_card(tmp_path / "material.toml")
    files = card.export(name, tmp_path / "python")
    assert files and {f.parent for f in files} == {tmp_path / "python"}
    for file in files:
        assert file.read_bytes() == (tmp_path / file.name).read_bytes()
    raised(OutputError, "already there", card.export, name, tmp_path / "python")
    assert card.export(name, tmp_path / "python", overwrite=True) == files
    raised(InputError, r"abaqus-umat, .*gsa.*'nope'", card.export, "nope")


@pytest.mark.parametrize("name", COMPONENTS)
def test_modulus_at_a_strain_has_the_band_of_tables_and_card(fitted, name):
    table = fitted.moduli().query("modulus == @name")
    along = fitted.modulus(name, table["strain"].to_numpy())
    assert along.value == pytest.approx(table["MPa"].to_numpy())
    assert along.lower == pytest.approx(table["lower_MPa"].to_numpy())
    assert along.upper == pytest.approx(table["upper_MPa"].to_numpy())
    at = fitted.modulus(name, 0.02)
    assert at == fitted.card.modulus(name, 0.02)
    assert at.lower < at.value < at.upper
    assert f"{at.value:.4g} MPa at 2 % strain" in str(at)
    row = fitted.bands([0.02, 5.0]).query("modulus == @name")
    assert row["lower_MPa"].iloc[0] == pytest.approx(at.lower)
    assert row["upper_MPa"].iloc[0] == pytest.approx(at.upper)
    assert row[["lower_MPa", "upper_MPa"]].iloc[1].isna().all()
    raised(InputError, r"^strain: expected strains from 0 to .* got 5", fitted.modulus, name, 5.0)
    raised(InputError, r"^strain: expected numbers", fitted.modulus, name, "wide")
    raised(InputError, r"^name: expected one of E1", fitted.modulus, "E3", 0.0)


def test_curves_are_columns_of_residuals(fitted):
    curves = fitted.curves()
    assert list(curves) == ["bubble dz"]
    curve = curves["bubble dz"]
    centre = fitted.residuals().query("quantity == 'dz' and x_mm == 0 and y_mm == 0")
    assert curve["pressure_kPa"].is_monotonic_increasing
    assert curve["measured"].tolist() == centre["measured"].tolist()
    assert curve["modelled"].tolist() == centre["modelled"].tolist()


def test_curve_of_a_surface_is_that_of_the_point_nearest_to_the_centre(fitted):
    table = pd.DataFrame({
        "test": "b", "part": "b", "quantity": "dz", "frame": [1] * 4 + [2] * 2,
        "x_mm": [3.0, -2.0, 0.0, 1.0, 5.0, -1.0], "y_mm": [0.0, 2.0, -5.0, 2.0, 0.0, -6.0],
        "pressure_kPa": [10.0] * 4 + [20.0] * 2, "measured": [1.0, 2.0, 3.0, 4.0, 5.0, 6.0],
        "modelled": 0.0, "difference": 0.0, "unit": "mm",
    })  # fmt: skip
    curves = type(fitted).curves(SimpleNamespace(residuals=lambda: table))
    assert curves["b dz"]["measured"].tolist() == [4.0, 5.0]
    assert list(curves["b dz"]) == ["pressure_kPa", "measured", "modelled"]


def test_printed_fit_says_moduli_and_verdict_in_three_lines(fitted):
    lines = str(fitted).splitlines()
    assert len(lines) == 3
    e1 = fitted.modulus("E1", 0.0)
    assert f"E1 {e1.value:.4g} MPa ({e1.lower:.4g} to {e1.upper:.4g})" in lines[1]
    assert lines[2] == f"  {fitted.verdict.lines[0]}"
    for result in (fitted.law, fitted.card, fitted.history(), fitted.history()["bubble"]):
        assert len(repr(result).splitlines()) <= 3 and "array(" not in repr(result)


def test_report_replaces_a_result_only_if_told(fitted, tmp_path):
    fitted.report(tmp_path)
    raised(OutputError, "already holds a result; overwrite=True", fitted.report, tmp_path)
    fitted.report(tmp_path, overwrite=True)


def test_unknowns_are_reported_alike_where_the_mesh_error_is_taken_out():
    """The offset on page and terminal is that of the table of unknowns, not of the fit's mesh."""
    beta = [0, 0, 0, 30, 0, 0, 0, 500, 0, 0, 0, 800]
    bubble = bf.Bubble.of(
        name="bubble",
        radius=100.0,
        pressures=[0.02, 0.05, 0.1],
        elements=108,
        symmetry="quarter",
        nuisance={"pressure_offset": True},
        sheet={"modes": 1},
        data={"known_solution": {"form": "constant", "beta": beta, "elements": 432}},
    )
    bounds = {"E1": [20, 3000], "E2": [20, 3000], "G12": [1, 300]}
    law = bf.Law("constant", bounds=bounds, strain_range=[0.03] * 3)
    fit = bf.fit([bubble], law, fabric=bf.Fabric("x", 0.8), starts=1, jobs=1)
    assert fit.best.certainty.taken_out
    values = {name: entry["value"] for name, entry in fit.result["unknowns"].items()}
    assert values != fit.tests["bubble"].nuisance
    assert fit.result["nuisance"]["pressure_offset_kPa"] == values["pressure_offset"]
    assert fit.result["sheet"]["modes_mm"] == {"z0_1": values["z0_1"]}
    coefficients = fit.coefficients().set_index("unknown")["value"]
    assert coefficients[list(values)].tolist() == list(values.values())
    assert f"pressure_offset {values['pressure_offset']:.3f} kPa" in str(fit.findings)
