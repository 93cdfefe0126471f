"""Answers of a fit: whatever quotes its moduli has the digits of moduli.csv."""

import io
import json
import re

import bubblefit as bf
import numpy as np
import pandas as pd
import pytest
from bubblefit.cli.fits import modulus_lines
from bubblefit.inference.reported import BOUND_WORDS, UNKNOWN
from bubblefit.materials.exports.base import band_table
from bubblefit.project.project import read_project
from bubblefit.reports.fit_page import band_words
from bubblefit.runs.answers import answers
from bubblefit.runs.bootstrap import bootstrap
from bubblefit.runs.plan import plan
from bubblefit.runs.profile import profile
from bubblefit.wording import percent

from ..builders.projects import constant_strips, known_bubble

MODULI = ("E1", "E2", "G12")


#: Strips, of which nothing shears: G12 has the band of its bounds; a bubble with a mesh error.
PROJECTS = {"strips": constant_strips, "bubble": known_bubble}


@pytest.fixture(scope="module", params=PROJECTS)
def reported(request, tmp_path_factory):
    """The project, its fit, and the folder of the fit."""
    folder = tmp_path_factory.mktemp(request.param)
    project = read_project(PROJECTS[request.param](folder)).with_fit(jobs=1)
    fit = bf.fit(project, starts=1)
    fit.report(folder / "out")
    return project, fit, folder / "out"


@pytest.fixture(scope="module")
def table(reported):
    return pd.read_csv(reported[2] / "moduli.csv")


def at(table, name, strain, column):
    own = table[table["modulus"] == name]
    return float(np.interp(strain, own["strain"], own[column]))


def rms(table, name):
    return float(np.sqrt(np.mean(table[table["modulus"] == name]["sigma_relative"] ** 2)))


def words_of(table, name, strain, value):
    """Return what a row of the terminal's table has to say of a value, from moduli.csv."""
    lower, upper, sigma = (
        at(table, name, strain, column) for column in ("lower_MPa", "upper_MPa", "sigma_relative")
    )
    low, high = (
        "*" * (at(table, name, strain, f"at_{end}_bound") > 0.5) for end in ("lower", "upper")
    )
    known = at(table, name, strain, "determined") > 0.5
    on_bound = "*" * bool((low and value <= lower) or (high and value >= upper))
    return [
        f"{value:.4g}{on_bound}",
        percent(sigma) if known else UNKNOWN,
        f"{lower:.4g}{low} to {upper:.4g}{high}",
    ]


def test_terminal_page_json_and_card_have_digits_of_table(reported, table):
    _, fit, folder = reported
    result = json.loads((folder / "result.json").read_text())
    page = (folder / "report.html").read_text()
    card = bf.read_card(folder / "material.toml")
    lines, rows = modulus_lines(fit), answers(fit.best, fit.thickness)
    assert (BOUND_WORDS in lines) == ("*" in "".join(lines[4:-1]))
    numbers = {name: iter(result["reported"][name]) for name in MODULI}
    for line, row in zip(lines[4:], rows, strict=False):
        name, strain = row.modulus, row.strain
        words = words_of(table, name, strain, float(fit.law.modulus(name, strain)))
        assert re.split(r"\s{2,}", line.split(" % ", 1)[1].strip())[:3] == words
        assert band_words(row) in page
        known = next(numbers[name])
        assert known["strain"] == strain and known["determined"] == row.determined
        # Between the strains of the table moduli are those of the law, and bands straight.
        for key, column in (("MPa", "MPa"), ("sigma", "sigma_relative")):
            assert known[key] == pytest.approx(at(table, name, strain, column), rel=2e-3)
        for end, column in zip(known["band"], ("lower_MPa", "upper_MPa"), strict=True):
            assert end == pytest.approx(at(table, name, strain, column), rel=1e-6)
        assert known["at_lower_bound"] == (at(table, name, strain, "at_lower_bound") > 0.5)
        of_card = [float(end[0]) for end in card.certainty.band(card.law, name, [strain])]
        assert of_card == pytest.approx(known["band"], rel=1e-5)
    for name in MODULI:
        own = table[table["modulus"] == name]
        known = result["uncertainty"]["largest_relative_sigma"][name]
        assert known == pytest.approx(own["sigma_relative"].max(), rel=1e-6)
    exported = pd.read_csv(io.StringIO(band_table(card, "MPa")), comment="#")
    for row in exported.itertuples(index=False):
        name, strain, value, lower, upper = row
        assert lower <= value * (1 + 1e-8) and value <= upper * (1 + 1e-8)
        assert lower == pytest.approx(at(table, name, strain, "lower_MPa"), rel=1e-3)
        assert upper == pytest.approx(at(table, name, strain, "upper_MPa"), rel=1e-3)


def test_band_is_no_narrower_than_sigma_and_encloses_modulus(table):
    assert (table["noise_relative"] <= table["sigma_relative"] * (1 + 1e-9)).all()
    width = table["upper_MPa"] - table["lower_MPa"]
    assert (width >= 2 * table["sigma_relative"] * table["MPa"] * (1 - 1e-9)).all()
    assert (table["lower_MPa"] <= table["MPa"]).all() and (table["MPa"] <= table["upper_MPa"]).all()
    both = table["at_lower_bound"] & table["at_upper_bound"]
    expected = (table["sigma_relative"] < 1.0) & ~both
    assert (table["determined"] == expected).all()


def test_studies_quote_moduli_of_fit(reported, table):
    project, fit, _ = reported
    ranked = plan(project, fit.card, specimens=1)
    for name, words in ranked.present.words.items():
        expected = rms(table, name)
        assert ranked.present.summary[name] == pytest.approx(expected, rel=2e-3)
        assert words in (percent(expected), UNKNOWN)
        for strain, sigma in zip(
            ranked.strains[name], ranked.sigma_at_strains(ranked.present)[name], strict=True
        ):
            assert sigma == pytest.approx(at(table, name, strain, "sigma_relative"), rel=5e-3)
    over = "specimens" if "one" in fit.tests else "frames"
    again = bootstrap(project, over, 2, fit.card)
    for name, (_, of_fit) in again.sigma.items():
        assert of_fit == pytest.approx(rms(table, name), rel=2e-3)
    (line,) = [line for line in again.lines() if line.startswith("1 sigma")]
    assert f"(fit {percent(rms(table, 'E1'))})" in line
    own = again.table()
    for column, of_table in (
        ("fit_MPa", "MPa"), ("fit_lower_MPa", "lower_MPa"), ("fit_upper_MPa", "upper_MPa"),
        ("fit_sigma_relative", "sigma_relative"),
    ):  # fmt: skip
        expected = [at(table, n, s, of_table) for n, s in own[["modulus", "strain"]].to_numpy()]
        np.testing.assert_allclose(own[column], expected, rtol=5e-3)
    found = profile(project, {"E1": [], "E2": [0.01]}, fit.card)
    for one in found.profiles:
        band = [at(table, one.modulus, one.strain, c) for c in ("lower_MPa", "upper_MPa")]
        assert one.band == pytest.approx(band, rel=2e-3)
        assert one.band[0] <= one.best <= one.band[1]
        assert one.best == pytest.approx(at(table, one.modulus, one.strain, "MPa"), rel=2e-3)
        sigma = at(table, one.modulus, one.strain, "sigma_relative")
        assert one.numbers["fit_sigma_MPa"] == pytest.approx(sigma * one.best, rel=5e-3)
        assert "(the fit's band {:.4g} to {:.4g})".format(*one.band) in one.words
