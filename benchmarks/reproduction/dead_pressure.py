"""Compare the published bubble's profiles with pressure that follows the surface, and dead.

Prints the first table of docs/validation/published-bubble.md (Table 4.2, 800 quads, 14 increments),
then u_y of other variants of law and load, none of which explains Marc's.
"""

import importlib.util
import sys
import tempfile
from collections.abc import Callable
from contextlib import AbstractContextManager, contextmanager, nullcontext
from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
from bubblefit.experiments.bubble import BubbleTest, KnownSolution
from bubblefit.materials.law import HypoelasticLaw
from bubblefit.meshes.bubble_model import BubbleModel
from bubblefit.project.project import read_project
from bubblefit.solvers.membrane import kernel, membrane
from bubblefit.solvers.membrane.solver import MembraneSolver
from scipy.interpolate import PchipInterpolator

ROOT = Path(__file__).resolve().parents[2]
KNOWN = ROOT / "examples" / "bubble-known-solution" / "project.toml"
PROFILES = ROOT / "runs" / "verification" / "published" / "marc_bubble_profiles.csv"
#: The normal times the deformed area, and its derivative, by what takes their place.
NORMAL = (
    ("nx = f[0, 1] * f[1, 2] - f[0, 2] * f[1, 1]", "nx = 0.0"),
    ("ny = f[0, 2] * f[1, 0] - f[0, 0] * f[1, 2]", "ny = 0.0"),
    ("nz = f[0, 0] * f[1, 1] - f[0, 1] * f[1, 0]", "nz = 1.0"),
)
PUSH = tuple((f"z{k} = wp *", f"z{k} = 0.0 * wp *") for k in range(3))
#: Marc's nodes from the centre of a cut whose places at rest are known, and these, mm.
NODES, PLACES = slice(10, 15), np.array([60.0, 68.0, 76.0, 84.0, 92.0])


@contextmanager
def dead():
    """Bubbles of the membrane solver meanwhile carry dead pressure (no derivatives of a fit)."""
    source = Path(kernel.__file__).read_text()
    for follows, stays in (*NORMAL, *PUSH):
        assert follows in source, follows
        source = source.replace(follows, stays)
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "dead_kernel.py"
        path.write_text(source)
        spec = importlib.util.spec_from_file_location(f"{kernel.__package__}.dead_kernel", path)
        assert spec is not None and spec.loader is not None
        module = importlib.util.module_from_spec(spec)
        sys.modules[spec.name] = module  # its dataclasses look there for their types
        spec.loader.exec_module(module)
        follower, membrane.assemble = membrane.assemble, module.assemble
        try:
            yield
        finally:
            membrane.assemble = follower


#: By name: what a run of the membrane is done within.
LOADS: dict[str, Callable[[], AbstractContextManager[None]]] = {
    "follower": nullcontext,
    "dead": dead,
}


def known_bubble(parts=None):
    """The example's model as a full disk, with `parts` increments a pressure, and its law."""
    project = read_project(KNOWN)
    test = project.tests["bubble"]
    assert isinstance(test, BubbleTest)
    assert isinstance(test.data, KnownSolution)
    model = replace(test, symmetry="full").models()["bubble"]
    if parts is not None:
        levels = [0.0, *model.pressures]
        at = np.arange(1, parts * len(model.pressures) + 1) / parts
        steps = np.interp(at, np.arange(len(levels)), levels)
        model = BubbleModel(model.mesh, model.thickness, model.pressures, steps)
    return model, HypoelasticLaw(test.data.beta, 0.24, np.array(project.law.strain_range))


def cut(model, displacement, axis):
    """Displacements along the cut and upwards of its nodes from the centre to the rim, (nodes,)."""
    points = model.mesh.points
    on = np.flatnonzero((np.abs(points[:, 1 - axis]) < 1e-6) & (points[:, axis] > -1e-6))
    on = on[np.argsort(points[on, axis])]
    return points[on, axis], displacement[on][:, [axis, 2]]


def main():
    published = pd.read_csv(PROFILES, comment="#")
    published = published[(published["copy"] == 0) & (published.coord_mm > -0.01)]
    model, law = known_bubble(parts=2)
    print("ours against Marc's published profiles, in %; u: mean of the nodes at 60 to 92 mm")
    print(f"{'kPa':>5s}{'load':>10s}{'apex':>8s}{'u_x':>8s}{'u_y':>8s}{'z, y cut':>10s}")
    for name, load in LOADS.items():
        with load():
            history = MembraneSolver().run(model, law)
        for pressure, displacement in zip(history.load, history.displacement, strict=True):
            kpa = round(1e3 * pressure)
            marc = published[published.p_kPa == kpa]
            row = compare(model, displacement, marc)
            print(f"{kpa:5d}{name:>10s}" + "".join(f"{100 * off:8.1f}" for off in row))
        apart = [f"{value:.2f}" for value in along(model, displacement, 1, 0)]
        print(f"{'':5s}{name:>10s} u_y at 300 kPa, 60 to 92 mm: {', '.join(apart)} mm", flush=True)
    marc = published[(published.p_kPa == 300) & (published.axis == "y")].coord_mm.to_numpy()[NODES]
    apart = [f"{value:.2f}" for value in marc - PLACES]
    print(f"{'':5s}{'Marc':>10s} u_y at 300 kPa, 60 to 92 mm: {', '.join(apart)} mm")
    print("u_y at 300 kPa, 60 to 92 mm, above Marc's, in %")
    for words, name, other in variants(law):
        with LOADS[name]():
            u = MembraneSolver().run(model, other).displacement[-1]
        off = 100 * (along(model, u, 1, 0) / (marc - PLACES) - 1)
        print(f"  {words:42s}" + "".join(f"{value:7.0f}" for value in off), flush=True)


def variants(law):
    yield "follower, incompressible", "follower", replace(law, thickness_change="incompressible")
    for nu12 in (0.05, 0.4):
        yield f"follower, nu12 = {nu12:g}", "follower", replace(law, nu12=nu12)
    for times in (3.0, 10.0):
        stiff = np.concatenate([times * law.beta[:4], law.beta[4:]])
        yield f"follower, G12 times {times:g}", "follower", law.with_beta(stiff)
    yield "dead, incompressible", "dead", replace(law, thickness_change="incompressible")


def along(model, displacement, axis, component):
    """Ours at the reference places of Marc's nodes: 0, along the cut; 1, upwards. mm."""
    places, values = cut(model, displacement, axis)
    return PchipInterpolator(places, values[:, component])(PLACES)


def compare(model, displacement, marc):
    """How much larger ours are: apex, u_x, u_y, and z on the y axis."""
    apex = displacement[model.mesh.node_sets["apex"][0], 2] / marc.z_mm.max() - 1
    off = [float(apex)]
    for axis, name in enumerate("xy"):
        theirs = marc[marc.axis == name].coord_mm.to_numpy()[NODES] - PLACES
        off.append(float(np.mean(along(model, displacement, axis, 0) / theirs - 1)))
    heights = marc[marc.axis == "y"].z_mm.to_numpy()[NODES]
    return [*off, float(np.mean(along(model, displacement, 1, 1) / heights - 1))]


if __name__ == "__main__":
    main()
