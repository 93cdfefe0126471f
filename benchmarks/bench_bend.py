"""Bend inflated cylinders: CalculiX beside the membrane, coarse and fine elements, increments."""

import resource
import time
from dataclasses import replace

import bubblefit as bf
import numpy as np
from bubblefit.errors import SolverFailure
from bubblefit.experiments.cylinder.measures import initial_stiffness
from bubblefit.experiments.cylinder.test import CylinderTest
from bubblefit.materials.card import MaterialCard
from bubblefit.meshes.cylinder_model import inflated_cylinder
from bubblefit.runs.refinement import refine
from bubblefit.solvers.calculix import cylinder
from bubblefit.solvers.calculix.solver import CalculixSolver
from bubblefit.solvers.membrane.cylinder import closed_membrane_of
from bubblefit.solvers.membrane.solver import MembraneSolver
from common import BENDING, LAW_4_2, THICKNESS, start_on
from threadpoolctl import threadpool_limits

SHOWN = 20.0
#: mm of deflection: where loads are shown, and over which the stiffness is taken.
PLACES, OVER = (20.0, 40.0, 100.0, 160.0, 240.0), 20.0
#: Quads around the cylinder of this size are halved exactly.
NAME, SIZE, DEFLECTION, FRAMES = "150 mm, 140 kPa", 46.8, 120.0, 30


def calculix(
    size=30.0, *cases, to=240.0, increment=4.0,
    contact=cylinder.BENDING.stiffness, constant_pressure=False,
):  # fmt: skip
    """Compare both solvers; SIZE: mm of an element, CASE: DIAMETER/KPA, contact in MPa/mm.

    Same model, mesh and law (Table 4.2), the membrane both ends of its band; CPU time.
    `--constant-pressure`: CalculiX runs once, the membrane has gas.
    """
    cylinder.BENDING = replace(cylinder.BENDING, stiffness=contact)
    if constant_pressure:
        cylinder.GAS_PASSES = replace(cylinder.GAS_PASSES, max_passes=1)
    # Compiled before the clock runs.
    MembraneSolver().run(inflated_cylinder(150, 0.14, THICKNESS, 60.0, deflections=[2.0]), LAW_4_2)
    for case in cases or ("150/140", "200/100", "250/85"):
        diameter, pressure = (float(part) for part in case.split("/"))
        shown = np.arange(SHOWN, to + 0.5 * SHOWN, SHOWN)
        steps = np.arange(1, round(to / increment) + 1) * increment
        model = inflated_cylinder(
            diameter, 1e-3 * pressure, THICKNESS, size, deflections=shown.tolist()
        )
        compare(replace(model, increments=np.union1d(steps, shown).tolist()), case, contact)


def compare(model, case, contact):
    print(f"\n## {case} (mm/kPa), {len(model.mesh.quads):,} quads, contact {contact:g} MPa/mm")
    closed = closed_membrane_of(model)
    closed = replace(closed, bending=replace(closed.bending, penalty=contact))
    found = [
        run(MembraneSolver(wall="tension field"), closed),
        run(MembraneSolver(wall="stiff"), closed),
        run(CalculixSolver(), model),
    ]
    histories = [history for history, _ in found if history is not None]
    if len(histories) < len(found):
        return
    print("\n| inflated | stiff wall | CalculiX | difference, % |\n|---|---|---|---|")
    for name, ours, theirs in zip(
        ("radius, mm", "length, mm", "volume, l"), *(inflated(model, h) for h in histories[1:]),
        strict=True,
    ):  # fmt: skip
        print(f"| {name} | {ours:.6g} | {theirs:.6g} | {100 * (ours / theirs - 1):+.3f} |")
    print("\n| deflection, mm | tension field, N | stiff wall, N | CalculiX, N | "
          "tension field over CalculiX, % | stiff wall over it, % |")  # fmt: skip
    print("|---" * 6 + "|")
    loads = np.full((3, len(model.deflections)), np.nan)  # NaN where a run did not get
    for own, history in zip(loads, histories, strict=True):
        own[: len(history.load) - 1] = history.load[1:]
    for row in zip(model.deflections, *loads, *(100 * (loads[:2] / loads[2] - 1)), strict=True):
        words = "| {:g} | {:.1f} | {:.1f} | {:.1f} | {:+.2f} | {:+.2f} |".format(*row)
        print(words.replace("+nan", "-"))
    rises = [1e3 * np.ptp(history.cavity_pressure) for history in histories]
    print("\npressure rises by {:.3f}, {:.3f} and {:.3f} kPa at most".format(*rises))
    _, stiff, calculix = (spent for _, spent in found)
    print(f"cost: CalculiX {calculix:.1f} s, {calculix / stiff:.1f} times {stiff:.1f} s")


def run(solver, model):
    """Return the history, if any, and s of CPU time, that of a subprocess included."""
    begun = processor_seconds()
    try:
        history = solver.run(model, LAW_4_2)
    except SolverFailure as failure:
        print(f"{solver.name}: {failure.reason}")
        return None, processor_seconds() - begun
    spent = processor_seconds() - begun
    balance = np.abs(sum(history.reactions.values())).max()
    print(f"{solver.name}: {'; '.join(history.remarks)}; collar and supports: {balance:.1g} N left")
    return history, spent


def processor_seconds():
    children = resource.getrusage(resource.RUSAGE_CHILDREN)
    return time.process_time() + children.ru_utime + children.ru_stime


def inflated(model, history):
    """Return radius and length (mm) of the tube and its volume (l) before bending."""
    side = model.mesh.node_sets["side_line"]
    at = model.mesh.points[side] + history.displacement[0, side]
    return at[0, 0], 2 * at[:, 2].max(), 1e-6 * float(history.cavity_volume[0])


def elements(sizes="25,12", *cases):
    """Predict the example's cylinders (DIAMETER/KPA) with elements of SIZES mm, the last finest."""
    project = bf.read_project(BENDING)
    heads = ("cylinder, card", "mm", "quads", "N/mm", *(f"at {p:g} mm, N" for p in PLACES))
    print(f"| {' | '.join(heads)} | most off, % |\n|{'---|' * (len(heads) + 1)}")
    for case in cases or ("150/140",):
        name = "{} mm, {} kPa".format(*case.split("/"))
        for card in ("uniaxial", "bubble 1"):
            found, own = [], project.cards[card].card
            for size in sizes.split(","):
                test = project.tests[name]
                assert isinstance(test, CylinderTest)
                model = replace(test, size=float(size)).model(own.thickness)
                load = MembraneSolver().run(model, own.law).load
                found.append((model, np.array([0.0, *model.deflections])[: len(load)], load))
            for size, (model, way, load) in zip(sizes.split(","), found, strict=True):
                numbers = [initial_stiffness(way, load, OVER), *np.interp(PLACES, way, load)]
                shown = [f"{numbers[0]:.2f}", *(f"{number:.1f}" for number in numbers[1:])]
                row = [f"{name}, {card}", size, str(len(model.mesh.quads)), *shown]
                count = min(len(load), len(found[-1][2]))
                off = 100 * (load[1:count] / found[-1][2][1:count] - 1)
                at = int(np.abs(off).argmax())
                most = f"{off[at]:+.1f} at {way[at + 1]:g} mm" if off.any() else "-"
                print(f"| {' | '.join(row)} | {most} |", flush=True)


def levels(what="elements", count=2):
    """Refine `elements` or `increments` of a quarter cylinder COUNT times, to 120 mm."""
    project = bf.read_project(BENDING).with_solver("membrane", {}, ["wall=tension field"])
    deflections = tuple(map(float, np.linspace(0.0, DEFLECTION, FRAMES + 1)[1:]))
    cylinder = replace(project.tests[NAME], size=SIZE, deflections=deflections)
    card = MaterialCard(LAW_4_2, project.fabric.thickness, "Table 4.2")
    project = replace(project, tests={NAME: cylinder})
    print("\n".join(refine(project, card, NAME, what, count, coarser=0).lines()))


if __name__ == "__main__":
    with threadpool_limits(1):
        start_on(calculix, elements, levels)
