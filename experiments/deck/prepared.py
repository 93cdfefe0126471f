"""A deck with its data, ready to be compared: objectives, comparisons, and what a check shows."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from time import perf_counter

import numpy as np

from ...inference.comparison import Comparison
from ...inference.objective import NoiseIs
from ...materials.law import HypoelasticLaw
from ...solvers.base import Array, History
from ..base import MakeSolver, Masks, Weighting
from ..measured import LoadsObjective, PreparedParts
from . import Compared, DeckTest

#: Standard deviation of the difference of two rounded values, sqrt(1/12 + 1/12), in units of the
#: last digit.
SIGMA_OF_ROUNDED_DIFFERENCE = 6**-0.5
#: Standard deviation of a measured value as a share of the largest, unless it is given.
ASSUMED_NOISE = 0.01


class DeckObjective(LoadsObjective):
    """Residuals of one comparison of a deck: (model - measured) / (largest sqrt(n)).

    Parameters
    ----------
    rows : slice
        Place of its values among all that are read of the deck's results.
    weight : float
        Factor.
    """

    def __init__(self, compared: Compared, rows: slice, weight: float) -> None:
        self.blocks = compared.reading.blocks
        self.load = compared.load
        self.rows = rows
        self.unit = compared.unit
        self.sizes = tuple(len(block) for block in self.blocks)
        largest = float(np.abs(compared.load).max())
        noise = compared.section.noise
        self.noise_is: NoiseIs = "assumed" if noise is None else "given"
        self.least_noise = ASSUMED_NOISE * largest if noise is None else noise
        scale = np.sqrt(len(compared.load)) * largest / max(weight, 1e-300)
        self.scale = np.full(len(compared.load), scale)

    @property
    def data(self) -> tuple[Array, ...]:
        return self.measured, *self.positions

    @property
    def positions(self) -> tuple[Array, ...]:
        return self.blocks

    def compared_values(self, loads: Array) -> Array:
        return loads[self.rows]

    def rounding(self, history: History) -> float:
        """Return the RMS of rounding, of results and of data alike, as a part of e."""
        if history.load_rounding is None:
            return 0.0
        return float(
            np.linalg.norm(
                SIGMA_OF_ROUNDED_DIFFERENCE * history.load_rounding[self.rows] / self.scale
            )
        )


@dataclass(frozen=True, eq=False)
class PreparedDeck(PreparedParts):
    """A deck with its data.

    `law` is that of the fit, without coefficients, and `make_solver` makes what runs the deck.
    """

    test: DeckTest
    law: HypoelasticLaw
    make_solver: MakeSolver
    objective_is = "sum of the RMS errors of what is compared, over the largest measured value"

    @property
    def parts(self) -> Mapping[str, Mapping[str, Masks]]:
        """Return the masks that leave out each comparison, where there are several."""
        return self.masks_without_each("comparisons")

    def comparisons(
        self, make_solver: MakeSolver, weighting: Weighting, masks: Masks | None = None
    ) -> tuple[Comparison, ...]:
        """Return a comparison for each quantity that `masks` keep; all share the deck's runs."""
        test = self.test
        fitted = self.matched_parts(masks)
        solver = test.solver(make_solver, len(fitted))
        surrogate = test.surrogate(make_solver)
        rows = dict(zip(test.matched, test.model.reader.rows, strict=True))
        block_weight = weighting.of_block(len(fitted))
        comparisons = []
        for name, compared in fitted.items():
            objective = DeckObjective(compared, rows[name], block_weight * compared.section.weight)
            parts = self.part(name), test.model, solver, objective, test.parameters
            weight = compared.section.weight
            comparisons.append(Comparison(*parts, surrogate=surrogate, weight=weight))
        return tuple(comparisons)

    @property
    def seen(self) -> Sequence[str]:
        """Run the deck at its start, and return what is read, what a run takes, what moves what.

        Raise SolverFailure where it fails.
        """
        model = self.test.model
        solver = self.test.solver(self.make_solver)
        names = list(model.bounds)
        start = perf_counter()
        seconds = solver.run(model, self.law).seconds or perf_counter() - start
        unknowns = len(names) + len(self.law.form.free)
        start_words = "with a trial law" if unknowns > len(names) else "at the start"
        lines = [
            f"one run took {seconds:.2g} s; a Jacobian by differences takes up to {unknowns} more, "
            f"and a fit usually {3 * unknowns + 8} from each start"
        ]
        history, _ = solver.run_with_sensitivity(model, self.law, names)
        assert history.load_slope is not None
        widths = [upper - lower for lower, upper in model.bounds.values()]
        changes = np.abs(0.1 * history.load_slope * widths)
        for compared, rows in zip(self.test.matched.values(), model.reader.rows, strict=True):
            values = history.load[rows]
            largest = changes[rows].max(axis=0)
            effects = [f"{name} {change:.3g}" for name, change in zip(names, largest, strict=True)]
            lines.append(
                f"{compared.name}: {len(values)} values from {values.min():.4g} to "
                f"{values.max():.4g} {compared.unit} {start_words}, measured "
                f"{compared.load.min():.4g} to {compared.load.max():.4g}"
            )
            if values @ compared.load < 0:
                lines[-1] += ", of the opposite sign: reverse the model's by scale = -1"
            if effects:
                unit = f"{compared.unit}, a tenth of the bounds"
                lines[-1] += f"; moved by up to ({unit}): {', '.join(effects)}"
        return lines


def prepare_deck(test: DeckTest, law: HypoelasticLaw, make_solver: MakeSolver) -> PreparedDeck:
    """Return the test ready for a fit; InputError where template, data or program are unfit."""
    beta = np.zeros(law.form.size)
    beta[list(law.form.free)] = 1.0
    trial_law = law.with_beta(beta)
    model = test.model
    text = model.deck(trial_law).files[model.deck_name]
    for name, (lower, upper) in model.bounds.items():
        values = {**model.values, name: model.values[name] + 1e-3 * (upper - lower)}
        if replace(model, values=values).deck(trial_law).files[model.deck_name] == text:
            problem = f"{model.template} does not have it: {{{{ {name} }}}}"
            raise test.place.error(f"parameters.{name}", problem)
    prepared = PreparedDeck(test, trial_law, make_solver)
    check = test.solver(make_solver).check()
    if not check.available:
        raise test.place.error("program", check.advice)
    return prepared
