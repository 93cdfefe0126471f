"""What the runs of cylinders with cards say."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from functools import cached_property
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from ...solvers.base import BandEnd
from ..exhibit import Exhibit, Output
from ..predicted import PredictedRun, band_of
from .measures import BendingMeasures, Point, bending_measures, loads_at
from .record import BendingRun, run_of
from .tables import columns_of, curve_of, terminal_table
from .test import CylinderTest

Array = NDArray[np.float64]

FINISHED = "finished"


@dataclass(frozen=True, eq=False)
class CylinderOutcome:
    """Runs of cylinders with cards, in the order given, and what they say."""

    runs: Sequence[PredictedRun]

    @cached_property
    def bent(self) -> Mapping[int, BendingRun]:
        """The runs that did not fail, by number."""
        found = {i: run_of(run.record) for i, run in enumerate(self.runs)}
        return {i: run for i, run in found.items() if run is not None}

    @cached_property
    def measures(self) -> Mapping[int, BendingMeasures]:
        """Their numbers."""
        return {
            i: bending_measures(self.runs[i].model, run, self.runs[i].test.measured)
            for i, run in self.bent.items()
        }

    @cached_property
    def band(self) -> Sequence[BandEnd]:
        """The ends of the band that the solver gives, first what is predicted; or none."""
        return band_of(self.runs)

    def other_end(self, number: int) -> BendingRun | None:
        """Of the band of a run: with the same card in the same test, where it did not fail."""
        own = self.runs[number]
        for i, run in enumerate(self.runs):
            if run.test is own.test and run.card == own.card and not run.predicted:
                return self.bent.get(i)
        return None

    @cached_property
    def spreads(self) -> Mapping[int, Array]:
        """(frames,) N, one standard deviation of the load by what the card leaves open.

        Of the runs with laws around the card's, by number; NaN where that is not known.
        """
        found = {}
        for i, bent in self.bent.items():
            around = self.runs[i].around
            if around is not None:
                others = [run_of(record) for record in around.records]
                loads = [None if other is None else other.load for other in others]
                found[i] = around.sigma(bent.load, loads)
        return found

    def sigma(self, number: int) -> dict[str, float | None]:
        """N, of the load at each place that is read; None where it is not known."""
        own = self.spreads.get(number)
        if own is None:
            return dict.fromkeys(self.measures[number].loads)
        places = self.runs[number].test.reading.places
        known = loads_at(self.bent[number].deflection, own, places)
        return {n: v if v is not None and np.isfinite(v) else None for n, v in known.items()}

    def _around(self, number: int) -> str | None:
        """What was run around a run."""
        around = self.runs[number].around if number in self.spreads else None
        return None if around is None else around.words

    @property
    def unsure(self) -> Sequence[str]:
        """What is to be said of cards of which no spread is known."""
        cards = [run.card for run in self.runs if run.material.certainty is None]
        names = ", ".join(dict.fromkeys(cards))
        return [f"no spread of loads with {names}: the card does not say how sure it is"] * bool(
            names
        )

    def ended(self, number: int) -> str:
        """How a run ended: "finished", how far it came, or why it failed."""
        record = self.runs[number].record
        if record.failure:
            return f"failed: {record.failure}"
        if not record.early:
            return FINISHED
        whole, reached = self.runs[number].test.deflections[-1], self.bent[number].deflection[-1]
        return f"stopped at {reached:g} of {whole:g} mm: {record.early}"

    def error(self, number: int) -> float | None:
        """RMS of model less reading over the largest load read; None where there is none."""
        measures = self.measures.get(number)
        return None if measures is None or measures.error is None else measures.error.relative

    def numbers(self, number: int) -> Mapping[str, Any]:
        """Of a run that did not fail, for result.json."""
        m = self.measures[number]
        names = ("warp", "fill")
        return {
            "reached_mm": m.reached,
            "stiffness_N_per_mm": m.stiffness,
            "buckling": {"is": m.buckling_is, **_point(m.buckling)},
            "knee": _point(m.knee),
            "limit_point": _point(m.limit),
            "wrinkle_onset": _point(m.wrinkles),
            "load_N": dict(m.loads),
            "load_sigma_N": self.sigma(number),
            "spread": self._around(number),
            "inflation_strain": {
                "body": dict(zip(names, m.body_strain, strict=True)),
                "with_seam_and_ends": dict(zip(names, m.anywhere_strain, strict=True)),
            },
            "straight_before_buckling": None
            if m.straightness is None
            else {"r_squared": m.straightness[0], "largest_deviation": m.straightness[1]},
            "pressure_rise_kPa": m.pressure_rise,
            "error": None if m.error is None else asdict(m.error),
        }

    def columns(self, number: int) -> Mapping[str, object]:
        """A row of the table of runs."""
        places = self.runs[number].test.reading.places
        row = dict(columns_of(self.measures.get(number), tuple(places)))
        if number in self.spreads:
            sigma = self.sigma(number)
            row |= {f"load_at_{p.replace(' ', '_')}_sigma_N": sigma[p] for p in places}
        return row

    def curve(self, number: int) -> pd.DataFrame:
        """Frame by frame: deflection, load, gauge pressure, volume, wrinkled share."""
        curve = curve_of(self.bent.get(number))
        if number in self.spreads:
            curve["load_sigma_N"] = self.spreads[number]
        return curve

    def test_numbers(self, test: CylinderTest) -> Mapping[str, Any]:
        """What a cylinder is, for result.json."""
        return {
            "diameter_mm": test.diameter,
            "pressure_kPa": 1e3 * test.pressure,
            "length_mm": test.length,
            "seam_width_mm": test.seam_width,
            "element_size_mm": test.size,
            "symmetry": test.symmetry,
            "supports": asdict(test.supports),
            "collar": asdict(test.collar),
            "places_mm": dict(test.reading.places),
            "slope_over_mm": test.reading.slope_over,
            "repetitions": len(test.measured),
        }

    def lines(self) -> Sequence[str]:
        """A table for the terminal."""
        ended = [self.ended(i) for i in range(len(self.runs))]
        sigma = {i: self.sigma(i) for i in self.spreads}
        return [*terminal_table(self.runs, self.measures, ended, sigma), *self.unsure]

    def show(self, out: Output) -> Exhibit:
        """Write figures, tables and beams."""
        from .page import exhibit

        return exhibit(self, out)


def _point(point: Point | None) -> dict[str, float | None]:
    return {"deflection_mm": point[0] if point else None, "load_N": point[1] if point else None}
