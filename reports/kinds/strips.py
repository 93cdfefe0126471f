"""Presenter of uniaxial strip tests: load over elongation of the gauge in each direction."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from types import MappingProxyType
from typing import Any

import numpy as np

from ...errors import InputError, SolverFailure
from ...experiments.base import DIRECTIONS_MISSED, UNMATCHED, Findings, FittedTest
from ...experiments.data_files import READING, Output
from ...experiments.forward import CardRun, Cards, Runs, Simulation, by_strain, strains_of
from ...experiments.measured import FittedPart, compared
from ...experiments.strips import StripsKind, StripsTest
from ...experiments.strips.data import Strip, compare_orders
from ...experiments.strips.doubts import curves_of
from ...experiments.strips.load_objective import LoadObjective
from ...experiments.strips.prepared import PreparedStrips, loads_to_match
from ...lazy_modules import pandas as pd
from ...materials.card import MaterialCard
from ...materials.forms.base import COMPONENTS
from ...materials.forms.symmetry import modulus_labels
from ...materials.law import HypoelasticLaw
from ...meshes.mesh import surface_strain
from ...meshes.strip_models import UniaxialModel
from ...notes import Note, NoteKind
from ...presenting import KINDS
from ...readers.curves import LoadCurve, cut_of
from ...solvers.base import Array, History
from ..charts import Charts, moduli_together
from ..content import Exhibit, Table
from ..maps import write_vtu
from ..presenter import PagePresenter
from ..strips import (
    StripCurves,
    load_charts,
    order_chart,
    specimen_charts,
    strip_charts,
)
from ..vega import save, saved

#: Kind of the notes on measured points that a fit did not use.
LEFT_OUT = NoteKind("points left out")
#: Kind of the notes on lateral strains that contradict the law.
POISSON = NoteKind("Poisson's ratio", weight=11)
#: Difference of Poisson's ratio from that of the law from which on it is noted.
MAX_RATIO_ERROR = 0.05
#: Mean error of the modelled loads from which on a direction counts as missed: as a share of the
#: loads, and in units of the noise of one load.
MISSED_SHARE = 0.05
MISSED_NOISE = 2.0
#: Modulus that the strip of each direction determines.
PINS = {"warp": "E1", "fill": "E2", "bias": "G12"}


def _is_off_axis(direction: str) -> bool:
    """Return whether strips of a direction, or of a comparison's name, are cut at an angle."""
    return direction.endswith(("bias", " degrees"))


def _poissons_ratio(strip: Strip) -> dict[str, float]:
    """Return Poisson's ratio by the lateral strain for result.json; nothing without it."""
    ratio = strip.poissons_ratio()
    return {} if ratio is None else {"poissons_ratio": ratio}


def _note_on_ratio(strip: Strip, nu12: float) -> Iterator[Note]:
    """Yield a note if the lateral strain of a warp strip contradicts the law's nu12."""
    ratio = strip.poissons_ratio() if strip.direction == "warp" else None
    if ratio is not None and abs(ratio - nu12) > MAX_RATIO_ERROR:
        words = f"the lateral strain of the warp strips gives nu12 = {ratio:.2f}, the law has "
        yield Note(POISSON, f"{words}{nu12:.2f}: set nu12 in [law]")


def _missed_directions(test: StripsTest, strips: Sequence[FittedPart]) -> Iterator[Note]:
    """Yield a note on the directions whose loads, as a whole, the law does not follow."""
    errors = []
    for s in strips:
        modelled = s.objective.modelled(s.history)
        square = modelled @ modelled
        error = modelled @ (modelled - s.objective.measured) / square
        noise = s.objective.least_noise / np.sqrt(square / len(modelled))
        if abs(error) > max(MISSED_SHARE, MISSED_NOISE * noise):
            is_bias = s.data.direction == "bias"
            name = f"{test.bias_angle:g} degrees" if is_bias else s.data.direction
            errors.append(f"{error:+.0%} at {name}".replace("%", " %"))
    if errors:
        words = "the law cannot follow the directions of the strips: its loads are off by "
        yield Note(DIRECTIONS_MISSED, words + ", ".join(errors))


def _unmatched(
    test: StripsTest,
    strips: Sequence[FittedPart],
    compared_with: Sequence[str],
    law: HypoelasticLaw,
) -> Iterator[Note]:
    """Yield notes on directions that a modulus needs and that no test of the fit matches."""
    directions = {cut_of(s.data.direction) for s in strips}
    for name in compared_with:
        part = name.rpartition(": ")[2]
        directions.add("bias" if _is_off_axis(part) else part)
    for direction, modulus in PINS.items():
        if direction not in directions and modulus in modulus_labels(law.form):
            words = f"no {direction} strip of {test.name} is matched: {modulus} rests on the other "
            yield Note(UNMATCHED, words + "directions")


def _warnings(
    test: StripsTest,
    strips: Sequence[FittedPart],
    compared_with: Sequence[str],
    law: HypoelasticLaw,
    reading_notes: Sequence[str],
) -> Iterator[Note]:
    """Yield notes on directions, Poisson's ratio, how files were read, and points left out."""
    yield from _unmatched(test, strips, compared_with, law)
    if all(name.startswith(f"{test.name}: ") for name in compared_with):
        for words in reading_notes:
            yield Note(READING, words)
    if sum(map(_is_off_axis, compared_with)) > 1:
        yield from _missed_directions(test, strips)
    for s in strips:
        yield from _note_on_ratio(s.data, law.nu12)
    yield from _notes_on_reading(test, strips)


def _notes_on_reading(test: StripsTest, strips: Sequence[FittedPart]) -> Iterator[Note]:
    """Yield notes on how files were read, and on points that are not matched."""
    for words in dict.fromkeys(n for s in strips for curve in s.data.curves for n in curve.notes):
        yield Note(READING, words)
    words = "points beyond the final length (or before zero) were left out"
    for s in strips:
        if test.match_by == "points" and s.data.unmatched_count:
            yield Note(LEFT_OUT, f"{s.data.unmatched_count} {words}", s.data.direction)


def misfit_table(strips: Sequence[FittedPart]) -> Table:
    """Return a table of the RMS error of each strip's load beside the scatter of the specimens.

    The errors are those of Eqs 3.4 to 3.6 of the thesis.
    """
    rows = []
    for s in strips:
        p = s.data.polynomial
        rows.append(
            [
                s.data.direction,
                s.rms,
                s.data.scatter,
                p and p.r_squared,
                p and p.rmse,
                len(s.objective.measured),
                s.history.load[-1],
            ]
        )
    header = [
        "strip",
        "RMS error, N",
        "scatter of specimens, N",
        "R² of polynomial",
        "its RMSE, N",
        "points matched",
        "load at the end, N",
    ]
    note = (
        "RMS error: root mean square of modelled less measured load; scatter: standard deviation "
        "of the measured loads about the polynomial"
    )
    return Table("Misfit by strip", header, rows, note)


#: Name, elongations, mm, and loads, N, of a modelled curve.
NamedCurve = tuple[str, Array, Array]

#: Number of places at which a polynomial, and a modulus, is drawn.
POLYNOMIAL_PLACES = 200
MODULUS_PLACES = 121


def load_panel(
    strip: Strip, models: Sequence[NamedCurve], rms: Sequence[float | None]
) -> StripCurves:
    """Return the curves of one direction for `load_charts`.

    Parameters
    ----------
    strip : Strip
        Measured data of the direction.
    models : sequence of NamedCurve
        Modelled curves, the best first.
    rms : sequence of float, N
        RMS error of each model, in the same order.
    """
    points = strip.points if strip.curves else None
    u = np.linspace(0.0, strip.elongation, POLYNOMIAL_PLACES)
    line = strip.polynomial
    curve = None if line is None else (u, line(u))
    return StripCurves(strip.direction, models, points, curve, strip.scatter, rms)


def draw_bias(model: UniaxialModel, history: History, picture: Path, vtu: Path) -> None:
    """Draw the deformed bias strip at the last load, and write it for ParaView.

    Parameters
    ----------
    model : UniaxialModel
        Model of the strip.
    history : History
        Result of its analysis.
    picture : Path
        Image file, where the colours are the shear strain.
    vtu : Path
        File for ParaView.
    """
    u = history.displacement[-1]
    mesh = model.mesh
    strain = surface_strain(mesh, u, model.warp)
    gauge = mesh.node_sets["gauge"]
    save(picture, strip_charts(mesh.points, mesh.quads, u, strain[:, 2], gauge))
    write_vtu(mesh, u, vtu, cell_data={"log_strain_1_2_12": strain})


def draw_moduli(strips: Sequence[FittedPart], fitted: FittedTest, picture: Path) -> None:
    """Draw all moduli up to the strains at the end of the strips (as in Fig. 3.8 of the thesis)."""
    ends = failure_strains(strips, fitted.valid)
    strains = np.array([np.linspace(0.0, ends[c], MODULUS_PLACES) for c in COMPONENTS.values()])
    moduli = [fitted.law.modulus(name, x) for name, x in zip(COMPONENTS, strains, strict=True)]
    save(picture, moduli_together(strains, np.array(moduli)))


def failure_strains(strips: Sequence[FittedPart], valid: Array) -> Array:
    """Return the strains at which the strips ended, as far as the moduli are fitted.

    Parameters
    ----------
    strips : sequence of FittedPart
        Fitted strips; a direction that is missing leaves `valid` as it is.
    valid : (3,) array
        Strains up to which E1, E2 and G12 are fitted, which the result does not exceed.

    Returns
    -------
    (3,) array
        Logarithmic strains along warp and fill, and the largest shear strain within the gauge of
        the bias strip.
    """
    ends = np.array(valid, dtype=float)
    shears = []
    for s in strips:
        if cut_of(s.data.direction) == "bias":
            # The largest shear of the quads between the gauge's ends.
            mesh = s.model.mesh
            strain = surface_strain(mesh, s.history.displacement[-1], s.model.warp)
            corners = mesh.points[mesh.quads][:, :, 1]
            low, high = mesh.points[mesh.node_sets["gauge"]][:, 1]
            is_in_gauge = (corners.min(axis=1) > low - 1e-9) & (corners.max(axis=1) < high + 1e-9)
            shears.append(np.abs(strain[is_in_gauge, 2]).max())
        else:
            component = 0 if s.data.direction == "warp" else 1
            ends[component] = min(ends[component], s.data.end_strain())
    ends[2] = min(ends[2], max(shears, default=np.inf))
    return ends


def draw_orders(strips: Sequence[Strip], picture: Path) -> bool:
    """Draw the errors of load polynomials over their order; return whether there were any."""
    panels = []
    for strip in strips:
        if strip.polynomial is None:
            continue
        owners = strip.specimen_of.tolist()
        specimens = owners if len(set(owners)) > 1 else None
        try:
            scores = compare_orders(
                *strip.points, through_origin=strip.through_origin, specimens=specimens
            )
        except InputError:  # too few points for the highest order, or at too few elongations
            continue
        orders, rms, left_out = map(list, zip(*scores, strict=True))
        order = strip.polynomial.order
        panels.append(order_chart(strip.direction, orders, rms, left_out, order))
    if panels:
        save(picture, Charts("orders", panels, ""))
    return bool(panels)


#: Values that a fit matches, in words, by the setting `match_by`.
MATCHED = {"polynomial": "load polynomials", "points": "measured points"}


@dataclass(frozen=True)
class SimulatedStrip:
    """Result of one strip with one card.

    Attributes
    ----------
    numbers : mapping
        Numbers for result.json.
    words : str
        Result in words for the terminal.
    error : float or None, N
        RMS error of the load over the whole curve; None where that is not known.
    """

    numbers: Mapping[str, Any]
    words: str
    error: float | None = None


class SimulatedStrips:
    """Collect tables, curves and errors of strips that are run with one card after the other.

    Parameters
    ----------
    test : StripsTest
        The test.
    out : Output
        Place of the files of the deformed bias strips.
    within_range : bool
        Whether each curve is shown only up to the end of the card's valid range.
    """

    def __init__(self, test: StripsTest, out: Output, within_range: bool) -> None:
        self.test = test
        self.out = out
        self.within_range = within_range
        self.tables: list[pd.DataFrame] = []
        self.curves: dict[str, list[NamedCurve]] = {direction: [] for direction in test.strips}
        self.rms: dict[str, list[float | None]] = {direction: [] for direction in test.strips}
        #: Largest RMS error by card, relative to the direction's largest measured load.
        self.errors: dict[str, float] = {}

    def add_card(
        self, name: str, card: MaterialCard, runs: Runs, bias_stem: str
    ) -> tuple[dict[str, Any], str]:
        """Add the results with one card; return its numbers and its line for the terminal.

        Parameters
        ----------
        name : str
            Name of the card.
        card : MaterialCard
            The card.
        runs : mapping of (str, str) to CardRun
            Results by name of the card and direction.
        bias_stem : str
            Name, without suffix, of the files of the deformed bias strip.
        """
        strips = {
            direction: self._add_strip(direction, name, card, runs[name, direction], bias_stem)
            for direction in self.test.strips
        }
        # The sum is formed only if all errors are over whole curves: others are not comparable.
        errors = [strip.error for strip in strips.values() if strip.error is not None]
        total = sum(errors) if len(errors) == len(strips) else None
        directions = {direction: strip.numbers for direction, strip in strips.items()}
        words = ", ".join(f"{direction} {strip.words}" for direction, strip in strips.items())
        errors_known = any(numbers.get("rms_N") is not None for numbers in directions.values())
        sum_words = "" if total is None else f"; sum {total:.4g} N"
        numbers = {"e_uniaxial_N": total, "directions": directions}
        return numbers, f"{name}: {'RMS ' if errors_known else ''}{words}{sum_words}"

    def _add_strip(
        self, direction: str, name: str, card: MaterialCard, run: CardRun, bias_stem: str
    ) -> SimulatedStrip:
        """Add the curve of one strip with one card; return its numbers and words."""
        history = run.outcome
        if isinstance(history, SolverFailure):
            return SimulatedStrip({"failed": history.reason}, "failed")
        model = run.model
        u = np.array(model.elongations)
        columns = {"card": name, "direction": direction, "elongation_mm": u}
        self.tables.append(pd.DataFrame({**columns, "load_N": history.load}))
        count = _count_within_range(model, card, history) if self.within_range else len(u)
        shown_to = u[count - 1] if count else 0.0
        error = None
        strip = self.test.strips[direction]
        if strip.polynomial is not None and count:
            error = rms_of_loads(self.test, strip, model, history, shown_to)
        if count:
            self.curves[direction].append((name, u[:count], history.load[:count]))
            self.rms[direction].append(error)
        if error is not None:
            relative = error / loads_to_match(self.test, strip, model)[1].max()
            self.errors[name] = max(relative, self.errors.get(name, 0.0))
        if cut_of(direction) == "bias":
            stem = bias_stem.replace("bias", direction.replace(" ", "-"))
            picture, vtu = (self.out.path(f"{stem}.{kind}") for kind in ("png", "vtu"))
            draw_bias(model, history, picture, vtu)
        end = history.load[-1]
        numbers = {
            "rms_N": error,
            "end_load_N": end,
            "shown_to_mm": shown_to,
            "strain_reached": by_strain(strains_of(history)),
        }
        words = f"load {end:.4g} N at the end"
        if error is not None:
            words = f"{error:.4g} N to {shown_to:.3g} mm"
        return SimulatedStrip(numbers, words, error if count == len(u) else None)


def simulate(
    test: StripsTest, cards: Cards, runs: Runs, out: Output, within_range: bool = False
) -> Simulation:
    """Write loads.csv, loads.png and the deformed bias strips; return the RMS errors by card.

    With `within_range` each curve is shown only up to the end of the card's valid range. Analyses
    that failed are named in the lines.
    """
    strips = SimulatedStrips(test, out, within_range)
    numbers: dict[str, Any] = {}
    lines = []
    for number, (name, card) in enumerate(cards.items(), start=1):
        bias_stem = "bias" if len(cards) == 1 else f"bias-{number}"
        numbers[name], line = strips.add_card(name, card, runs, bias_stem)
        lines.append(line)
    if strips.tables:
        out.write("loads.csv", pd.concat(strips.tables), digits=None)
    panels = [
        load_panel(strip, strips.curves[direction], strips.rms[direction])
        for direction, strip in test.strips.items()
    ]
    charts = load_charts("loads", panels, "Load over gauge elongation")
    save(out.path("loads.png"), charts)
    return Simulation({"cards": numbers}, lines, [charts], strips.errors)


def rms_of_loads(
    test: StripsTest, strip: Strip, model: UniaxialModel, history: History, end: float
) -> float | None:
    """Return the RMS error of a modelled load curve at the loads that a fit matches.

    These are the points of the specimens, or the polynomial at the increments (`match_by`).

    Parameters
    ----------
    test : StripsTest
        The test.
    strip : Strip
        Measured data of one direction.
    model : UniaxialModel
        Model of the strip.
    history : History
        Result of its analysis.
    end : float, mm
        Elongation up to which loads are compared.

    Returns
    -------
    float or None, N
        None where no load is matched up to this elongation.
    """
    elongation, measured = loads_to_match(test, strip, model)
    is_reached = elongation <= end * (1 + 1e-9)
    if not is_reached.any():
        return None
    objective = LoadObjective(model.elongations, elongation[is_reached], measured[is_reached])
    return objective.rms(history)


def _count_within_range(model: UniaxialModel, card: MaterialCard, history: History) -> int:
    """Return the number of increments before the strain leaves the card's valid range."""
    for i, u in enumerate(history.displacement):
        strain = surface_strain(model.mesh, u, model.warp)
        shear = np.abs(strain[:, 2]).max()
        reached = np.array([*strain[:, :2].max(axis=0), shear])
        if (reached > card.law.strain_range * (1 + 1e-6)).any():
            return i
    return len(history.load)


def findings(prepared: PreparedStrips, fitted: FittedTest) -> Findings:
    """Return what the best fit means for the test: RMS errors, warnings, words."""
    test = prepared.test
    strips = prepared.fitted_parts(fitted)
    total = sum(s.rms for s in strips)
    errors = [f"{s.data.direction} {s.rms:.3g}" for s in strips]
    scatters = [
        "" if s.data.scatter is None else f" (specimens scatter by {s.data.scatter:.3g})"
        for s in strips
    ]
    line = ", ".join(f"{a}{b}" for a, b in zip(errors, scatters, strict=True))
    numbers = {
        s.data.direction: {
            "rms_N": s.rms,
            "scatter_N": s.data.scatter,
            "weight": test.weights[s.data.direction],
            "matched": len(s.objective.measured),
            "gauge_length_mm": s.data.gauge_length,
            "final_length_mm": s.data.final_length,
            "end_load_N": s.history.load[-1],
            **_poissons_ratio(s.data),
        }
        for s in strips
    }
    return Findings(
        {"directions": numbers, "e_uniaxial_N": total, "matched_by": test.match_by},
        tuple(_warnings(test, strips, fitted.compared_with, fitted.law, prepared.seen)),
        (f"RMS error, N: {line}; sum {total:.4g}",),
        "RMS errors in N: " + ", ".join(f"{s.data.direction} {s.rms:.4g}" for s in strips),
        f"RMS errors in N: {', '.join(errors)}, together {total:.4g}",
    )


def fitted_loads(prepared: PreparedStrips, fitted: FittedTest) -> Charts:
    """Return charts of load over elongation, measured and modelled, and of their difference."""
    strips = prepared.fitted_parts(fitted)
    panels = [
        load_panel(s.data, [("model", np.array(s.model.elongations), s.history.load)], [s.rms])
        for s in strips
    ]
    caption = "Load over gauge elongation: measured and modelled"
    return load_charts(f"{prepared.test.name} loads", panels, caption)


def show(prepared: PreparedStrips, fitted: FittedTest, findings: Findings, out: Output) -> Exhibit:
    """Write loads.csv and the pictures of loads, bias strip, moduli and orders; return them."""
    test = prepared.test
    strips = prepared.fitted_parts(fitted)
    parts = []
    for s in strips:
        u = np.array(s.model.elongations)
        polynomial = s.data.polynomial
        columns = {
            "direction": s.data.direction,
            "elongation_mm": u,
            "engineering_strain": u / s.data.gauge_length,
            "model_N": s.history.load,
            "polynomial_N": np.nan if polynomial is None else polynomial(u),
        }
        parts.append(pd.DataFrame(columns))
    charts = fitted_loads(prepared, fitted)
    figures = []
    files = [
        out.write("loads.csv", pd.concat(parts), "load curves of the best fit", None),
        saved(out, "loads.png", charts, "picture of the load curves"),
    ]
    for s in strips:
        if cut_of(s.data.direction) == "bias":
            stem = s.data.direction.replace(" ", "-")
            picture, vtu = f"{stem}.png", f"{stem}.vtu"
            draw_bias(s.model, s.history, out.path(picture), out.path(vtu))
            caption = f"The {s.data.direction} strip at the end, and its shear"
            figures.append((out.name(picture), caption))
            files.append((out.name(vtu), f"the deformed {s.data.direction} strip, for ParaView"))
    draw_moduli(strips, fitted, out.path("failure.png"))
    caption = "Tangent moduli up to the strains at the end of each strip"
    figures.append((out.name("failure.png"), caption))
    if draw_orders([s.data for s in strips], out.path("orders.png")):
        caption = "Error of load polynomials by order, and with a specimen left out"
        figures.append((out.name("orders.png"), caption))
    standards, standard_files = show_standard(test, out)
    return Exhibit(
        facts=[("matched", MATCHED[test.match_by])],
        figures=figures,
        tables=[misfit_table(strips)],
        files=[*files, *standard_files],
        parts=[charts],
        standards=standards,
    )


#: File of the table according to EN ISO 1421.
STANDARD = "en-iso-1421.csv"
#: Width, mm, to which the standard refers forces.
PER_WIDTH = 50.0
#: Columns of its quantities, with their headings on the page.
QUANTITIES = {
    "max_force_N": "largest force, N",
    "max_force_N_per_50mm": "N/50 mm",
    "max_force_kN_per_m": "kN/m",
    "elongation_at_max_force_percent": "elongation at it, %",
}
ABOUT = ("width_mm", "gauge_length_mm", "rate_mm_per_min", "conditioning")


def standard_table(test: StripsTest) -> pd.DataFrame:
    """Return the table that a report according to EN ISO 1421 contains.

    For each direction there is a row for each specimen, then, from two specimens on, the mean,
    the standard deviation and the coefficient of variation in %.
    """
    tables = []
    for direction, strip in test.strips.items():
        table = _with_statistics(
            pd.DataFrame([_standard_row(test, strip, c) for c in strip.curves])
        )
        conditions = test.total_width, strip.gauge_length, test.rate, test.conditioning
        columns = dict(zip(ABOUT, conditions, strict=True))
        tables.append(table.assign(direction=direction, **columns))
    filled = [table for table in tables if len(table)] or [pd.DataFrame()]
    standard = pd.concat(filled, ignore_index=True)
    return standard.reindex(columns=["direction", "specimen", *QUANTITIES, *ABOUT])


def _standard_row(test: StripsTest, strip: Strip, curve: LoadCurve) -> dict[str, object]:
    """Return the row of a specimen: its name, its largest force and the elongation there."""
    top = np.argmax(curve.load)
    force = curve.load[top]
    strain = 100 * curve.elongation[top] / strip.gauge_length
    per_width = force / test.total_width
    values = force, PER_WIDTH * per_width, per_width, strain
    return {"specimen": curve.specimen, **dict(zip(QUANTITIES, values, strict=True))}


def _with_statistics(table: pd.DataFrame) -> pd.DataFrame:
    """Add rows of mean, standard deviation and coefficient of variation to a table of specimens."""
    if len(table) < 2:
        return table
    quantities = table[list(QUANTITIES)]
    mean = quantities.mean()
    deviation = quantities.std(ddof=1)
    statistics = {
        "mean": mean,
        "standard deviation": deviation,
        "coefficient of variation, %": 100 * deviation / mean,
    }
    for name, row in statistics.items():
        table.loc[len(table)] = [name, *row]
    return table


def show_standard(test: StripsTest, out: Output) -> tuple[list[Table], list[tuple[str, str]]]:
    """Write the table according to EN ISO 1421.

    Returns
    -------
    list of Table, list of (str, str)
        The table for the page, and its file with a description; empty without specimens.
    """
    standard = standard_table(test)
    if not len(standard):
        return [], []
    note = (
        "The largest force in the data: that at break where the test went so far; elongation over "
        "the gauge length. Mean, standard deviation and coefficient of variation by direction."
    )
    gauges = ", ".join(f"{d} {s.gauge_length:g}" for d, s in test.strips.items())
    rate = "not given" if test.rate is None else f"{test.rate:g} mm/min"
    note += (
        f" Width {test.total_width:g} mm; gauge {gauges} mm; rate: {rate}; conditioning: "
        f"{test.conditioning or 'not given'}."
    )
    header = ["direction", "specimen", *QUANTITIES.values()]
    rows = standard[["direction", "specimen", *QUANTITIES]].to_numpy().tolist()
    table = Table("Report after EN ISO 1421", header, rows, note, text=(1,))
    return [table], [out.write(STANDARD, standard, "forces and elongations after EN ISO 1421")]


def examine(prepared: PreparedStrips, out: Output) -> Exhibit:
    """Draw the load curves as they were read; return them and tables of the specimens."""
    strips = prepared.test.strips
    curves = {direction: curves_of(strip) for direction, strip in strips.items()}
    rows = []
    for direction, specimens in curves.items():
        for name, u, load in specimens:
            strain = np.log1p(u[-1] / strips[direction].gauge_length)
            rows.append(
                [
                    direction,
                    name or "polynomial",
                    len(load),
                    u[0],
                    u[-1],
                    100 * strain,
                    load[0],
                    load.max(),
                ]
            )
    header = [
        "direction",
        "specimen",
        "points",
        "first elongation, mm",
        "last, mm",
        "last log strain, %",
        "first load, N",
        "largest load, N",
    ]
    charts = specimen_charts(curves)
    figures = [saved(out, "curves.png", charts, "load curves as they were read")]
    tables, files = show_standard(prepared.test, out)
    as_read = Table("Load curves as read", header, rows, text=(1,))
    return Exhibit(figures=figures, tables=[*tables, as_read], files=files)


def residuals(prepared: PreparedStrips, fitted: FittedTest) -> pd.DataFrame:
    """Return a table of every matched load, N, measured and modelled, with its elongation."""
    return pd.concat(
        [
            compared(
                "load",
                s.objective.measured,
                s.objective.modelled(s.history),
                s.objective.unit,
                part=s.data.direction,
                elongation_mm=s.objective.elongation,
            )
            for s in prepared.fitted_parts(fitted)
        ],
        ignore_index=True,
    )


class StripsPresenter(PagePresenter):
    """Presenter of strip tests."""

    findings = staticmethod(findings)
    residuals = staticmethod(residuals)
    simulate = staticmethod(simulate)
    show = staticmethod(show)
    examine = staticmethod(examine)
    charts = MappingProxyType({"loads": fitted_loads})


KINDS.register(StripsKind, StripsPresenter())
