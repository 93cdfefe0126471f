"""Setup of a fit: shared unknowns, fingerprints, and tests of weight 0."""

from dataclasses import replace

import bubblefit as bf
import numpy as np
import pytest
from bubblefit.cli.fits import lines_of
from bubblefit.errors import InputError
from bubblefit.materials.forms.spline import TriLinear
from bubblefit.reports.content import Table
from bubblefit.reports.fit_page import predicted_tables
from bubblefit.runs.setup import fingerprints, prepare_fit

from ..builders.projects import (
    STRIP_ELONGATION,
    STRIP_MODULI,
    computed_bubble_fields,
    constant_strips,
    fit_setup,
    known_bubble,
    known_bubble_of_form,
)
from ..builders.unknowns import project
from ..support.commands import in_process, one_line, result_in


def test_shared_unknowns_precede_those_of_comparisons(tmp_path):
    both = "nu12 = {}\nthickness = { prior = 0.02 }"
    problem = prepare_fit(own := project(tmp_path, both), own.chosen(None, fitted=True)).problem()
    assert problem.unknowns.nuisance.names == ("nu12", "thickness")
    nu12, thickness = problem.unknowns.nuisance.shared
    assert (nu12.lower, nu12.upper, nu12.start, nu12.prior) == (0.0, 0.6, 0.0, None)
    assert (thickness.lower, thickness.upper) == pytest.approx((0.4, 1.2))
    assert (thickness.start, thickness.prior, thickness.unit) == (0.8, 0.02, "mm")
    # One independent value of a block's norm: the median of what the strips' objectives have.
    objectives = [c.objective for c in problem.comparisons]
    weights = [
        o.correlated_count * o.least_noise / o.scale[0] / np.sqrt(o.sizes[0]) for o in objectives
    ]
    assert thickness.weight == pytest.approx(np.median(weights))
    # The start of every comparison's model is its own thickness.
    assert problem.unknowns.at(np.array([10.0, 200.0, 300.0]))[3:].tolist() == [0.0, 0.8]


BREAKS = [[0.03, 0.08]] * 3


@pytest.fixture(scope="module")
def cubic(bubble):
    return bubble.fit.setup


@pytest.fixture(scope="module")
def regions(tmp_path_factory):
    breaks = "breaks = { warp = [0.03, 0.08], fill = [0.03, 0.08], shear = [0.03, 0.08] }"
    form = f'form = "trilinear"\n{breaks}'
    return fit_setup(known_bubble_of_form(tmp_path_factory.mktemp("regions"), form))


def changed(setup, **other):
    problem = setup.problem()
    one, two = fingerprints(setup, problem), fingerprints(replace(setup, **other), problem)
    assert list(one) == list(two) == ["law", "fit settings", "tests", "data", "solver"]
    return [name for name in one if one[name] != two[name]]


@pytest.mark.parametrize(
    "change",
    [
        {"nu12": 0.25}, {"strain_range": np.array([0.13, 0.13, 0.14])},
        {"strain_range": np.array([0.12, 0.13, 0.13])}, {"thickness_change": "incompressible"}
    ],
    ids=["nu12", "shear range", "warp range", "thickness"],
)  # fmt: skip
def test_fingerprint_depends_on_every_part_of_law(cubic, regions, change):
    for setup in (cubic, regions):
        assert changed(setup, law=replace(setup.law, **change)) == ["law"]


def test_fingerprint_depends_on_breaks(regions):
    assert changed(regions, law=replace(regions.law, form=TriLinear.at(BREAKS))) == []
    for component in range(3):
        breaks = np.array(BREAKS)
        breaks[component, 1] = 0.09
        assert changed(regions, law=replace(regions.law, form=TriLinear.at(breaks))) == ["law"]


def test_finer_mesh_starts_at_equilibrium_of_coarse_one(tmp_path):
    sheet = "[bubble.sheet]\nmodes = 1\n\n[bubble.nuisance]"
    setup = fit_setup(known_bubble(tmp_path, ("[bubble.nuisance]", sheet)))
    problem, (prepared,) = setup.problem(), setup.tests
    (own,) = problem.comparisons
    (finer,) = replace(prepared, by_this_model=False).finer(
        setup.make_solver, setup.weightings[0], 2.0
    )
    nuisance = {n.name: 3.0 * (-1) ** k for k, n in enumerate(own.nuisance)}
    law, free = prepared.known, problem.unknowns.free
    beside = own.run(law, free, nuisance, False)
    cold, led = (finer.run(law, free, nuisance, False, one) for one in (None, beside))
    assert np.abs(cold.path - led.path).max() < 1e-6 * np.abs(cold.path).max()


TWO = ("weight = 3.0", "weight = 0")


BOTH = (TWO, ('name = "one"', 'name = "one"\nweight = 0'))


@pytest.fixture(scope="module")
def fitted(tmp_path_factory):
    folder = tmp_path_factory.mktemp("zero")
    return bf.fit(bf.read_project(constant_strips(folder, TWO)), jobs=1, starts=1, progress=False)


@pytest.fixture(scope="module")
def alone(tmp_path_factory):
    folder = tmp_path_factory.mktemp("alone")
    project = bf.read_project(constant_strips(folder))
    return bf.fit(project, "one", jobs=1, starts=1, progress=False)


def test_test_of_weight_zero_does_not_change_the_fit(fitted, alone):
    assert list(fitted.tests) == ["one"] == list(alone.tests)
    assert fitted.objective == pytest.approx(alone.objective, rel=1e-9)
    np.testing.assert_allclose(fitted.law.beta, alone.law.beta, rtol=1e-9)
    assert "predicted" not in alone.result
    assert not predicted_tables(alone)


def test_test_of_weight_zero_is_predicted(fitted, tmp_path):
    """Without contraction a load is 0.8 mm times 25 mm times E ln(1 + elongation / 20)."""
    inside = STRIP_ELONGATION[STRIP_ELONGATION <= 2.5]
    e1 = float(fitted.law.E1(0.0))
    off = [
        20.0 * (e1 - modulus) * np.log1p(inside / 20.0) for modulus in STRIP_MODULI["two"]["warp"]
    ]
    rms = float(np.sqrt(np.mean(np.square(off))))
    assert set(fitted.predicted) == {"two"}
    told = fitted.result["predicted"]["two"]
    assert told["units"] == dict.fromkeys(told["rms"], "N")
    (comparison,) = told["rms"]
    assert told["rms"][comparison] == pytest.approx(rms, rel=1e-3)
    line = f"prediction of {comparison}: {told['rms'][comparison]:.3g} N RMS (weight 0: not fitted)"
    assert line in lines_of(fitted, tmp_path)
    (table,) = predicted_tables(fitted)
    assert isinstance(table, Table) and table.rows == [[comparison, told["rms"][comparison], "N"]]
    assert "Predicted, not fitted" in fitted.report(tmp_path / "out").read_text()
    assert result_in(tmp_path / "out")["predicted"] == fitted.result["predicted"]


def test_all_tests_of_weight_zero_are_refused(tmp_path):
    path = constant_strips(tmp_path, *BOTH)
    for command in ("fit", "estimate"):
        done = in_process(command, path, cwd=tmp_path, code=2)
        one_line(done, "project.toml: weight: is 0 for every test chosen (one, two)")
    with pytest.raises(InputError, match="nothing would be fitted"):
        bf.fit(bf.read_project(path), "two", jobs=1)


def test_single_bubble_of_weight_zero_is_refused(tmp_path):
    path = known_bubble(tmp_path, ("[[bubble]]", "[[bubble]]\nweight = 0"))
    done = in_process("bubble", path, cwd=tmp_path, code=2)
    one_line(done, "weight: is 0 for every test chosen (bubble): nothing would be fitted")


def test_weight_of_zero_from_python_equals_that_of_file(tmp_path, fitted):
    project = bf.read_project(constant_strips(tmp_path))
    again = bf.fit(project, jobs=1, starts=1, weights={"two": 0}, progress=False)
    np.testing.assert_allclose(again.law.beta, fitted.law.beta, rtol=1e-9)
    assert set(again.predicted) == {"two"}
    with pytest.raises(InputError, match="weight: is 0 for every test"):
        bf.fit(project, jobs=1, weights={"strips": 0})
    with pytest.raises(InputError, match="two: weight: expected 0 or more, got -1"):
        bf.fit(project, jobs=1, weights={"two": -1})


class Stretch(bf.OwnTest):
    """A test of one's own: a load that is proportional to E1."""

    measured = 4.0 * np.arange(1.0, 6.0)
    strain = (0.1, 0.1, 0.1)

    def modelled(self, law):
        return 0.01 * float(law.E1(0.0)) * np.arange(1.0, 6.0)


def test_own_test_of_weight_zero_gives_no_arbitrary_modulus():
    law = bf.Law("constant", bounds={"E1": (0.02, 2.0), "E2": (0.02, 2.0), "G12": (0.005, 0.2)})
    test = Stretch()
    test.weight = 0.0
    with pytest.raises(InputError, match="weight: is 0 for every test"):
        bf.fit([test], law, fabric=bf.Fabric("made", thickness=0.8), jobs=1, starts=1)


def test_heights_of_the_sheet_at_rest_are_among_the_data_of_a_fit():
    fields = computed_bubble_fields(pressures=[0.02, 0.06], elements=108, symmetry="full")
    moved = [field.displacement for field in fields]
    x, y = fields[0].points.T
    marks = []
    for height in (0.0, 1.0):
        points = np.column_stack([x, y, height * (1.0 - (x**2 + y**2) / 1e4)])
        keys = {"radius": 100.0, "elements": 108, "symmetry": "full"}
        sheet = {"surface": "measured"}
        bubble = bf.Bubble(points, moved, [0.02, 0.06], sheet=sheet, **keys)
        law = bf.Law("constant", bounds={"E1": [20, 3000], "E2": [20, 3000], "G12": [1, 300]})
        setup = fit_setup(bf.Project.of(bubble, law, fabric=bf.Fabric("", 0.8)))
        marks.append(fingerprints(setup, setup.problem()))
    flat, bulged = marks
    assert flat.pop("data") != bulged.pop("data") and flat == bulged
