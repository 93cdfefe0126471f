"""Fit the three measured bubble tests of VALMEX 7318, in shared/data/bubble unless --data."""

import sys
import tempfile
from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
from bubblefit.experiments.base import Weighting
from bubblefit.experiments.bubble.findings import fitted_model
from bubblefit.meshes.sampling import sampling_matrix
from bubblefit.project.project import read_project
from bubblefit.runs.compare import best_of
from bubblefit.runs.fit import fit
from bubblefit.runs.held_out import held_out
from bubblefit.runs.setup import FitSetup
from common import EXAMPLES, SHARED, known_setup, start_on

DATA = str(SHARED / "bubble")
#: Published residuals, mm: linear orthotropic moduli, Abaqus; and one that was predicted.
PUBLISHED, PUBLISHED_PREDICTED = {1: 1.55, 2: 1.66, 3: 1.70}, 1.86
VARIANTS = (
    ("linear", {}), ("linear", {"pressure_offset": True}),
    ("linear", {"displacement_offset": True}), ("cubic", {}), ("cubic", {"pressure_offset": True}),
)  # fmt: skip
#: Sign of each displacement under x -> -x and under y -> -y.
PARITY = {"dx": (-1, 1), "dy": (1, -1), "dz": (1, 1)}
#: Eleven of the twenty frames, evenly spread and the last; strain at which moduli are shown.
FEW, STRAIN = (0, 2, 4, 6, 8, 10, 12, 14, 16, 18, 19), 0.06
PROJECT = """\
fabric = {{ name = "VALMEX 7318", thickness = 0.81, thickness_change = "incompressible" }}
units = {{ modulus = "GPa", pressure = "bar" }}
fit = {{ starts = {starts}, seed = 1, jobs = 1, max_analyses = 80 }}
[law]
bounds = {{ E1 = [0.01, 3.0], E2 = [0.01, 2.0], G12 = [0.0005, 0.2] }}
{law}
"""
BUBBLE = """
[[bubble]]
name = "{name}"
radius = 100.0
pressures = {pressures}
elements = {elements}
objective = "mm"
sheet = {{ modes = {modes}{metric} }}
{unknowns}
[bubble.data.points]
pattern = "grid/test{test}_{{index:02d}}.csv"
indices = {frames}
flag_column = "flag"
"""
STRIPS = """
[[strips]]
name = "strips"
width = 25.0
grip_distance = 75.0
increments = {increments}
data = {{ polynomials = "{curves}" }}
"""
ALONE = 'form = "quadratic"\nstrain_range = [0.13, 0.13, 0.13]'
JOINT = """\
form = "spline"
strain_range = [0.18, 0.232, 0.883]
knots = { warp = [0.0, 0.03, 0.06, 0.12, 0.18], fill = [0.0, 0.03, 0.06, 0.12, 0.232],\
 shear = [0.0, 0.1, 0.3, 0.6, 0.883] }"""


def project(
    law, tests, data, frames, elements, modes, starts, strip_increments, unknowns="", metric=0
):  # fmt: skip
    """Return a project of measured tests by name and, unless 0, of the published strips."""
    table = pd.read_csv(data / "grid_pressures.csv")
    said = {"pressures": [float(table["p_bar"][k]) for k in frames], "frames": list(frames)}
    said |= {"elements": elements, "modes": modes, "unknowns": unknowns,
             "metric": f", metric = {metric}" * bool(metric)}  # fmt: skip
    text = PROJECT.format(law=law, starts=starts)
    text += "".join(BUBBLE.format(name=name, test=test, **said) for name, test in tests.items())
    if strip_increments:
        curves = EXAMPLES / "joint-valmex7318" / "curves.csv"
        text += STRIPS.format(curves=curves, increments=strip_increments)
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "project.toml"
        path.write_text(text)
        return read_project(path, data=dict.fromkeys(tests, data))


def measured(data):
    """Return the folder of measured data; end the script where it is not there."""
    folder = Path(data)
    if not (folder / "grid").is_dir():
        print(f"skipped: no measured data in {folder}")
        sys.exit()
    return folder


def residuals(starts=2, *tests, data=DATA):
    """Print mean |dx| + |dy| + |dz| (mm) of fits with and without offsets, and their moduli."""
    folder = measured(data)
    print(f"{'test':>4s}  {'moduli':6s}  {'nuisance':45s}{'mean, mm':>9s}{'published':>11s}"
          f"{'E1, MPa':>9s}{'E2, MPa':>9s}{'G12, MPa':>10s}")  # fmt: skip
    for test in map(int, tests or PUBLISHED):
        for kind, nuisance in VARIANTS:
            path = EXAMPLES / "bubble-valmex7318" / f"test{test}-{kind}.toml"
            own = read_project(path, folder)
            changed = {name: replace(one, **nuisance) for name, one in own.tests.items()}
            found = fit(replace(own, tests=changed), starts=starts)
            took = {k: v for k, v in found.result["nuisance"].items() if v is not None}
            words = ", ".join(f"{k} {np.round(v, 2)}" for k, v in took.items()) or "none"
            law, mean = found.law, found.result["mean_abs_mm"]
            at_rest = "".join(f"{float(m(0.0)):9.1f}" for m in (law.E1, law.E2, law.G12))
            print(f"{test:4d}  {kind:6s}  {words:45s}{mean:9.2f}{PUBLISHED[test]:11.2f}{at_rest}",
                  flush=True)  # fmt: skip


def symmetry(*, data=DATA):
    """Print how far the tests are from any doubly symmetric model, which is the fits' floor."""
    folder = measured(data)
    print("test  floor, mm  left and right, mm  top and bottom, mm  first picture, mm")
    for test in PUBLISHED:
        frames = []
        for k in range(20):
            frame = pd.read_csv(folder / "grid" / f"test{test}_{k:02d}.csv", comment="#")
            frames.append(frame[(frame.flag == 0) & (np.hypot(frame.x, frame.y) <= 100.0)])
        left = np.mean(np.concatenate([unsymmetric(frame) for frame in frames]))
        gaps = [np.mean(np.concatenate([mirrored(f, axis) for f in frames])) for axis in "xy"]
        middle = float(frames[0].dz[np.hypot(frames[0].x, frames[0].y) < 1.0].mean())
        print(f"{test:4d}{left:11.2f}{gaps[0]:20.2f}{gaps[1]:20.2f}{middle:19.1f}")


def unsymmetric(frame):
    """Return (points,) |dx| + |dy| + |dz| from the nearest doubly symmetric field."""
    cells = frame[["x", "y"]].abs().round(1)
    groups = [cells["x"], cells["y"]]
    total = np.zeros(len(frame))
    for name, parities in PARITY.items():
        sign = np.ones(len(frame))
        for axis, parity in zip("xy", parities, strict=True):
            # On a plane of symmetry what is odd across it is zero.
            sign *= np.sign(frame[axis].round(1)) if parity < 0 else 1.0
        folded = frame[name] * sign
        off = (folded - folded.groupby(groups).transform("median")).abs()
        total += off.where(sign != 0, frame[name].abs())
    return total


def mirrored(frame, axis):
    """Return (pairs,) |dz - dz of the mirror image across the plane `axis` = 0|."""
    here = frame.assign(x=frame.x.round(1), y=frame.y.round(1))
    both = here.merge(here.assign(**{axis: -here[axis]}), on=["x", "y"])
    return (both.dz_x - both.dz_y).abs().to_numpy()


def sheets(
    *tests, data=DATA, elements=112, modes=10, metric=0, starts=3,
    without_strips=False, with_strips=False,
):  # fmt: skip
    """Fit each test with a surface z0 of few modes, without the strips and with them."""
    folder = measured(data)
    for strips in [False] * (not with_strips) + [True] * (not without_strips):
        print("with strips" if strips else "without strips", flush=True)
        for test in map(int, tests or PUBLISHED):
            own = project(JOINT if strips else ALONE, {"bubble": test}, folder, FEW, elements,
                          modes, starts, 100 * strips, metric=metric)  # fmt: skip
            found = fit(own)
            left = found.findings["bubble"].numbers["mean_abs_mm"]
            first = pd.read_csv(folder / f"points_test{test}.csv", comment="#").iloc[0]
            places = np.array([[first[f"x{k}"], first[f"y{k}"]] for k in "ABC"])
            mesh = fitted_model(found.tests["bubble"]).mesh
            z = sampling_matrix(mesh, places)[0] @ mesh.points[:, 2]
            pairs = [f"{own:.2f} ({first[f'z{k}']:.2f})" for own, k in zip(z, "ABC", strict=True)]
            print(f"test {test}: {moduli(found.law)}; residual {left:.2f} mm; z0 at A, B, C "
                  f"(measured) {', '.join(pairs)}; {found.result['analyses']} analyses",
                  flush=True)  # fmt: skip


def moduli(law):
    if law is None:
        return "no fit"
    e1, e2, g12 = (float(law.modulus(name, STRAIN)) for name in ("E1", "E2", "G12"))
    return f"E1 {e1 / 1e3:.3f} E2 {e2 / 1e3:.3f} GPa, G12 {g12:.1f} MPa"


class InMillimetres(FitSetup):
    @property
    def weightings(self):
        return tuple(Weighting() for _ in self.tests)


def left_out(
    *, data=DATA, elements=112, modes=(0,),
    form=("constant",), objective=("mm", "relative"),
    starts=1, strips=False, frames="all",
):  # fmt: skip
    """Leave each test out of the fit in turn and predict it by the law of the others.

    Mean |dx| + |dy| + |dz|. Objective `mm`: the sum of RMS errors; `relative`: as `validate`.
    --strips: in every fit, the objective relative. --frames few: eleven of the twenty.
    """
    folder = measured(data)
    names = {f"test {test}": test for test in PUBLISHED}
    ends = [0.18, 0.232, 0.883] if strips else [0.13, 0.13, 0.13]
    chosen = range(20) if frames == "all" else FEW
    for name in form:
        for count in modes:
            law = f'form = "{name}"\nstrain_range = {ends}\n'
            setup = known_setup(
                project(law, names, folder, chosen, elements, count, 1, 25 * strips)
            )
            for target in ["relative"] if strips else objective:
                also = ", with strips" if strips else ""
                print(f"{name} moduli, {count} modes of the sheet, {target}{also}", flush=True)
                together = law_of_others(setup, target, None, starts)
                print(f"    all three: {moduli(together)}", flush=True)
                predicted = []
                for test in setup.tests:
                    if test.test.kind == "bubble":
                        law = law_of_others(setup, target, test.test.name, starts)
                        predicted.append(mean_error(test, law, setup))
                        print(f"    {test.test.name}: predicted {predicted[-1]:.2f} mm, in the fit "
                              f"to all {mean_error(test, together, setup):.2f} mm; without it "
                              f"{moduli(law)}", flush=True)  # fmt: skip
                print(f"    mean predicted {np.mean(predicted):.2f} mm, beside "
                      f"{PUBLISHED_PREDICTED} of earlier work", flush=True)  # fmt: skip


def law_of_others(setup, objective, without, starts):
    kept = tuple(test for test in setup.tests if test.test.name != without)
    own = replace(setup, tests=kept)
    if objective == "mm":
        own = InMillimetres(own.project, own.law, own.bounds, kept)
    problem = own.problem()
    unknowns, _ = best_of(own, problem, starts)
    return None if unknowns is None else own.law.with_beta(problem.unknowns.beta(unknowns))


def mean_error(test, law, setup):
    """Return mean |dx| + |dy| + |dz| of a test with a law, mm; NaN where either does not run."""
    if law is None:
        return float("nan")
    found = held_out(test, law, setup.make_solver)
    return float(found.numbers.get("mean_abs_mm", float("nan")))


if __name__ == "__main__":
    start_on(residuals, symmetry, sheets, left_out)
