"""Compare CalculiX with the membrane: cost, fits, fields, strips, tolerances, faces of bodies."""

from dataclasses import replace

import numpy as np
from bubblefit.errors import SolverFailure
from bubblefit.inference.methods import FitOptions
from bubblefit.inference.reported import moduli_error
from bubblefit.materials.law import HypoelasticLaw
from bubblefit.meshes.bubble_model import BubbleModel
from bubblefit.meshes.cylinder_model import inflated_cylinder
from bubblefit.meshes.disk import disk_mesh
from bubblefit.meshes.strip_models import bias_strip, straight_strip
from bubblefit.runs.starts import run_start
from bubblefit.solvers import prescribed
from bubblefit.solvers.calculix import sheets
from bubblefit.solvers.calculix.solver import CalculixSolver
from bubblefit.solvers.membrane.solver import MembraneSolver
from common import (
    LAW_3_2,
    LAW_4_2,
    THICKNESS,
    known_model_and_law,
    known_project,
    known_setup,
    objectives_of,
    seconds,
    start_on,
)
from threadpoolctl import threadpool_limits

METHODS = (("lm", "led by the membrane"), ("slsqp", "differences"), ("cobyla", "no derivatives"))
LINEAR = HypoelasticLaw.linear(800.0, 400.0, 20.0)
COARSE, LEVELS = 192, (1e-2, 1e-3, 1e-4)
QUADS = {"S8R": (48, 108, 192, 432), "S4": (48, 192, 432, 768)}
#: mm, Table 3.1.
WARP, FILL, BIAS, FINE = (20.022, 23.329), (22.780, 28.721), (19.767, 30.734), 3
#: Tolerances of force and correction, the tightest first.
OF_BUBBLE = ((1e-10, 1e-9), (1e-8, 1e-7), (1e-7, 1e-6), (1e-6, 1e-5), (5e-3, 1e-2))
OF_STRIP = ((1e-7, 1e-6), (1e-5, 1e-4), (1e-4, 1e-3), (1e-3, 1e-2))
#: Faces around a support and around the quarter of a collar, along its fillet; how it is placed.
BODIES = ((96, 96, 32, "faces"), (48, 24, 6, "faces"), (24, 12, 4, "faces"), (24, 12, 4, "ring"))


def cost():
    """Print the seconds of one analysis of a bubble of 200 quads on both solvers."""
    model, known = known_model_and_law()
    print(f"{len(model.mesh.quads)} quads, {len(model.increments)} increments of the law, one core")
    for name, law in {"cubic (Table 4.2)": known, "linear": LINEAR}.items():
        for element in ("S8R", "S4"):
            solvers = ((MembraneSolver(), 10), (CalculixSolver(element=element), 2))
            try:
                inside, outside = (
                    min(seconds(lambda s=s, law=law: s.run(model, law)) for _ in range(turns))
                    for s, turns in solvers
                )
            except SolverFailure as failure:  # S4, cubic card: docs/how-to/calculix.md
                print(f"{name:18s} {element:4s} {failure.reason}")
                continue
            ratio = f"{outside / inside:4.0f} times {1e3 * inside:.1f} ms"
            print(f"{name:18s} {element:4s} CalculiX {outside:6.2f} s, {ratio}", flush=True)


def fits(runs=60):
    """Fit CalculiX' own data, led by the membrane and by NLopt alone, stopped after RUNS runs."""
    setup = known_setup(known_project(COARSE, solver="calculix"))
    problem, known = setup.problem(), setup.tests[0].known
    quads = len(problem.comparisons[0].model.mesh.quads)
    print(f"fits to CalculiX' own data, {quads} quads, start 0: runs until e is below")
    ends = f"{'runs':>7s}{'wall, s':>9s}{'e':>10s}{'E1, %':>8s}{'E2, %':>8s}{'G12, %':>8s}"
    print(f"{'':28s}{''.join(f'{level:9g}' for level in LEVELS)}{ends}")
    for method, words in METHODS:
        options = FitOptions(method, max_analyses=100 if method == "lm" else runs)
        heard, records = [], []
        hear = objectives_of("calculix", heard)
        wall = seconds(
            lambda options=options, hear=hear, records=records: records.append(
                run_start(problem, options, 1, 0, hear)
            )
        )
        (record,) = records
        firsts = [next((i + 1 for i, e in enumerate(heard) if e < level), "-") for level in LEVELS]
        beta = problem.unknowns.beta(np.array(record.unknowns))
        error = moduli_error(known.with_beta(beta), known, np.full(3, 0.1))
        print(f"{f'{method}, {words}':28s}{''.join(f'{first:>9}' for first in firsts)}"
              f"{record.external_runs:7d}{wall:9.0f}{record.objective:10.1e}"
              + "".join(f"{100 * error[name]:8.2g}" for name in ("E1", "E2", "G12")),
              flush=True)  # fmt: skip


def starts(count=1):
    """Fit the known solution on 48 S8R shells from COUNT random starts; print e run by run."""
    setup = known_setup(known_project(COARSE, solver="calculix"))
    problem, known = setup.problem(), setup.tests[0].known
    reached = MembraneSolver().run(problem.comparisons[0].model, known).strain_max
    for number in range(count):
        heard = []
        options, hear = FitOptions("lm", max_analyses=100), objectives_of("calculix", heard)
        record = run_start(problem, options, 1, number, hear)
        law = known.with_beta(problem.unknowns.beta(np.array(record.unknowns)))
        error = 100 * max(moduli_error(law, known, reached).values())
        runs = ", ".join(f"{e:.1e}" for e in heard)
        print(f"start {number}: e = {runs}; moduli within {error:.1g} %", flush=True)


def mesh(finest=192):
    """Print the largest differences of bubbles of up to FINEST quads, % of the apex height."""
    base, known = known_model_and_law()
    heads = "".join(f"{1e3 * p:7.0f}" for p in base.pressures)
    print(f"{'law':20s}{'element':8s}{'quads':>6s}{heads} kPa   apex at 132 kPa, mm")
    for name, law in {"Table 4.2": known, "linear 800, 400, 20": LINEAR}.items():
        for element, counts in QUADS.items():
            for quads in (n for n in counts if n <= finest):
                row = mesh_row(base, law, element, quads)
                print(f"{name:20s}{element:8s}{quads:6d}{row}", flush=True)


def mesh_row(base, law, element, quads):
    """Return the differences, without the last pressures where CalculiX stops before them."""
    disk = disk_mesh(100.0, 4 * quads, "quarter")
    apex = disk.node_sets["apex"][0]
    for last in range(len(base.pressures), 0, -1):
        pressures = base.pressures[:last]
        steps = [p for p in base.increments if p <= pressures[-1]]
        model = BubbleModel(disk, base.thickness, pressures, steps)
        try:
            found = CalculixSolver(element=element).run(model, law).displacement
            break
        except SolverFailure as failure:
            print(f"to {1e3 * pressures[-1]:.0f} kPa: {failure.reason}")
    else:
        return "  -"
    expected = MembraneSolver().run(model, law).displacement
    off = 100 * np.abs(found - expected).max(axis=(1, 2)) / expected[:, apex, 2]
    height = float(np.interp(0.132, pressures, found[:, apex, 2]))
    missing = "      -" * (len(base.pressures) - last)
    return "".join(f"{value:7.2f}" for value in off) + missing + f"       {height:.3f}"


def bias(increments, refined):
    counts = {"across": 10 * refined, "along": 30 * refined}
    return bias_strip(*BIAS, THICKNESS, increments=increments, **counts)


def strips(finest=2):
    """Compare the three strips, the bias strip on meshes refined up to FINEST times."""
    print("differences in % of the end load, largest on the curve: from the membrane on the same\n"
          f"mesh, and on {300 * FINE**2} quads\nstrip element   quads incr.     same     fine"
          "    end, N  iter.  CalculiX   membrane  ratio")  # fmt: skip
    MembraneSolver().run(bias(2, 1), LAW_3_2)  # compiles
    for element in ("S8R", "S4"):
        strip_row("warp", element, straight_strip("warp", *WARP, THICKNESS))
        strip_row("fill", element, straight_strip("fill", *FILL, THICKNESS))
        strip_row("bias", element, bias(100, 1))
    fine = MembraneSolver().run(bias(20, FINE), LAW_3_2).load
    for element in ("S8R", "S4"):
        for refined in range(1, finest + 1):
            strip_row("bias", element, bias(20, refined), fine)


def strip_row(name, element, model, fine=None):
    done = []
    membrane, calculix = (
        seconds(lambda solver=solver: done.append(solver.run(model, LAW_3_2)))
        for solver in (MembraneSolver(), CalculixSolver(element=element))
    )
    inside, outside = done

    def off(load):
        return f"{100 * np.abs(outside.load - load).max() / load[-1]:9.2g}"

    print(f"{name:6s}{element:9s}{len(model.mesh.quads):6d}{len(model.elongations):6d}"
          f"{off(inside.load)}{'' if fine is None else off(fine):>9s}{outside.load[-1]:10.2f}"
          f"{outside.iterations:7d}{calculix:8.1f} s{1e3 * membrane:8.0f} ms"
          f"{calculix / membrane:7.0f}", flush=True)  # fmt: skip


def tolerances(models="bubble"):
    """Print what looser tolerances cost and save on the bubble (`all`: and on the bias strip)."""
    base, known = known_model_and_law()
    disk = disk_mesh(100.0, 192, "quarter")
    model = BubbleModel(disk, base.thickness, base.pressures, base.increments)
    cases = [("bubble, 48 S8R", "TOLERANCES", OF_BUBBLE, "mm", "S8R", model, known)]
    if models == "all":
        strip = ("bias strip, 300 S4", "TOLERANCES_STRIP", OF_STRIP, "of the end load", "S4")
        cases.append((*strip, bias(100, 1), LAW_3_2))
    for what, name, pairs, unit, element, model, law in cases:
        shipped, exact = getattr(sheets, name), None
        for pair in pairs:
            setattr(sheets, name, pair)
            found = CalculixSolver(element=element).run(model, law)
            exact = exact or found
            if unit == "mm":
                apart = np.abs(found.displacement - exact.displacement).max()
            else:
                apart = np.abs(found.load - exact.load).max() / exact.load[-1]
            mark = "  (ours)" if pair == shipped else ""
            print(f"{what}: {pair[0]:g}, {pair[1]:g}: {apart:.1e} {unit}, "
                  f"{found.iterations} iterations{mark}", flush=True)  # fmt: skip
        setattr(sheets, name, shipped)


def collar(size=60.0):
    """Bend a cylinder by collars and on supports of few and many faces; SIZE: mm of an element."""
    model = inflated_cylinder(150.0, 0.14, THICKNESS, size, deflections=(10.0, 20.0))
    radius = 0.5 * model.collar.inner_diameter

    def way_of_ring(faces, points):
        near = points[(points[:, 1] > 0) & (points[:, 2] <= 0.5 * model.collar.length)]
        return float((np.sqrt(radius**2 - near[:, 0] ** 2) - near[:, 1]).min())

    ours, best, usual = prescribed.way_down, None, prescribed.CONTACT
    print("| support | collar | fillet | placed by | 10 mm, N | 20 mm, N | off round, % |")
    print("|---" * 7 + "|")
    for support, around, fillet, placed in BODIES:
        prescribed.CONTACT = replace(
            usual,
            support_counts=(support, usual.support_counts[1]),
            collar_counts=(around, usual.collar_counts[1]),
            fillet_count=fillet,
        )
        prescribed.way_down = ours if placed == "faces" else way_of_ring
        load = CalculixSolver().run(model, LAW_4_2).load[1:]
        best = load if best is None else best
        off = " ".join(f"{value:+.2f}" for value in 100 * (load / best - 1))
        loads = " | ".join(f"{value:.2f}" for value in load)
        print(f"| {support} | {around} | {fillet} | its {placed} | {loads} | {off} |", flush=True)


if __name__ == "__main__":
    with threadpool_limits(1):
        start_on(cost, fits, starts, mesh, strips, tolerances, collar)
