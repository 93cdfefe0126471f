"""experiments/strips/prepared.py: parts of a fit, and strips proposed as next tests."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from bubblefit.experiments.base import Planning, Weighting
from bubblefit.experiments.sections import Fabric, Place
from bubblefit.experiments.strips.data import Strip, compare_orders
from bubblefit.experiments.strips.prepared import CANDIDATES, candidates
from bubblefit.inference.noise import Noise
from bubblefit.materials.forms.base import COMPONENTS
from bubblefit.materials.law import HypoelasticLaw
from bubblefit.meshes.strip_models import straight_strip
from bubblefit.project.project import read_project
from bubblefit.readers.curves import LoadCurve, fit_load_polynomial
from bubblefit.reports.kinds import strips as report
from bubblefit.runs.setup import prepare_fit
from bubblefit.solvers.membrane.solver import MembraneSolver

from ...builders.laws import TABLE_4_2
from ...builders.projects import constant_strips
from ...support.charts import caught
from ...support.refusals import complaint
from .cases import fitted_strips, residual_norms, rows_of


# Comparisons and models
def test_comparisons_are_one_per_direction(published_strips):
    prepared = published_strips()
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


def test_weights_and_units_of_the_errors(published_strips):
    relative = ('objective = "N"', 'objective = "relative"')
    plain, alone = published_strips(), published_strips(relative)
    assert "N" in plain.objective_is and "largest load" in alone.objective_is
    largest = [c.objective.measured.max() for c in plain.comparisons(MembraneSolver, Weighting())]
    newtons, shares = list(residual_norms(plain).values()), list(residual_norms(alone).values())
    assert min(newtons) > 1
    assert shares == pytest.approx([rms / load for rms, load in zip(newtons, largest, strict=True)])
    # Among other tests the blocks add up to the weight times the weighted mean of these.
    weighted = published_strips(("[data]", "[weights]\nwarp = 3\nbias = 0.5\n[data]"))
    wanted = 2.0 * np.dot([3, 1, 0.5], shares) / 4.5
    assert sum(residual_norms(weighted, True, 2.0).values()) == pytest.approx(wanted)
    # A direction without weight is not run.
    unmatched = published_strips(("[data]", "[weights]\nfill = 0\n[data]"))
    assert list(unmatched.test.matched) == ["warp", "bias"]
    assert list(residual_norms(unmatched)) == ["strips: warp", "strips: bias"]


def test_specimens_of_points_can_be_left_out(published_strips, exported_strips):
    assert published_strips().specimens == {}
    prepared = exported_strips()
    whose = {name.split()[1]: np.array(w) for name, w in prepared.specimens.items()}
    assert {name: len(set(w)) for name, w in whose.items()} == {"warp": 2, "fill": 1, "bias": 2}
    masks = {"strips: warp": whose["warp"] == 1}
    warp, fill, _ = prepared.comparisons(MembraneSolver, Weighting(), masks)
    np.testing.assert_allclose(warp.objective.elongation, 0.9 * np.linspace(0, 4, 21), atol=1e-6)
    assert len(fill.objective.measured) == 21
    assert prepared.reach(masks).break_shares[1] == prepared.test.reach.break_shares[1]


def test_specimens_whose_files_name_them_alike_are_numbered_from_one(exported_strips):
    prepared = exported_strips()
    test = prepared.test
    strips = {
        direction: replace(strip, curves=tuple(replace(c, specimen="A") for c in strip.curves))
        for direction, strip in test.strips.items()
    }
    alike = replace(prepared, test=replace(test, strips=strips)).parts["specimens"]
    assert sorted(alike) == [f"{cut}, specimen {n}" for cut in ("bias", "warp") for n in (1, 2)]
    for number in (0, 1):
        mask = alike[f"warp, specimen {number + 1}"]["strips: warp"]
        np.testing.assert_array_equal(mask, test.strips["warp"].specimen_of != number)


def test_unknown_compliance_is_bounded_by_four_deviations_of_its_prior(exported_strips):
    keys = "compliance = 0.001\ncompliance_prior = 0.002\n[warp]"
    for compared in exported_strips(("[warp]", keys)).comparisons(MembraneSolver, Weighting()):
        (compliance,) = compared.nuisance
        assert (compliance.lower, compliance.upper) == (0.0, pytest.approx(0.009))
        assert (compliance.start, compliance.prior) == (0.001, 0.002)
        assert compliance.shared and compliance.unit == "mm/N"
        assert compared.objective.compliance == (compliance.name, 0.001)


def test_loads_that_are_zero_have_no_relative_error(exported_strips, tmp_path):
    u = np.linspace(0, 4, 21)  # with loads only beyond the end of the model
    text = "Extension (mm),Load (N)\n" + rows_of(",", u, np.where(u > 3, 80 * u, 0))
    (tmp_path / "f.TXT").write_text(text)
    prepared = exported_strips(("gauge_length = 22.0", "gauge_length = 22.0\nfinal_length = 24.0"))
    message = complaint(prepared.comparisons, MembraneSolver, Weighting(True))
    assert "strips[0].fill: the measured load is zero" in message


# Results of a fit
def test_moduli_are_drawn_to_where_they_are_fitted(published_strips, monkeypatch):
    """Gauges that went further than the card is valid for are drawn to the card's end."""
    prepared = published_strips()
    fit = fitted_strips(prepared)
    strips = prepared.fitted_parts(fit)
    gauges = [s.data.end_strain() for s in strips]
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
def test_chart_of_orders_is_of_polynomials_as_fitted(
    exported_strips, tmp_path, monkeypatch, through_origin
):
    """Of two warp specimens that are pretensioned by 50 N, and one of the fill."""
    drawn = []
    monkeypatch.setattr(report, "order_chart", lambda *given: given)
    monkeypatch.setattr(report, "save", lambda path, charts: drawn.append(charts.charts))
    u = np.linspace(0, 4, 21)
    for number, name in enumerate(("w1.csv", "w2.csv")):
        text = rows_of(",", u, 50 + 200 * u + 0.01 * number)
        (tmp_path / name).write_text("Extension (mm),Load (N)\n" + text + "\n")
    said = f"[data]\norder = 3\nthrough_origin = {str(through_origin).lower()}"
    strips = exported_strips(("[data]", said)).test.strips
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


def test_noise_of_a_fit_counts_specimens(tmp_path):
    """Two specimens of constant moduli: all of their loads count as one."""

    def problem(*changes):
        project = read_project(constant_strips(tmp_path, *changes))
        return prepare_fit(project, [project.tests["one"]]).problem()

    fit = problem()
    point = fit.evaluate(fit.unknowns.at(np.array([10.0, 190.0, 330.0])), False)
    noise = Noise.from_residual(fit, point.residual)
    assert noise.correlated_count["one: warp"] == pytest.approx(22.0, rel=1e-6)
    # A polynomial of the same points says no more, though it has as many values as increments.
    warp, fill = problem(('"points"', '"polynomial"')).comparisons
    assert warp.objective.correlated_count == pytest.approx(8.0) == fill.objective.correlated_count


PLACE = Place(Path("p.toml"), "strips", Fabric("made", 0.8))
LAW = HypoelasticLaw.linear(400.0, 250.0, 12.0, 0.2)


def planning_of(noise=None, ends=(0.1, 0.08, 0.2)):
    law = HypoelasticLaw(LAW.beta, LAW.nu12, ends, form=LAW.form)
    return Planning(PLACE, (), {}, law, MembraneSolver, noise)


def test_strips_along_the_yarns_and_at_usual_angles_are_proposed():
    proposed = candidates(planning_of())
    names = [candidate.name for candidate in proposed]
    assert names[:2] == ["warp strip", "fill strip"]
    assert names[2:] == [f"strip at {angle:g} degrees" for angle in sorted(CANDIDATES.angles)]
    assert {candidate.noise_is for candidate in proposed} == {"assumed"}
    assert {candidate.specimens for candidate in proposed} == {CANDIDATES.specimens}


@pytest.mark.parametrize(("number", "end"), [(0, 0.1), (1, 0.08)])
def test_strip_along_a_yarn_is_pulled_to_the_end_of_the_law(number, end):
    prepared = candidates(planning_of())[number].make()
    (strip,) = prepared.test.strips.values()
    assert np.log(strip.final_length / strip.gauge_length) == pytest.approx(end)
    (curve,) = strip.curves
    assert len(curve.load) == CANDIDATES.increments and (np.diff(curve.load) > 0).all()


def test_loads_are_those_of_the_model_with_the_law():
    planning = planning_of()
    (strip,) = candidates(planning)[0].make().test.strips.values()
    model = straight_strip(
        "warp", strip.gauge_length, strip.final_length, 0.8, increments=CANDIDATES.increments
    )
    expected = MembraneSolver().run(model, planning.law).load
    np.testing.assert_allclose(strip.curves[0].load / expected, 1.0, rtol=1e-6)


def test_bias_strip_ends_where_its_shear_does():
    proposed = {candidate.name: candidate for candidate in candidates(planning_of())}
    (strip,) = proposed["strip at 45 degrees"].make().test.strips.values()
    # The area stays: shear is twice the strain of the gauge.
    assert np.log(strip.final_length / strip.gauge_length) == pytest.approx(0.1)


def test_noise_is_the_given_one_or_a_share_of_the_load():
    given = candidates(planning_of(noise=3.0))
    assert {candidate.noise_is for candidate in given} == {"given"}
    assert given[0].make().test.noise == 3.0
    assumed = candidates(planning_of())[0].make().test
    largest = assumed.strips["warp"].curves[0].load.max()
    assert 0.0 < assumed.noise < largest
    stiffer = Planning(PLACE, (), {}, planning_of().law.with_beta(2 * LAW.beta), MembraneSolver)
    assert candidates(stiffer)[0].make().test.noise == pytest.approx(2 * assumed.noise, rel=1e-6)
