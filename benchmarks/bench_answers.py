"""Measure estimates by virtual work, and what answers cost beside an earlier version."""

import os
import subprocess
import sys
import tempfile
from dataclasses import replace
from pathlib import Path

import bench_valmex
import numpy as np
import pandas as pd
from bubblefit.materials.forms.base import COMPONENTS
from bubblefit.runs.estimate import estimate_of
from common import BENDING, EXAMPLES, ROOT, SHARED, known_project, known_setup, start_on

#: mm, of one displacement.
NOISE = 0.0, 0.01, 0.03, 0.1


def estimate(fields=100):
    """Estimate from the known solution (200 quads) with white noise, FIELDS times a level.

    Errors: median and worst over the strain reached, medians over the fields. Coverage: share of
    strains and fields at which the 95 % band holds the true modulus.
    """
    setup = known_setup(known_project())
    (prepared,) = setup.tests
    print(f"{'noise, mm':>10s}" + "".join(f"{name:>8s}, %{'worst':>8s}{'covered':>9s}"
          for name in COMPONENTS) + f"{'chi':>8s}{'cpu, s':>8s}")  # fmt: skip
    for sigma in NOISE:
        rows, chi, seconds = [], [], []
        for seed in range(fields if sigma else 1):
            random, noisy = np.random.default_rng(seed), []
            for f in prepared.fields:
                noise = sigma * random.standard_normal(f.displacement.shape)
                noisy.append(replace(f, displacement=f.displacement + noise))
            test = replace(prepared.test, noise=sigma or NOISE[2])
            found = estimate_of(
                replace(setup, tests=(replace(prepared, fields=tuple(noisy), test=test),))
            )
            rows.append(errors(found, prepared.known))
            chi.append(found.gaps[0].chi)
            seconds.append(found.seconds)
        median, worst, covered = np.array(rows).transpose(1, 0, 2)
        each = np.stack([np.median(median, axis=0), np.median(worst, axis=0), covered.mean(axis=0)])
        print(f"{sigma:10.2f}" + "".join(f"{100 * a:10.2f}{100 * b:8.1f}{100 * c:8.0f} %"
              for a, b, c in each.T) + f"{np.mean(chi):8.2f}{np.median(seconds):8.2f}",
              flush=True)  # fmt: skip


def errors(found, truth):
    """Return median and largest relative error and share inside the band, of each modulus."""
    rows = []
    for name, component in COMPONENTS.items():
        strain = np.linspace(0.0, found.best.valid[component], 61)
        true, own = truth.modulus(name, strain), found.law.modulus(name, strain)
        low, high = found.best.certainty.at(found.law, name, strain).band
        off = np.abs(own / true - 1.0)
        rows.append([np.median(off), off.max(), np.mean((low <= true) & (true <= high))])
    return np.array(rows).T


#: A process that reads a project and fits it; prints its processor time, and its children's.
FIT = """
import resource, sys
import bubblefit as bf
own = {"starts_from": "estimate"} if sys.argv[3] and hasattr(bf, "estimate") else {}
found = bf.fit(bf.read_project(sys.argv[1]), jobs=1, starts=int(sys.argv[2]), **own)
found.card
own, others = (resource.getrusage(who) for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN))
print(sum(r.ru_utime + r.ru_stime for r in (own, others)), found.objective)
"""


def beside(other="../old", repeats=3, *, data=bench_valmex.DATA, long=False):
    """Fit real tests and the known solution beside the version in the folder OTHER.

    OTHER/bubblefit is a worktree of it (git worktree add). Prints seconds of processor time with
    all processes and imports, without compiling, the least of REPEATS side by side, their ratio,
    and objectives. A version without estimates starts at random. --long: 50 starts, one law of
    tests 1 to 3 and strips, and one of strips in five directions.
    """
    known = EXAMPLES / "bubble-known-solution" / "project.toml"
    with tempfile.TemporaryDirectory() as place:
        one, all_three = (Path(place) / name for name in ("one.toml", "three.toml"))
        one.write_text(real_project(data, bench_valmex.ALONE, 1))
        curves = EXAMPLES / "joint-valmex7318" / "curves.csv"
        strips = bench_valmex.STRIPS.format(curves=curves, increments=25)
        all_three.write_text(real_project(data, bench_valmex.JOINT, 1, 2, 3) + strips)
        works = [("real test 1, one random start", one, 1, ""),
                 ("real test 1, one start from the estimate", one, 1, "estimate"),
                 ("known solution, one start from the estimate", known, 1, "estimate")]  # fmt: skip
        if long:
            works += [("known solution, 50 random starts", known, 50, ""),
                      ("tests 1 to 3 and strips, one start", all_three, 1, "estimate"),
                      ("strips at five angles, one start", five_angles(place), 1, "")]  # fmt: skip
        for name, project, starts, begin in works:
            versions = str(Path(other).absolute()), str(ROOT.parent)
            seconds = {version: [] for version in versions}
            objectives = {}
            for _ in range(int(repeats)):
                for version in versions:
                    output = run_apart(version, place, FIT, str(project), str(starts), begin)
                    cpu, objectives[version] = map(float, output.split())
                    seconds[version].append(cpu)
            before, now = (np.array(seconds[version]) for version in versions)
            ratios = now / before
            print(
                f"{name}: {before.min():.2f} s, now {now.min():.2f} s,"
                f" {now.min() / before.min():.2f} of it"
                f" (turn by turn {ratios.min():.2f} to {ratios.max():.2f}); objectives "
                + ", ".join(f"{objective:.7g}" for objective in objectives.values()),
                flush=True,
            )


#: A process that analyses a bent cylinder, or a bubble of many quads, after a small one that loads
#: what is compiled; prints its processor time, its memory in GB, and a load or the apex' height.
ANALYSE = """
import resource, sys, time
import numpy as np
import bubblefit as bf
from bubblefit.meshes.bubble_model import BubbleModel
from bubblefit.meshes.cylinder_model import inflated_cylinder
from bubblefit.meshes.disk import disk_mesh
from bubblefit.solvers.membrane.solver import MembraneSolver
project, name, quads = bf.read_project(sys.argv[1]), sys.argv[2], int(sys.argv[4])
card = next(iter(project.cards.values())).card
solver = MembraneSolver(wall=sys.argv[3])
if quads:
    pressures = np.linspace(0.04, 0.36, 9)
    model, first = (BubbleModel(disk_mesh(100.0, 4 * count, "quarter"), 0.81, pressures)
                    for count in (quads, 48))
else:
    model = project.tests[name].model(card.thickness)
    first = inflated_cylinder(150.0, 0.14, card.thickness, 75.0, deflections=[4.0])
solver.run(first, card.law)
begun = time.process_time()
history = solver.run(model, card.law)
value = np.abs(history.displacement[-1]).max() if quads else history.load[-1]
memory = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 2**20
print(time.process_time() - begun, memory, value)
"""


def analyses(other="../old", repeats=3, *, quads=20_000, cylinder="150 mm, 140 kPa"):
    """Analyse a bent CYLINDER of the example, both walls, and QUADS quads, beside the folder OTHER.

    See `beside`; prints also the largest memory, and the last load or the apex' height of both.
    """
    versions = str(Path(other).absolute()), str(ROOT.parent)
    works = [(f"{cylinder}, {wall}", wall, 0) for wall in ("tension field", "stiff")]
    for name, wall, count in (*works, (f"bubble of {quads} quads", "band", quads)):
        rows = {version: [] for version in versions}
        for _ in range(int(repeats)):
            for version in versions:
                arguments = str(BENDING), cylinder, wall, str(count)
                output = run_apart(version, tempfile.gettempdir(), ANALYSE, *arguments)
                rows[version].append([float(number) for number in output.split()])
        before, now = (np.array(rows[version]).T for version in versions)
        ratios = now[0] / before[0]
        print(
            f"{name}: {before[0].min():.2f} s, now {now[0].min():.2f} s,"
            f" {now[0].min() / before[0].min():.2f} of it"
            f" (turn by turn {ratios.min():.2f} to {ratios.max():.2f}); memory"
            f" {before[1].max():.2f} and {now[1].max():.2f} GB;"
            f" {before[2, -1]:.7g} and {now[2, -1]:.7g} N or mm",
            flush=True,
        )


def run_apart(version, folder, code, *arguments):
    """Return what CODE prints in a process that imports the package in the folder VERSION.

    Compiled bytecode is kept, as with every user: without it a fifth of a start is compiling.
    """
    environment = {**os.environ, "PYTHONPATH": version}
    environment.pop("PYTHONDONTWRITEBYTECODE", None)
    done = subprocess.run(
        [sys.executable, "-c", code, *arguments],
        cwd=folder,
        env=environment,
        stdout=subprocess.PIPE,
        text=True,
    )
    return done.stdout


#: Strips of the example strips-nylon as any version reads them.
NYLON = """
[[strips]]
name = "{name}"
width = 27.0
grip_distance = 101.0
match = "points"
bias_angle = {angle:.1f}
{gauges}
data = {{ files = {{ {files} }} }}
"""


def five_angles(place):
    """Write a project of strips at 0, 30, 45, 60 and 90 degrees into PLACE; return its path."""
    table = pd.read_csv(SHARED / "strips_directions" / "strips.csv")
    for angle, rows in table.groupby("direction_deg"):
        rows.drop(columns="direction_deg").to_csv(Path(place) / f"{angle}.csv", index=False)
    law = """
[law]
form = "quadratic"
bounds = { E1 = [0.02, 1.0], E2 = [0.02, 1.0], G12 = [0.001, 0.2] }
"""
    text = 'fabric = { name = "nylon", thickness = 0.17 }\nfit = { starts = 1, seed = 1 }\n' + law
    three = {"warp": 0, "fill": 90, "bias": 45}
    for name, angles in (("3", three), ("30", {"bias": 30}), ("60", {"bias": 60})):
        files = ", ".join(f'{cut} = ["{angle}.csv"]' for cut, angle in angles.items())
        gauges = "\n".join(
            f"{cut} = {{ gauge_length = 97.0, final_length = 100.7 }}" for cut in angles
        )
        text += NYLON.format(name=name, angle=angles["bias"], files=files, gauges=gauges)
    path = Path(place) / "five.toml"
    path.write_text(text)
    return path


def real_project(data, law, *tests):
    """Return the text of a project of real tests, eleven frames and ten modes of the sheet each."""
    folder = bench_valmex.measured(data)
    pressures = pd.read_csv(folder / "grid_pressures.csv")["p_bar"]
    said = {"frames": list(bench_valmex.FEW), "elements": 112, "modes": 10, "unknowns": "",
            "metric": "", "pressures": [float(pressures[k]) for k in bench_valmex.FEW]}  # fmt: skip
    text = bench_valmex.PROJECT.format(law=law, starts=1)
    for test in tests:
        bubble = bench_valmex.BUBBLE.format(name=f"test {test}", test=test, **said)
        text += f'{bubble}folder = "{folder}"\n'
    return text


if __name__ == "__main__":
    start_on(estimate, beside, analyses)
