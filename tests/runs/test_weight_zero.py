"""A test of weight 0 is left out of the fit, and predicted with its law."""

import bubblefit as bf
import numpy as np
import pytest
from bubblefit.cli.fits import lines_of
from bubblefit.errors import InputError
from bubblefit.reports.content import Table
from bubblefit.reports.fit_page import predicted_tables

from ..builders.projects import STRIP_ELONGATION, STRIP_MODULI, constant_strips, known_bubble
from ..support.commands import in_process, one_line, result_in

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


def test_the_fit_is_that_without_the_test(fitted, alone):
    assert list(fitted.tests) == ["one"] == list(alone.tests)
    assert fitted.objective == pytest.approx(alone.objective, rel=1e-9)
    np.testing.assert_allclose(fitted.law.beta, alone.law.beta, rtol=1e-9)
    assert "predicted" not in alone.result
    assert not predicted_tables(alone)


def test_the_test_is_predicted_with_the_law(fitted, tmp_path):
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


def test_all_tests_of_weight_zero_are_bad_input(tmp_path):
    path = constant_strips(tmp_path, *BOTH)
    for command in ("fit", "estimate"):
        done = in_process(command, path, cwd=tmp_path, code=2)
        one_line(done, "project.toml: weight: is 0 for every test chosen (one, two)")
    with pytest.raises(InputError, match="nothing would be fitted"):
        bf.fit(bf.read_project(path), "two", jobs=1)


def test_a_single_bubble_of_weight_zero_is_bad_input(tmp_path):
    path = known_bubble(tmp_path, ("[[bubble]]", "[[bubble]]\nweight = 0"))
    done = in_process("bubble", path, cwd=tmp_path, code=2)
    one_line(done, "weight: is 0 for every test chosen (bubble): nothing would be fitted")


def test_weights_of_zero_in_python(tmp_path, fitted):
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


def test_a_test_of_ones_own_of_weight_zero_gives_no_arbitrary_modulus():
    law = bf.Law("constant", bounds={"E1": (0.02, 2.0), "E2": (0.02, 2.0), "G12": (0.005, 0.2)})
    test = Stretch()
    test.weight = 0.0
    with pytest.raises(InputError, match="weight: is 0 for every test"):
        bf.fit([test], law, fabric=bf.Fabric("made", thickness=0.8), jobs=1, starts=1)
