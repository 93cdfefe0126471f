"""Strips in a fit and with cards: comparisons, weights, folds; numbers, files and figures."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from bubblefit.experiments.base import Weighting
from bubblefit.experiments.fitted import FittedTest
from bubblefit.experiments.strips import KIND
from bubblefit.experiments.strips.curve_shape import compare_orders
from bubblefit.experiments.strips.data import BELOW_ZERO, BEYOND_END, Strip
from bubblefit.experiments.strips.prepared import PreparedStrips
from bubblefit.materials.forms.base import COMPONENTS
from bubblefit.materials.law import HypoelasticLaw
from bubblefit.readers.curves import LoadCurve, fit_load_polynomial
from bubblefit.reports.kinds import strips as report
from bubblefit.solvers.membrane.solver import MembraneSolver

from ...builders.laws import TABLE_4_2
from ...builders.projects import project_file
from ...builders.strip_tests import BIAS, WARP
from ...support.charts import caught
from ...support.refusals import complaint
from .test_reading import CURVES, PUBLISHED, SMALL, read, rows, write_exports

LAW = HypoelasticLaw.linear(500.0, 200.0, 20.0)


COARSE = ("increments = 100", "increments = 5")


POINTS = ("[warp]", 'match = "points"\nincrements = 5\n[warp]')


Prepare = Callable[..., PreparedStrips]


def of(folder: Path, text: str, *changes: tuple[str, str]) -> PreparedStrips:
    return KIND.prepare(read(project_file(folder, text, *changes)), LAW, MembraneSolver)


@pytest.fixture
def published(tmp_path) -> Prepare:
    (tmp_path / "curves.csv").write_bytes((CURVES / "curves.csv").read_bytes())
    return lambda *changes: of(tmp_path, PUBLISHED, COARSE, *changes)


@pytest.fixture
def exported(tmp_path) -> Prepare:
    write_exports(tmp_path)
    return lambda *changes: of(tmp_path, SMALL, POINTS, *changes)


def fitted(prepared: PreparedStrips) -> FittedTest:
    comparisons = prepared.comparisons(MembraneSolver, Weighting())
    histories = tuple(c.solver.run(c.model, LAW) for c in comparisons)
    valid = np.array([0.1, 0.5, 0.3])
    return FittedTest(comparisons, histories, {}, LAW, (LAW,), 1.5 * valid, valid, None)


def norms(prepared: PreparedStrips, *weighting) -> dict[str, float]:
    return {
        c.name: float(np.linalg.norm(c.objective.residual(c.solver.run(c.model, LAW), {})))
        for c in prepared.comparisons(MembraneSolver, Weighting(*weighting))
    }


# Comparisons and models
def test_a_comparison_a_direction(published):
    prepared = published()
    compared = prepared.comparisons(MembraneSolver, Weighting())
    assert [c.name for c in compared] == ["strips: warp", "strips: fill", "strips: bias"]
    # Strips along the yarns lead into a fit; all are free to contract.
    assert [c.stage for c in compared] == [0, 0, 1] and all(c.contracts for c in compared)
    assert not any(c.must_be_stable or c.nuisance for c in compared)
    assert len({id(c.solver) for c in compared}) == 3
    assert [len(c.objective.measured) for c in compared] == [5, 5, 5]
    assert [c.objective.least_noise for c in compared] == [21.7, 64.1, 40.3]
    load = prepared.test.strips["warp"].polynomial(compared[0].model.elongations)
    np.testing.assert_allclose(compared[0].objective.measured, load)


def test_weights_and_units_of_the_errors(published):
    relative = ('objective = "N"', 'objective = "relative"')
    plain, alone = published(), published(relative)
    assert "N" in plain.objective_is and "largest load" in alone.objective_is
    largest = [c.objective.measured.max() for c in plain.comparisons(MembraneSolver, Weighting())]
    newtons, shares = list(norms(plain).values()), list(norms(alone).values())
    assert min(newtons) > 1
    assert shares == pytest.approx([rms / load for rms, load in zip(newtons, largest, strict=True)])
    # Among other tests the blocks add up to the weight times the weighted mean of these.
    weighted = published(("[data]", "[weights]\nwarp = 3\nbias = 0.5\n[data]"))
    wanted = 2.0 * np.dot([3, 1, 0.5], shares) / 4.5
    assert sum(norms(weighted, True, 2.0).values()) == pytest.approx(wanted)
    # A direction without weight is not run.
    unmatched = published(("[data]", "[weights]\nfill = 0\n[data]"))
    assert list(unmatched.test.matched) == ["warp", "bias"]
    assert list(norms(unmatched)) == ["strips: warp", "strips: bias"]


def test_specimens_of_points_can_be_left_out(published, exported):
    assert published().specimens == {}
    prepared = exported()
    whose = {name.split()[1]: np.array(w) for name, w in prepared.specimens.items()}
    assert {name: len(set(w)) for name, w in whose.items()} == {"warp": 2, "fill": 1, "bias": 2}
    masks = {"strips: warp": whose["warp"] == 1}
    warp, fill, _ = prepared.comparisons(MembraneSolver, Weighting(), masks)
    np.testing.assert_allclose(warp.objective.elongation, 0.9 * np.linspace(0, 4, 21), atol=1e-6)
    assert len(fill.objective.measured) == 21
    assert prepared.reach(masks).break_shares[1] == prepared.test.reach.break_shares[1]


def test_loads_that_are_zero_have_no_relative_error(exported, tmp_path):
    u = np.linspace(0, 4, 21)  # with loads only beyond the end of the model
    text = "Extension (mm),Load (N)\n" + rows(",", u, np.where(u > 3, 80 * u, 0))
    (tmp_path / "f.TXT").write_text(text)
    prepared = exported(("gauge_length = 22.0", "gauge_length = 22.0\nfinal_length = 24.0"))
    message = complaint(prepared.comparisons, MembraneSolver, Weighting(True))
    assert "strips[0].fill: the measured load is zero" in message


def test_refined_models(published):
    test = published().test
    own, finer, more = test.models(), test.models(factor=2.0), test.models(0.5, "increments", 2.0)
    assert list(own) == ["warp", "fill", "bias"]
    assert [len(m.mesh.quads) for m in own.values()] == [40, 40, 300]
    assert [len(m.mesh.quads) for m in finer.values()] == [160, 160, 1200]
    assert [len(m.elongations) for m in more.values()] == [10, 10, 10]
    assert [m.thickness for m in (*own.values(), *more.values())] == [0.81] * 3 + [0.5] * 3
    assert len(test.models(None, "increments", 0.01)["warp"].elongations) == 1


def test_settings_are_what_a_result_depends_on(published, tmp_path):
    def settings(*changes):
        return repr(dict(published(*changes).test.settings()))

    own = settings()
    assert str(tmp_path) not in own and "curves" not in own
    for change in (
        ("width = 25.0", "width = 24.0"),
        ("[data]", "[weights]\nfill = 2\n[data]"),
        ("[data]", "[warp]\ngauge_length = 21.0\n[fill]\n[bias]\n[data]"),
        ("[data]", "[bias]\nfinal_length = 30.0\n[warp]\n[fill]\n[data]"),
        ('objective = "N"', 'objective = "relative"'),
        ("bias_angle = 45.0", "bias_angle = 44.0"),
    ):
        assert settings(change) != own, change


# Results of a fit
def test_no_modulus_is_shown_beyond_where_it_is_fitted(published, monkeypatch):
    """Gauges that went further than the card is valid for are drawn to the card's end."""
    prepared = published()
    fit = fitted(prepared)
    strips = prepared.fitted_parts(fit)
    gauges = [s.data.strain_by() for s in strips]
    assert gauges[0] > fit.valid[0] and gauges[1] < fit.valid[1]
    ends = report.failure_strains(strips, fit.valid)
    assert (ends <= fit.valid).all()
    assert ends[:2] == pytest.approx([fit.valid[0], gauges[1]])
    # As far as the card goes otherwise: nothing but the gauge ends it.
    far = report.failure_strains(strips, np.array([9.0, 9.0, 9.0]))
    assert far[:2] == pytest.approx(gauges[:2]) and 0.5 < far[2] < 1.2
    assert report.failure_strains(strips[:1], fit.valid)[1:] == pytest.approx(fit.valid[1:])
    # E1 is drawn over the warp strain, E2 over the fill's, G12 over the shear.
    drawn = caught(monkeypatch, report, "moduli_together")
    law = HypoelasticLaw(1e3 * np.array(TABLE_4_2), strain_range=np.full(3, 0.13))
    report.draw_moduli(strips, replace(fit, law=law), Path("m.png"))
    ((path, strains, curves),) = drawn
    assert path == Path("m.png") and strains.shape == curves.shape == (3, 121)
    assert strains[:, 0].tolist() == [0.0] * 3
    for name, x, y in zip(COMPONENTS, strains, curves, strict=True):
        assert x[-1] == pytest.approx(ends[COMPONENTS[name]])
        np.testing.assert_allclose(y, law.modulus(name, x))


@pytest.mark.parametrize("through_origin", [True, False])
def test_orders_are_those_of_polynomials_as_they_are_fitted(
    exported, tmp_path, monkeypatch, through_origin
):
    """Of two warp specimens that are pretensioned by 50 N, and one of the fill."""
    drawn = []
    monkeypatch.setattr(report, "order_chart", lambda *given: given)
    monkeypatch.setattr(report, "save", lambda path, charts: drawn.append(charts.charts))
    u = np.linspace(0, 4, 21)
    for number, name in enumerate(("w1.csv", "w2.csv")):
        text = rows(",", u, 50 + 200 * u + 0.01 * number)
        (tmp_path / name).write_text("Extension (mm),Load (N)\n" + text + "\n")
    said = f"[data]\norder = 3\nthrough_origin = {str(through_origin).lower()}"
    strips = exported(("[data]", said)).test.strips
    bare = replace(strips["fill"], polynomial=None)
    assert report.draw_orders([strips["warp"], bare, strips["fill"]], tmp_path / "orders.png")
    (panels,) = drawn
    for panel, direction, several in zip(panels, ("warp", "fill"), (True, False), strict=True):
        strip = strips[direction]
        scores = compare_orders(
            *strip.points, range(1, 9), through_origin=through_origin,
            specimens=strip.specimen_of.tolist() if several else None,
        )  # fmt: skip
        assert panel == (direction, *map(list, zip(*scores, strict=True)), 3)
    # A load at rest of 50 N: only a polynomial with a constant can follow it.
    assert (min(panels[0][2]) < 1.0) == (not through_origin)
    assert not report.draw_orders([bare], tmp_path / "orders.png")
    # Many specimens read at the same seven places settle no polynomial of order eight.
    u = np.linspace(0.5, 3.5, 7)
    curves = tuple(LoadCurve("warp", s, u, 100 * u + i, None) for i, s in enumerate("abc"))
    strip = Strip("warp", 20.0, 23.5, fit_load_polynomial(u, 100 * u), curves)
    assert not report.draw_orders([strip], tmp_path / "orders.png")


def test_points_of_a_strip_and_those_left_out():
    elongation, load = WARP.points
    assert elongation.tolist() == [0.0, 1.0, 1.0, 2.0, 2.0, 4.0]
    assert load.tolist() == [0.0, 100.0, 120.0, 200.0, 240.0, 400.0]
    assert WARP.specimen_of.tolist() == [0, 0, 1, 0, 1, 0] and WARP.unmatched_count == 3
    (file,) = WARP.data_files(points=True)
    assert (file.path, file.used, file.dropped) == (
        Path("w.csv"),
        4,
        {BELOW_ZERO: 1, BEYOND_END: 1},
    )
    (file,) = WARP.data_files(points=False)
    assert (file.used, file.dropped) == (6, {})
    # The last point may lie at the end by rounding.
    for shorter, beyond in ((1e-10, 3), (1e-8, 4)):
        just = replace(WARP, final_length=20.0 + 4.0 * (1 - shorter))
        assert (
            just.unmatched_count == beyond
            and just.data_files(True)[0].dropped[BEYOND_END] == beyond - 2
        )
    assert BIAS.points[0].size == BIAS.specimen_of.size == BIAS.unmatched_count == 0


def test_lengths_and_noise_of_a_strip():
    assert WARP.elongation == 4.0 and WARP.strain_by() == pytest.approx(np.log(1.2))
    some = np.array([True, True, True, True, True, False])
    assert WARP.strain_by(some) == WARP.strain_by()
    opened = replace(WARP, open_end=True)
    assert opened.strain_by(some) == pytest.approx(np.log(1.1))
    assert opened.strain_by(None) == pytest.approx(np.log(1.2))
    assert replace(BIAS, open_end=True).strain_by(some) == pytest.approx(np.log(1.2))
    assert WARP.noise(1000.0) == (7.5, "specimens' scatter")
    assert WARP.noise(1000.0, 0.0) == (0.0, "given")
    assert BIAS.noise(1000.0) == (5.0, "assumed")
    assert BIAS.break_shares() is None


def test_breaks_of_a_strip_are_shares_of_its_strain():
    """A load that bends at a quarter and at two thirds of the strain, and one that is cut there."""
    elongation = np.linspace(0, 20, 400)  # so long that no other measure of strain will do
    strain = np.log1p(elongation / 20.0)
    first, second = (np.maximum(strain - strain[-1] * share, 0) for share in (1 / 4, 2 / 3))
    load = 900 * strain - 800 * first + 500 * second
    polynomial = fit_load_polynomial(elongation, load, 12)
    shares = replace(WARP, final_length=40.0, polynomial=polynomial).break_shares()
    assert shares == pytest.approx((0.25, 0.667), abs=0.05)
