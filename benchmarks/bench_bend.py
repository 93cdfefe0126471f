"""Bending on CalculiX beside the membrane: inflated state, load-deflection, cost.

Usage: bench_bend.py [SIZE [CASE ...]] [options]. SIZE: mm of an element (30 unless given); CASE:
DIAMETER/KPA (150/140 200/100 250/85 unless given). Both solvers have the same model, mesh and law
(card of Table 4.2, moduli held beyond 0.13) in increments of 4 mm, the membrane with both ends of
its band: tension field and stiff wall. Cost is CPU time on one core,
one run after the other. A solver that stops early is compared up to there. Two passes of CalculiX
to 240 mm are some ten minutes of CPU time with elements of 25 mm; the folds of the wall ask for
`21 150/90 --constant-pressure --to 168`, seven minutes.
"""

from __future__ import annotations

import argparse
import resource
import time
from dataclasses import replace

import numpy as np
from bubblefit.errors import SolverFailure
from bubblefit.materials.law import HypoelasticLaw
from bubblefit.meshes.cylinder_model import CylinderModel, InflatedModel, inflated_cylinder
from bubblefit.solvers.base import History, Solver
from bubblefit.solvers.calculix import (
    cylinder as cylinder_bending,
)
from bubblefit.solvers.calculix import (
    cylinder_results as cylinder_analysis,
)
from bubblefit.solvers.calculix.solver import CalculixSolver
from bubblefit.solvers.membrane.bending import closed_membrane_of
from bubblefit.solvers.membrane.solver import MembraneSolver
from numpy.typing import NDArray
from threadpoolctl import threadpool_limits

# Thesis Table 4.2, "solution", GPa.
TABLE_4_2 = [
    -7.96788e-3, 7.10747e-1, -1.56912e-1, 2.00439e-2,
    -1.06241e1, 1.37830e1, -9.31830e-1, 1.39437e-1,
    -4.79622e2, 2.12650e2, -2.02028e1, 8.06350e-1,
]  # fmt: skip
LAW = HypoelasticLaw(1e3 * np.array(TABLE_4_2), 0.24, [0.13, 0.13, 0.13])
THICKNESS, SIZE, CASES = 0.81, 30.0, ("150/140", "200/100", "250/85")
DEFLECTION, INCREMENT, SHOWN = 240.0, 4.0, 20.0


def main() -> None:
    asked = arguments()
    cylinder_bending.STIFFNESS = asked.contact
    if asked.constant_pressure:
        cylinder_analysis.PASSES = 1
    with threadpool_limits(1):
        # Compiled before the clock runs.
        MembraneSolver().run(inflated_cylinder(150, 0.14, THICKNESS, 60.0, deflections=[2.0]), LAW)
        for case in asked.cases or CASES:
            diameter, pressure = (float(part) for part in case.split("/"))
            shown = np.arange(SHOWN, asked.to + 0.5 * SHOWN, SHOWN)
            steps = np.arange(1, round(asked.to / asked.increment) + 1) * asked.increment
            model = inflated_cylinder(
                diameter, 1e-3 * pressure, THICKNESS, asked.size, deflections=shown.tolist()
            )
            model = replace(model, increments=np.union1d(steps, shown).tolist())
            compare(model, case, asked.contact)


def arguments() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else "")
    parser.add_argument("size", type=float, nargs="?", default=SIZE, help="mm of an element")
    parser.add_argument("cases", nargs="*", metavar="CASE", help="DIAMETER/KPA")
    parser.add_argument("--to", type=float, default=DEFLECTION, help="mm of deflection")
    parser.add_argument("--increment", type=float, default=INCREMENT, help="mm at most")
    parser.add_argument(
        "--contact", type=float, default=cylinder_bending.STIFFNESS, help="MPa/mm, both solvers"
    )
    parser.add_argument(
        "--constant-pressure", action="store_true", help="CalculiX runs once, the membrane has gas"
    )
    return parser.parse_args()


def compare(model: CylinderModel, case: str, contact: float) -> None:
    print(f"\n## {case} (mm/kPa), {len(model.mesh.quads):,} quads, contact {contact:g} MPa/mm")
    closed = closed_membrane_of(model)
    assert closed.bending is not None
    closed = replace(closed, bending=replace(closed.bending, penalty=contact))
    found = [
        run(MembraneSolver(wall="tension field"), closed),
        run(MembraneSolver(wall="stiff"), closed),
        run(CalculixSolver(), model),
    ]
    histories = [history for history, _ in found if history is not None]
    if len(histories) < len(found):
        return
    field, stiff, calculix = histories
    states = (inflated(model, stiff), inflated(model, calculix))
    print("\n| inflated | stiff wall | CalculiX | difference, % |\n|---|---|---|---|")
    for (name, ours), theirs in zip(states[0].items(), states[1].values(), strict=True):
        print(f"| {name} | {ours:.6g} | {theirs:.6g} | {percent(ours, theirs):+.3f} |")
    heads = ("deflection, mm", "tension field, N", "stiff wall, N", "CalculiX, N",
             "tension field over CalculiX, %", "stiff wall over it, %")  # fmt: skip
    print(f"\n| {' | '.join(heads)} |\n|{'---|' * len(heads)}")
    loads = [load_at(model, history) for history in histories]
    off = [percent(ours, loads[-1]) for ours in loads[:-1]]
    for row in zip(model.deflections, *loads, *off, strict=True):
        words = "| {:g} | {:.1f} | {:.1f} | {:.1f} | {:+.2f} | {:+.2f} |".format(*row)
        print(words.replace("+nan", "-"))
    rises = [1e3 * (np.ptp(h.cavity_pressure)) for h in (field, stiff, calculix)]
    print("\npressure rises by {:.3f}, {:.3f} and {:.3f} kPa at most".format(*rises))
    spent = [seconds for _, seconds in found]
    print(f"cost: CalculiX {spent[2]:.1f} s, {spent[2] / spent[1]:.1f} times {spent[1]:.1f} s")


def run(solver: Solver, model: CylinderModel | InflatedModel) -> tuple[History | None, float]:
    """History, if any, and s of CPU time, that of a subprocess included."""
    begun = processor_seconds()
    try:
        history = solver.run(model, LAW)
    except SolverFailure as failure:
        print(f"{solver.name}: {failure.reason}")
        return None, processor_seconds() - begun
    spent = processor_seconds() - begun
    balance = np.abs(sum(history.reactions.values())).max()
    print(f"{solver.name}: {'; '.join(history.remarks)}; collar and supports: {balance:.1g} N left")
    return history, spent


def processor_seconds() -> float:
    children = resource.getrusage(resource.RUSAGE_CHILDREN)
    return time.process_time() + children.ru_utime + children.ru_stime


def inflated(model: CylinderModel, history: History) -> dict[str, float]:
    """Radius and length of the tube along its side, and its volume, before bending."""
    side = model.mesh.node_sets["side_line"]
    at = model.mesh.points[side] + history.displacement[0, side]
    assert history.cavity_volume is not None
    volume = 1e-6 * float(history.cavity_volume[0])
    return {"radius, mm": at[0, 0], "length, mm": 2 * at[:, 2].max(), "volume, l": volume}


def load_at(model: CylinderModel, history: History) -> NDArray[np.float64]:
    """N at the deflections shown; NaN where the run did not get."""
    found = np.full(len(model.deflections), np.nan)
    found[: len(history.load) - 1] = history.load[1:]
    return found


def percent(ours, theirs):  # type: ignore[no-untyped-def]
    return 100 * (ours / theirs - 1)


if __name__ == "__main__":
    main()
