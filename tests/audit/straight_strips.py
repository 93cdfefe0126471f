"""Strips that stay straight: their sections, points, mean curves, and loads in closed form."""

import numpy as np
import pandas as pd

from .laws import DIRECTION

WIDTH = 25.0  # mm, of a strip whose width no project gives


def strip_tests(project):
    """Yield name and section of every [[strips]], defaults filled in."""
    defaults = project.get("defaults", {}).get("strips", {})
    for number, test in enumerate(project.get("strips", [])):
        section = {**defaults, **test}
        data = {**defaults.get("data", {}), **test.get("data", {})}
        usual = "strips" if len(project["strips"]) == 1 else f"strips {number + 1}"
        yield test.get("name", usual), {**section, "data": data}


def lengths(section, direction):
    """Return gauge length, final length (None where the points end it) and width (mm)."""
    own = {**section, **section.get(direction, {})}
    return own.get("gauge_length"), own.get("final_length"), own.get("width", WIDTH)


def strip_points(folder):
    """Return measured points up to the final length, by (test, direction).

    Columns specimen, elongation (mm), load (N), in the order of the elongation. Only of files with
    the columns direction, specimen, elongation and load in mm and N.
    """
    points = {}
    if folder.project_path is None:
        return points
    for name, section in strip_tests(folder.project):
        tables = []
        for file in section["data"].get("files", []):
            path = folder.project_path.parent / file
            if not path.is_file():
                continue
            table = pd.read_csv(path, comment="#")
            named = {column: column.partition(" ")[0] for column in table}
            units = {column.partition("(")[2].rstrip(")") for column in table} - {""}
            table = table.rename(columns=named)
            if {"direction", "elongation", "load"} <= set(table) and units <= {"mm", "N"}:
                tables.append(table)
        if not tables:
            continue
        table = pd.concat(tables)
        if "specimen" not in table:
            table["specimen"] = ""
        for direction, own in table.groupby("direction", sort=False):
            gauge, final, _ = lengths(section, direction)
            if gauge is None:
                continue
            end = np.inf if final is None else final - gauge
            inside = (own["elongation"] >= 0) & (own["elongation"] <= end * (1 + 1e-9))
            points[name, direction] = own[inside].sort_values("elongation", kind="stable")
    return points


def mean_curve(points, order=4):
    """Return the polynomial through the origin nearest to all points of a direction.

    points : all of them, those beyond the final length as well.
    """
    terms = points["elongation"].to_numpy()[:, None] ** np.arange(1, order + 1)
    scale = np.abs(terms).max(axis=0)
    solution, *_ = np.linalg.lstsq(terms / scale, points["load"].to_numpy(), rcond=None)
    return np.polynomial.Polynomial([0.0, *(solution / scale)])


def strip_load(card, direction, strain, width, nu12=None):
    """Return the load (N) of a straight strip at a logarithmic strain along it.

    Cauchy stress is the integral of the tangent modulus; the contraction strain follows from no
    stress across: nu12 along warp, nu12 E2/E1 along fill.
    """
    nu12 = card.nu12 if nu12 is None else nu12
    name = {"warp": "E1", "fill": "E2"}[direction]
    stress = integral(card, name, strain)
    if direction == "warp":
        contraction = nu12 * strain
    else:
        contraction = nu12 * stress / float(card.modulus("E1", 0.0))
    return width * card.thickness * np.exp(-contraction) * stress


NODES, WEIGHTS = np.polynomial.legendre.leggauss(8)


def integral(card, name, strain):
    """Return the integral of a modulus (MPa) from 0 to a strain, by Gauss' rule piece by piece."""
    end = min(card.ends[name], strain)
    pieces = card.breaks if card.form == "trilinear" else card.knots
    inner = [] if pieces is None else [e for e in pieces[DIRECTION[name]] if 0 < e < end]
    edges = np.array([0.0, *inner, end])
    half = 0.5 * np.diff(edges)[:, None]
    places = edges[:-1, None] + half * (1 + NODES)
    inside = float(np.sum(half * WEIGHTS * card.modulus(name, places))) if end > 0 else 0.0
    return inside + (strain - end) * float(card.modulus(name, end))


def strip_of(project, part):
    """Return direction, gauge length, final length and width (mm) of a part such as "one: warp".

    None where it is no straight strip whose lengths the project gives.
    """
    name, _, direction = part.partition(": ")
    for test, section in strip_tests(project):
        if test != name:
            continue
        present = [own for own in ("warp", "fill", "bias") if own in section]
        own = direction or (present[0] if len(present) == 1 else "")
        gauge, final, width = lengths(section, own)
        if own in ("warp", "fill") and None not in (gauge, final):
            return own, gauge, final, width
    return None
