"""Presenter of tests that a script of the user models."""

from __future__ import annotations

from typing import Any

import numpy as np

from ...experiments.base import Findings, FittedTest
from ...experiments.forward import Simulation
from ...experiments.measured import compared
from ...experiments.own import OwnKind, PreparedOwn
from ...lazy_modules import pandas as pd
from ...presenting import KINDS
from ..presenter import PagePresenter


class OwnPresenter(PagePresenter):
    """Presenter of tests of a script: one RMS error, and a chart of every matched value."""

    def findings(self, prepared: PreparedOwn, fitted: FittedTest) -> Findings:
        """Return the RMS error and its share of the largest measured value."""
        table = self.residuals(prepared, fitted)
        unit = prepared.test.unit
        rms = np.sqrt(np.mean(table["difference"] ** 2))
        share = rms / max(table["measured"].abs().max(), 1e-300)
        words = f"RMS error {rms:.3g} {unit} ({100 * share:.2g} % of the largest value)"
        numbers = {"rms": rms, "unit": unit, "relative": share}
        return Findings(numbers, (), (words,), words, words)

    def residuals(self, prepared: PreparedOwn, fitted: FittedTest) -> pd.DataFrame:
        """Return a table with a row for each measured value and the modelled one beside it."""
        test = prepared.test
        labels = {"part": test.name, **test.places}
        return compared("value", test.measured, fitted.histories[0].load, test.unit, **labels)

    def simulate(self, *_: Any, **__: Any) -> Simulation:
        """Return an empty result, as tests of a script have no forward analyses."""
        return Simulation({"cards": {}})


KINDS.register(OwnKind, OwnPresenter())
