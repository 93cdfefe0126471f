"""Unknowns beside the law in a project: units, and what is refused."""

import pytest
from bubblefit.errors import InputError
from bubblefit.runs.law_setup import shared_unknowns

from ..builders.projects import fit_setup
from ..builders.unknowns import project


def test_unknown_thickness_is_in_units_of_file(tmp_path):
    pull = "{ gauge_length = %s, final_length = %s }"
    said = project(
        tmp_path, "thickness = { bounds = [7e-4, 9e-4], prior = 3e-5 }",
        ('modulus = "GPa"', 'modulus = "GPa"\nlength = "m"'),
        ("thickness = 0.8", "thickness = 8e-4"),
        (f"warp = {pull % (20, 22.9)}", f"warp = {pull % (0.02, 0.0229)}"),
        (f"fill = {pull % (20, 22.9)}", f"fill = {pull % (0.02, 0.0229)}"),
        (f"warp = {pull % (20, 22.5)}", f"warp = {pull % (0.02, 0.0225)}"),
    )  # fmt: skip
    (thickness,) = shared_unknowns(said)
    assert (thickness.lower, thickness.upper) == pytest.approx((0.7, 0.9))
    assert (thickness.start, thickness.prior) == pytest.approx((0.8, 0.03))


def test_memory_is_none_given_or_fitted_for_each_strain(tmp_path):
    memory = '[law.memory]\nwarp = "fitted"\nfill = { unloading = 1.2, permanent_set = 0.1 }\n'
    read = project(tmp_path, "nu12 = {}", ("[law.bounds]", f"{memory}[law.bounds]"))
    law = fit_setup(read).law
    assert law.memory.permanent_set == (0.3, 0.1, 0.0)
    assert law.memory.unloading == (1.4, 1.2, 1.0)
    assert law.memory.reloading == (1.15, 1.0, 1.0)
    assert law.memory.saturation == (1.0, 0.0, 0.0)


@pytest.mark.parametrize(
    ("unknowns", "key", "words"),
    [
        ("nu12 = { bounds = [0.3, 0.1] }", "nu12.bounds", "least"),
        ("nu12 = { bounds = [-0.1, 0.3] }", "nu12.bounds", "below 1"),
        ("nu12 = { bounds = [0.0, 1.0] }", "nu12.bounds", "below 1"),
        ("thickness = { bounds = [0.0, 1.0], prior = 1.0 }", "thickness.bounds", "above"),
        ("thickness = { bounds = [0.9, 1.0], prior = 1.0 }", "thickness.bounds", "around 0.8"),
        ("thickness = {}", "thickness.prior", "missing"),
        ("thickness = { prior = 0.0 }", "thickness.prior", "greater than 0"),
        ("nu21 = {}", "nu21", "nu12, thickness"),
    ],
)
def test_impossible_unknowns_are_refused_by_field(tmp_path, unknowns, key, words):
    with pytest.raises(InputError) as told:
        own = project(tmp_path, unknowns)
        fit_setup(own)
    assert told.value.field == f"fit.unknowns.{key}"
    assert words in told.value.problem
