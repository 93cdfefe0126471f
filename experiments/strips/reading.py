"""From a section of strips and its files to the strips of a test."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from ...data.curves import DIRECTIONS
from ...data.load_polynomials import LoadPolynomial, fit_load_polynomial, specimen_scatter
from ...data.published_polynomials import read_published_polynomials
from ...errors import InputError
from ...models.uniaxial import WIDTH
from ...reading import is_file
from ...sections import beside
from ..base import Place
from ..formats import named_format
from .files import ListedFile, listed_files, measured_curves
from .section import CurvesSection, GaugeSection, StripsSection
from .strip import Strip

#: How far beyond the last point a load polynomial may be followed, of the last elongation: a strip
#: breaks between two readings.
EXTRAPOLATED = 0.05


def read_strips(place: Place, section: StripsSection) -> dict[str, Strip]:
    """The strips of a section, by direction: those whose table or whose data are there.

    Files that are not there are done without where the place needs none and all lengths are given.

    Raises
    ------
    InputError : naming the project and the key, or the data file: no data, no gauge length, a
        final length that is not longer or beyond the data, points that settle no polynomial.
    """
    data = section.data
    if (data.polynomials is None) == (data.files is None):
        problem = "expected exactly one of 'polynomials' and 'files'"
        raise place.error("data", problem)
    folder = place.data_folder
    if folder is None:
        folder = beside(place.path.parent, data.folder)
    tables = {d: getattr(section, d) for d in DIRECTIONS if getattr(section, d) is not None}
    listed = listed_files(place, data, folder)
    missing = next((file for file in listed if not is_file(file.path)), None)
    if missing is not None:
        if place.need_data or not _complete(tables):
            problem = f"there is no file {missing.path}; --data DIR names another folder"
            raise place.error(missing.field, problem)
        length = place.scales.length
        return {
            d: _strip(place, d, t.gauge_length * length, t.final_length * length)
            for d, t in tables.items()
        }
    if data.polynomials is not None:
        strips = _published(place, data, tables, listed[0])
    else:
        width = WIDTH if section.width is None else section.width * place.scales.length
        strips = _measured(place, data, tables, listed, width)
    if not strips:
        problem = f"these data hold none of the directions {', '.join(tables or DIRECTIONS)}"
        raise place.error("data", problem)
    for direction in tables:
        if direction not in strips:
            problem = f"the data hold no {direction} test; leave this section out or add its data"
            raise place.error(direction, problem)
    return strips


def _complete(tables: Mapping[str, GaugeSection]) -> bool:
    lengths = [(t.gauge_length, t.final_length) for t in tables.values()]
    return bool(lengths) and all(a is not None and b is not None for a, b in lengths)


def _published(
    place: Place, data: CurvesSection, tables: Mapping[str, GaugeSection], file: ListedFile
) -> dict[str, Strip]:
    format = named_format(place, "data.format", "load polynomials", data.format)
    curves, length = read_published_polynomials(file.path, format), place.scales.length
    wanted = [d for d in DIRECTIONS if d in curves and (d in tables or not tables)]
    strips = {}
    for direction in wanted:
        curve, own = curves[direction], tables.get(direction) or GaugeSection()
        start = curve.gauge_length if own.gauge_length is None else own.gauge_length * length
        end = curve.final_length if own.final_length is None else own.final_length * length
        scatter = None if np.isnan(curve.scatter) else curve.scatter
        strips[direction] = _strip(
            place,
            direction,
            start,
            end,
            polynomial=curve.polynomial,
            scatter=scatter,
            published=file.path,
        )
    return strips


def _measured(
    place: Place,
    data: CurvesSection,
    tables: Mapping[str, GaugeSection],
    listed: Sequence[ListedFile],
    width: float,
) -> dict[str, Strip]:
    said = {file.direction for file in listed}
    strips = {}
    for direction, curves in measured_curves(place, data, listed, width).items():
        # A table picks among what a file holds; a file listed for a direction is meant.
        if tables and direction not in tables and direction not in said:
            continue
        own = tables.get(direction) or GaugeSection()
        if own.gauge_length is None:
            problem = "this key is missing; the strain follows from it"
            raise place.error(f"{direction}.gauge_length", problem)
        start = own.gauge_length * place.scales.length
        elongation = np.concatenate([c.elongation for c in curves])
        load = np.concatenate([c.load for c in curves])
        try:
            polynomial = fit_load_polynomial(elongation, load, data.order, data.through_origin)
            scatter = specimen_scatter(curves, polynomial).deviation
        except InputError as error:
            problem = f"no load curve through the {direction} points: {error.problem}"
            raise place.error(f"data, {error.field}", problem) from None
        end = start + polynomial.end
        if own.final_length is not None:
            end = own.final_length * place.scales.length
        strips[direction] = _strip(
            place,
            direction,
            start,
            end,
            polynomial=polynomial,
            curves=curves,
            scatter=scatter,
            through_origin=data.through_origin,
            open_end=own.final_length is None,
        )
    return strips


def _strip(
    place: Place,
    direction: str,
    start: float,
    end: float,
    polynomial: LoadPolynomial | None = None,
    **data: Any,
) -> Strip:
    field = f"{direction}.final_length"
    if not end > start:
        problem = f"expected more than the gauge length {start:g} mm, got {end:g} mm"
        raise place.error(field, problem)
    if polynomial is not None and end - start > polynomial.end * (1 + EXTRAPOLATED):
        problem = (
            f"the data end at an elongation of {polynomial.end:.5g} mm; expected up to"
            f" {start + polynomial.end:.5g} mm, got {end:g} mm"
        )
        raise place.error(field, problem)
    return Strip(direction, start, end, polynomial, **data)
