"""Strips in a fit: comparisons, weights, folds; what a finished fit says, shows and writes."""

import functools
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pandas as pd
import pytest
from bubblefit.experiments.kinds import FittedTest, Output, Weighting
from bubblefit.experiments.strips import KIND, report
from bubblefit.experiments.strips import report as figures
from bubblefit.experiments.strips.data import Strip, compare_orders
from bubblefit.experiments.strips.prepared import PreparedStrips
from bubblefit.experiments.strips.test import StripsTest
from bubblefit.materials.forms.base import COMPONENTS
from bubblefit.materials.law import HypoelasticLaw
from bubblefit.readers.curves import LoadCurve, fit_load_polynomial
from bubblefit.solvers.membrane.solver import MembraneSolver

from ...complaints import complaint
from ...drawings import caught
from ...projects import project_file
from ...published_laws import TABLE_4_2
from .sections import CURVES, PUBLISHED, SMALL, read, write_exports

LAW = HypoelasticLaw.linear(500.0, 200.0, 20.0)
COARSE = ("increments = 100", "increments = 5")
POINTS = ("[warp]", 'match = "points"\nincrements = 5\n[warp]')


@pytest.fixture
def published(tmp_path) -> Callable[..., PreparedStrips]:
    """The published polynomials, five increments."""
    (tmp_path / "curves.csv").write_bytes((CURVES / "curves.csv").read_bytes())

    def prepared(*changes: tuple[str, str]) -> PreparedStrips:
        test = read(project_file(tmp_path, PUBLISHED, COARSE, *changes))
        return KIND.prepare(test, LAW, MembraneSolver)

    return prepared


@pytest.fixture
def exported(tmp_path) -> Callable[..., PreparedStrips]:
    """Measured points of one or two specimens a direction, five increments."""
    write_exports(tmp_path)

    def prepared(*changes: tuple[str, str]) -> PreparedStrips:
        test = read(project_file(tmp_path, SMALL, POINTS, *changes))
        return KIND.prepare(test, LAW, MembraneSolver)

    return prepared


def fitted(prepared: PreparedStrips, law: HypoelasticLaw = LAW) -> FittedTest:
    """As if the law had been found."""
    comparisons = prepared.comparisons(MembraneSolver, Weighting())
    histories = tuple(c.solver.run(c.model, law) for c in comparisons)
    valid = np.array([0.1, 0.5, 0.3])
    return FittedTest(comparisons, histories, {}, law, (law,), 1.5 * valid, valid, None)


def runs(prepared: PreparedStrips, weighting: Weighting) -> dict[str, float]:
    """Norm of each comparison's residual with the law."""
    return {
        c.name: float(np.linalg.norm(c.objective.residual(c.solver.run(c.model, LAW), {})))
        for c in prepared.comparisons(MembraneSolver, weighting)
    }


# What is compared


def test_a_comparison_a_direction(published):
    compared = published().comparisons(MembraneSolver, Weighting())
    assert [c.name for c in compared] == ["strips: warp", "strips: fill", "strips: bias"]
    # Strips along the yarns lead into a fit; all are free to contract.
    assert [c.stage for c in compared] == [0, 0, 1] and all(c.contracts for c in compared)
    assert not any(c.must_be_stable for c in compared)
    assert all(c.nuisance == () for c in compared)
    assert len({id(c.solver) for c in compared}) == 3
    assert [len(c.objective.load) for c in compared] == [5, 5, 5]
    assert [c.objective.least_noise for c in compared] == [21.7, 64.1, 40.3]
    warp = published().test.strips["warp"]
    np.testing.assert_allclose(
        compared[0].objective.load, warp.polynomial(compared[0].model.elongations)
    )


def test_a_direction_without_weight_is_not_run(published):
    prepared = published(("[data]", "[weights]\nfill = 0\n[data]"))
    assert prepared.test.matched == ("warp", "bias")
    assert list(runs(prepared, Weighting())) == ["strips: warp", "strips: bias"]


def test_alone_the_errors_are_in_newtons_or_relative(published):
    plain, relative = published(), published(('objective = "N"', 'objective = "relative"'))
    assert "N" in plain.objective_is and "largest load" in relative.objective_is
    largest = {
        c.name: c.objective.load.max() for c in plain.comparisons(MembraneSolver, Weighting())
    }
    newtons, shares = runs(plain, Weighting()), runs(relative, Weighting())
    for name, rms in newtons.items():
        assert rms > 1
        assert shares[name] == pytest.approx(rms / largest[name])


def test_among_other_tests_the_strips_share_one_weight(published):
    """The blocks add up to the weight times the weighted mean of the relative errors."""
    prepared = published(("[data]", "[weights]\nwarp = 3\nbias = 0.5\n[data]"))
    alone = published(('objective = "N"', 'objective = "relative"'))
    own = runs(alone, Weighting())
    wanted = 2.0 * np.dot([3, 1, 0.5], list(own.values())) / 4.5
    assert sum(runs(prepared, Weighting(True, 2.0)).values()) == pytest.approx(wanted)


def test_specimens_of_points_can_be_left_out(published, exported):
    assert published().specimens == {}
    prepared = exported()
    whose = prepared.specimens
    assert {name: len(set(w)) for name, w in whose.items()} == {
        "strips: warp": 2, "strips: fill": 1, "strips: bias": 2,
    }  # fmt: skip
    masks = {"strips: warp": np.array(whose["strips: warp"]) == 1}
    warp, fill, _ = prepared.comparisons(MembraneSolver, Weighting(), masks)
    np.testing.assert_allclose(warp.objective.elongation, 0.9 * np.linspace(0, 4, 21), atol=1e-6)
    assert len(fill.objective.load) == 21
    assert prepared.reach(masks).break_shares[1] == prepared.test.reach.break_shares[1]


def test_loads_that_are_zero_have_no_relative_error(exported, tmp_path):
    text = (tmp_path / "f.TXT").read_bytes().decode("latin-1")
    head, *lines = text.split('"s"\t"N"\t"mm"\n')
    rows = [line.split("\t") for line in lines[0].splitlines()]
    # Loads only beyond the end of the model.
    new = [f"{a}\t{b if i > 15 else '0,0'}\t{c}" for i, (a, b, c) in enumerate(rows)]
    (tmp_path / "f.TXT").write_bytes((head + '"s"\t"N"\t"mm"\n' + "\n".join(new)).encode("latin-1"))
    prepared = exported(("gauge_length = 22.0", "gauge_length = 22.0\nfinal_length = 24.0"))
    message = complaint(prepared.comparisons, MembraneSolver, Weighting(True))
    assert "strips[0].fill: the measured load is zero" in message


# Models


def test_refined_models(published):
    test = published().test
    own, finer, more = test.models(), test.models(factor=2.0), test.models(0.5, "increments", 2.0)
    assert list(own) == ["warp", "fill", "bias"]
    assert [len(m.mesh.quads) for m in own.values()] == [40, 40, 300]
    assert [len(m.mesh.quads) for m in finer.values()] == [160, 160, 1200]
    assert [len(m.elongations) for m in more.values()] == [10, 10, 10]
    assert [m.thickness for m in own.values()] == [0.81] * 3
    assert [m.thickness for m in more.values()] == [0.5] * 3
    assert len(test.models(what="increments", factor=0.01)["warp"].elongations) == 1


def settings(test: StripsTest) -> str:
    return repr(dict(test.settings()))


def test_settings_are_what_a_result_depends_on(published, tmp_path):
    own = settings(published().test)
    assert str(tmp_path) not in own and "curves" not in own
    for change in (
        ("width = 25.0", "width = 24.0"),
        ("[data]", "[weights]\nfill = 2\n[data]"),
        ("[data]", "[warp]\ngauge_length = 21.0\n[fill]\n[bias]\n[data]"),
        ("[data]", "[bias]\nfinal_length = 30.0\n[warp]\n[fill]\n[data]"),
        ('objective = "N"', 'objective = "relative"'),
        ("bias_angle = 45.0", "bias_angle = 44.0"),
    ):
        assert settings(published(change).test) != own, change


# What a fit says and shows


def test_findings(published):
    prepared = published()
    fit = fitted(prepared)
    found = report.findings(prepared, fit)
    directions = found.numbers["directions"]
    assert list(directions) == ["warp", "fill", "bias"]
    for (name, numbers), c, h in zip(
        directions.items(), fit.comparisons, fit.histories, strict=True
    ):
        off = h.load - c.objective.load
        assert numbers["rms_N"] == pytest.approx(np.sqrt(np.mean(off**2))), name
        assert numbers["end_load_N"] == h.load[-1] and numbers["matched"] == 5
        assert f"{numbers['rms_N']:.3g}" in found.lines[0]
        assert f"{numbers['rms_N']:.4g}" in found.quality
    total = sum(n["rms_N"] for n in directions.values())
    assert found.numbers["e_uniaxial_N"] == pytest.approx(total)
    assert found.numbers["matched_by"] == "polynomial"
    assert "specimens scatter by 21.7" in found.lines[0]
    assert found.warnings == ()


def test_what_the_data_leave_open_is_said(published, exported):
    prepared = published(("[data]", "[weights]\nfill = 0\n[data]"))
    assert report.findings(prepared, fitted(prepared)).warnings == (
        "no fill strip of strips is matched: E2 rests on the other directions",
    )
    cut = exported(("gauge_length = 20.0", "gauge_length = 20.0\nfinal_length = 22.5"))
    (words,) = report.findings(cut, fitted(cut)).warnings
    beyond = cut.test.strips["warp"].beyond
    left = "points beyond the final length (or before zero) were left out"
    assert words.line == f"warp: {beyond} {left}"


def test_residuals_are_every_matched_load(exported):
    prepared = exported()
    fit = fitted(prepared)
    table = report.residuals(prepared, fit)
    assert list(table.columns) == [
        "part", "elongation_mm", "quantity", "measured", "modelled", "difference", "unit",
    ]  # fmt: skip
    assert set(table["unit"]) == {"N"}
    assert len(table) == sum(len(c.objective.load) for c in fit.comparisons)
    for direction, numbers in report.findings(prepared, fit).numbers["directions"].items():
        own = table[table["part"] == direction]
        np.testing.assert_allclose(own["modelled"] - own["measured"], own["difference"])
        assert np.sqrt((own["difference"] ** 2).mean()) == pytest.approx(numbers["rms_N"])


@pytest.mark.parametrize("prefix", ["", "two-"])
def test_what_is_shown_is_written(exported, tmp_path, prefix):
    prepared = exported()
    fit = fitted(prepared)
    shown = report.show(
        prepared, fit, report.findings(prepared, fit), Output(tmp_path / "out", prefix)
    )
    names = [name for name, _ in (*shown.figures, *shown.files)]
    there = {p.name for p in (tmp_path / "out").iterdir()}
    assert set(names) == there and all(name.startswith(prefix) for name in names)
    assert {f"{prefix}{n}" for n in ("loads.png", "bias.png", "failure.png")} <= there
    assert f"{prefix}orders.png" in there and f"{prefix}bias.vtu" in there
    loads = pd.read_csv(tmp_path / "out" / f"{prefix}loads.csv")
    for strip in prepared.fitted_strips(fit):
        own = loads[loads["direction"] == strip.direction]
        np.testing.assert_allclose(own["model_N"], strip.history.load)
        np.testing.assert_allclose(
            own["polynomial_N"], strip.strip.polynomial(own["elongation_mm"])
        )
        strain = own["elongation_mm"] / strip.strip.gauge_length
        np.testing.assert_allclose(own["engineering_strain"], strain)
    (table,) = shown.tables
    assert [row[0] for row in table.rows] == ["warp", "fill", "bias"]


def test_no_modulus_is_shown_beyond_where_it_is_fitted(published):
    """Gauges that went further than the card is valid for are drawn to the card's end."""
    prepared = published()
    fit = fitted(prepared)
    strips = prepared.fitted_strips(fit)
    gauges = [s.strip.strain for s in strips]
    assert gauges[0] > fit.valid[0] and gauges[1] < fit.valid[1]
    ends = figures.failure_strains(strips, fit.valid)
    assert (ends <= fit.valid).all()
    assert ends[:2] == pytest.approx([fit.valid[0], gauges[1]])
    # As far as the card goes otherwise: nothing but the gauge ends it.
    far = figures.failure_strains(strips, np.array([9.0, 9.0, 9.0]))
    assert far[:2] == pytest.approx(gauges[:2]) and 0.5 < far[2] < 1.2
    warp_only = figures.failure_strains(strips[:1], fit.valid)
    assert warp_only[1:] == pytest.approx(fit.valid[1:])


@pytest.mark.parametrize("through_origin", [True, False])
def test_orders_are_those_of_polynomials_as_they_are_fitted(
    exported, tmp_path, monkeypatch, through_origin
):
    drawn = caught(monkeypatch, figures, "order_charts")
    write = functools.partial(write_offset, tmp_path)
    write()
    prepared = exported(("[data]", f"[data]\nthrough_origin = {str(through_origin).lower()}"))
    strip = prepared.test.strips["warp"]
    assert figures.draw_orders([strip], tmp_path / "orders.png")
    expected = compare_orders(
        *strip.points, range(1, 9), through_origin=through_origin,
        specimens=strip.specimen_of.tolist(),
    )  # fmt: skip
    ((_, told),) = drawn
    assert told[0].rmse == [s.rmse for s in expected.scores]
    assert told[0].left_out == [s.left_out for s in expected.scores]
    # A load at rest of 50 N: only a polynomial with a constant can follow it.
    assert (min(told[0].rmse) < 1.0) == (not through_origin)


def test_points_at_few_elongations_have_no_picture_of_orders(tmp_path):
    """Many specimens read at the same seven places settle no polynomial of order eight."""
    u = np.linspace(0.5, 3.5, 7)
    curves = tuple(LoadCurve("warp", s, u, 100 * u + i, None) for i, s in enumerate("abc"))
    strip = Strip("warp", 20.0, 23.5, fit_load_polynomial(u, 100 * u), curves)
    assert not figures.draw_orders([strip], tmp_path / "orders.png")
    assert not (tmp_path / "orders.png").exists()


def test_what_the_panels_of_loads_show():
    """The polynomial from rest to the end of the model; points only where there are any."""
    u = np.linspace(0.5, 4.5, 9)
    polynomial = fit_load_polynomial(u, 100 * u + 3 * u**2)
    curves = (LoadCurve("warp", "a", u, 100 * u, None),)
    warp = Strip("warp", 20.0, 23.5, polynomial, curves, scatter=7.0)
    models = {"warp": [("model", u, 90 * u)]}
    one, bare = figures.load_panels([warp, Strip("fill", 20.0, 23.0)], models, {"warp": [4.2]})
    places, loads = one.polynomial
    assert (places[0], places[-1], len(places)) == (0.0, pytest.approx(3.5), 200)
    assert loads == pytest.approx(100 * places + 3 * places**2, abs=1e-6)
    assert one.points[0].tolist() == u[u <= 3.5].tolist()
    assert (one.direction, one.scatter, one.rms, one.models) == (
        "warp", 7.0, [4.2], models["warp"]
    )  # fmt: skip
    assert (bare.direction, bare.points, bare.polynomial, bare.scatter) == (
        "fill", None, None, None
    )  # fmt: skip
    assert (bare.models, bare.rms) == ((), ())


def bias(*shear: float) -> tuple[Any, Any]:
    """A row of quads, 10 mm long, from -20 mm on, between gauge points at -10 and 10 mm."""
    heights = np.arange(-20.0, 10.0 * len(shear) - 19.0, 10.0)
    points = np.array([[x, y, 0.0] for y in heights for x in (0.0, 5.0)])
    quads = [[2 * k, 2 * k + 1, 2 * k + 3, 2 * k + 2] for k in range(len(shear))]
    gauge = [int(np.flatnonzero(points[:, 1] == y)[0]) for y in (-10.0, 10.0)]
    mesh = SimpleNamespace(points=points, quads=np.array(quads), node_sets={"gauge": gauge})
    frames = np.array([np.zeros_like(points), np.ones_like(points)])
    return SimpleNamespace(mesh=mesh, warp="warp"), SimpleNamespace(displacement=frames)


def test_shear_is_that_of_the_quads_between_the_gauge_points(monkeypatch):
    model, history = bias(0.9, 0.2, -0.3, 0.8)
    strain = np.column_stack([np.ones(4), np.ones(4), [0.9, 0.2, -0.3, 0.8]])

    def middle(mesh: Any, u: np.ndarray, warp: Any) -> np.ndarray:
        assert mesh is model.mesh and warp == "warp" and (u == 1.0).all()
        return strain

    monkeypatch.setattr(figures, "middle_strain", middle)
    strip: Any = SimpleNamespace(direction="bias", model=model, history=history)
    assert figures.failure_strains([strip], np.full(3, 9.0))[2] == pytest.approx(0.3)
    drawn = caught(monkeypatch, figures, "strip_charts")
    monkeypatch.setattr(figures, "write_vtu", lambda *what, **more: drawn.append((what, more)))
    figures.draw_bias(model, history, Path("b.png"), Path("b.vtu"))
    picture, (written, more) = drawn
    assert picture[0] == Path("b.png") and (picture[3] == 1.0).all()
    assert picture[4].tolist() == [0.9, 0.2, -0.3, 0.8]
    assert picture[5] == model.mesh.node_sets["gauge"]
    assert written[0] is model.mesh and (written[1] == 1.0).all() and written[2] == Path("b.vtu")
    assert more == {"cell_data": {"log_strain_1_2_12": strain}}


def test_moduli_are_drawn_to_the_end_of_the_strips(published, monkeypatch) -> None:
    drawn = caught(monkeypatch, figures, "moduli_together")
    law = HypoelasticLaw(1e3 * np.array(TABLE_4_2), strain_range=np.full(3, 0.13))
    prepared = published()
    fit = fitted(prepared)
    strips = prepared.fitted_strips(fit)
    figures.draw_moduli(strips, replace(fit, law=law), Path("m.png"))
    ((path, strains, curves),) = drawn
    assert path == Path("m.png") and strains.shape == curves.shape == (3, 121)
    assert strains[:, 0].tolist() == [0.0] * 3
    ends = figures.failure_strains(strips, fit.valid)
    # E1 over the warp strain, E2 over the fill's, G12 over the shear.
    assert sorted(strains[:, -1]) == pytest.approx(sorted(ends))
    for name, x, y in zip(COMPONENTS, strains, curves, strict=True):
        assert x[-1] == pytest.approx(ends[COMPONENTS[name]])
        np.testing.assert_allclose(y, law.modulus(name, x))


def test_the_order_in_use_and_the_specimens_are_in_the_picture(exported, monkeypatch) -> None:
    drawn = caught(monkeypatch, figures, "order_charts")
    test = exported(("[data]", "[data]\norder = 3")).test
    strips = [
        test.strips["warp"],
        replace(test.strips["fill"], polynomial=None),
        test.strips["fill"],
    ]
    assert figures.draw_orders(strips, Path("o.png"))
    ((_, told),) = drawn
    assert [(p.direction, p.orders, p.chosen) for p in told] == [
        ("warp", list(range(1, 9)), 3), ("fill", list(range(1, 9)), 3)
    ]  # fmt: skip
    for strip, panel in zip((strips[0], strips[2]), told, strict=True):
        several = len(set(strip.specimen_of.tolist())) > 1
        whose = strip.specimen_of.tolist() if several else None
        scores = compare_orders(
            *strip.points, range(1, 9), through_origin=True, specimens=whose
        ).scores
        assert panel.left_out == [score.left_out for score in scores]
    assert not figures.draw_orders(strips[1:2], Path("o.png"))


def write_offset(folder: Path):
    """Two warp specimens that are pretensioned by 50 N."""
    u = np.linspace(0, 4, 21)
    for number, name in enumerate(("w1.csv", "w2.csv")):
        lines = [f"{a},{50 + 200 * a + 0.01 * number}" for a in u]
        (folder / name).write_text("Extension (mm),Load (N)\n" + "\n".join(lines) + "\n")
