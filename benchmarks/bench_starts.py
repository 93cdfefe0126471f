"""Where starts begin: random ones, a Sobol sequence, and starts that earlier evaluations propose.

What counts is how many analyses it takes, on average, until a start ends in the best optimum known:
all analyses over the number of starts that end there (their objective is within 1 % of the least,
or below the tolerance). All ways side by side on the same problem, from the same seeds.

The problem is the example with a known solution on 48 quads, which Levenberg-Marquardt solves from
every start: what better starts can save are analyses.

Proposals come from the evaluations of five random starts of another seed: of the same data, and of
data of another fabric (the known moduli times 1.3).

Usage: bench_starts.py [STARTS] [SEEDS]: 12 starts of each way and seed, 2 seeds.
"""

from __future__ import annotations

import sys
from collections.abc import Iterable, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from bubblefit.experiments.bubble.objective import FieldObjective, FieldTarget
from bubblefit.inference.problem import FitProblem
from bubblefit.inference.unknowns import ProposedStarts, RandomStarts, SobolStarts, Starts
from bubblefit.runs.setup import FitSetup
from bubblefit.runs.starts import EvaluationRecord, StartRecord, run_start
from known_solution import known_project, known_setup

ELEMENTS, EARLIER_SEED, EARLIER, SAME, OTHER = 48, 99, 5, 0.01, 1.3


def main(arguments: Sequence[str]) -> None:
    starts = int(arguments[0]) if arguments else 12
    seeds = range(1, 1 + (int(arguments[1]) if len(arguments) > 1 else 2))
    setup = known_setup(known_project(ELEMENTS))
    problem = setup.problem()
    ways: dict[str, Starts] = {
        "random": RandomStarts(),
        "Sobol": SobolStarts(),
        "proposed by the same data": proposals(setup, problem),
        "proposed by another fabric": proposals(setup, another(setup, problem)),
    }
    print("| starts | analyses a start | in the best optimum | analyses until it | ratio |")
    print("|---|---|---|---|---|")
    ended = {way: run(setup, problem, own, seeds, starts) for way, own in ways.items()}
    least = min(r.objective for way in ended.values() for r in way if r.objective is not None)
    limit = max((1 + SAME) * least, setup.project.fit.tolerance)
    until: dict[str, float] = {}
    for way, records in ended.items():
        best = sum(r.objective is not None and r.objective <= limit for r in records)
        analyses = sum(record.analyses for record in records)
        until[way] = analyses / best if best else np.inf
        ratio = until[way] / until["random"]
        print(f"| {way} | {analyses / len(records):.1f} | {best} of {len(records)} | "
              f"{until[way]:.1f} | {ratio:.2f} |", flush=True)  # fmt: skip


def run(
    setup: FitSetup, problem: FitProblem, starts: Starts, seeds: Iterable[int], count: int
) -> list[StartRecord]:
    """How starts end that begin there."""
    problem.starts = starts
    return [run_start(problem, setup.options, seed, number, lambda _: None)
            for seed in seeds for number in range(count)]  # fmt: skip


def proposals(setup: FitSetup, problem: FitProblem) -> ProposedStarts:
    """What a few random starts of a problem evaluate."""
    problem.starts = RandomStarts()
    told: list[EvaluationRecord] = []
    for number in range(EARLIER):
        run_start(problem, setup.options, EARLIER_SEED, number, told.append)
    good = [record for record in told if record.objective is not None]
    return ProposedStarts(
        np.array([record.coefficients for record in good]),
        np.array([record.objective for record in good]),
    )


def another(setup: FitSetup, problem: FitProblem) -> FitProblem:
    """The same problem with the data of a fabric of other moduli."""
    (prepared,), (comparison,) = setup.tests, problem.comparisons
    known: Any = prepared.known  # type: ignore[attr-defined]
    stiffer = known.with_beta(OTHER * known.beta)
    history = comparison.solver.run(comparison.model, stiffer)
    pressures = comparison.model.pressures
    data = [FieldTarget(p, u) for p, u in zip(pressures, history.displacement, strict=True)]
    other = setup.problem()
    changed = replace(comparison, objective=FieldObjective(data))
    return FitProblem((changed,), other.law, other.unknowns)


if __name__ == "__main__":
    main(sys.argv[1:])
