"""A study that begins at a card refuses one that the project's bounds do not allow."""

import pytest
from bubblefit.materials.card import MaterialCard, write_card
from bubblefit.materials.law import HypoelasticLaw
from bubblefit.project.project import read_project
from bubblefit.runs.optimum import find_optimum

from ..builders.projects import constant_strips
from ..support.commands import in_process
from ..support.refusals import complaint_with

#: Bounds on coefficients (GPa): G12, E2, E1.
COEFFICIENTS = (
    "E1 = [0.02, 2.0]\nE2 = [0.03, 1.0]\nG12 = [0.005, 0.2]",
    "lower = [0.005, 0.03, 0.02]\nupper = [0.2, 1.0, 2.0]",
)


def linear_card(*moduli):
    return MaterialCard(HypoelasticLaw.linear(*moduli, 0.0), 0.8, "a card")


@pytest.mark.parametrize(
    ("moduli", "words"),
    [
        ((2500.0, 190.0, 10.0), ("E1 at 0 % of strain is 2500 MPa, above", "bound of 2000 MPa")),
        ((330.0, 20.0, 10.0), ("E2 at 0 % of strain is 20 MPa, below", "bound of 30 MPa")),
        ((330.0, 190.0, 4.9), ("G12 at 0 % of strain is 4.9 MPa, below", "bound of 5 MPa")),
    ],
)
def test_card_with_modulus_beyond_bound_is_refused(tmp_path, moduli, words):
    project = read_project(constant_strips(tmp_path))
    named = ("project.toml", "--card", *words)
    complaint_with(named, find_optimum, project, linear_card(*moduli), "one")


@pytest.mark.parametrize(
    ("moduli", "words"),
    [
        ((2500.0, 190.0, 10.0), ("beta_11 is 2500 MPa, above", "bound of 2000 MPa")),
        ((330.0, 29.0, 10.0), ("beta_7 is 29 MPa, below", "bound of 30 MPa")),
    ],
)
def test_card_with_coefficient_beyond_bound_is_refused(tmp_path, moduli, words):
    project = read_project(constant_strips(tmp_path, COEFFICIENTS))
    complaint_with(("--card", *words), find_optimum, project, linear_card(*moduli), "one")


def test_card_on_bound_but_for_rounding_is_taken(tmp_path):
    project = read_project(constant_strips(tmp_path))
    assert find_optimum(project, linear_card(330.0, 190.0, 4.9999), "one").best.law.E1(0.0) > 0


@pytest.mark.parametrize("command", ["profile", "plan", "bootstrap"])
def test_studies_exit_with_2_for_card_beyond_bounds(tmp_path, command):
    constant_strips(tmp_path)
    write_card(linear_card(2500.0, 190.0, 10.0), tmp_path / "far.toml")
    over = ("--over", "specimens") if command == "bootstrap" else ()
    refused = in_process(
        command, "project.toml", "--card", "far.toml", "--test", "one", *over, cwd=tmp_path, code=2
    )
    (line,) = refused.stderr.strip().splitlines()
    assert "E1 at 0 % of strain is 2500 MPa, above the bound of 2000 MPa" in line
