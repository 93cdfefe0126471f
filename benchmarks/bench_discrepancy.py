"""Is a wrong form of the law or of the model told? Fields of a camera with noise of its facets.

Usage: bench_discrepancy.py [FIELDS] [QUADS]. FIELDS (100 unless given) sets of displacements of the
example's law, computed on a mesh of 3200 quads, at points 4 mm apart, with 0.02 mm of noise that is
alike over a facet (a Gaussian of 2.5 mm), matched on a disk of QUADS (192) quads from the true law
on. Printed: in how many of 100 the fit is said to leave what cannot be noise, with the right law,
with constants, with the other thickness option, and of a film turned by 10 degrees against the
yarns; and the medians of the ratio that decides and of what is smooth, mm.
"""

from __future__ import annotations

import sys
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from bubblefit.experiments.bubble.objective import mirrored
from bubblefit.experiments.bubble.prepared import PreparedBubble
from bubblefit.experiments.bubble.test import BubbleTest, KnownSolution
from bubblefit.inference.methods.lm import LevenbergMarquardt
from bubblefit.readers.fields import DisplacementField
from bubblefit.runs.best import best_fit, with_certainty
from bubblefit.runs.setup import FitSetup, prepare_fit
from bubblefit.runs.starts import StartRecord
from known_solution import known_project
from scipy.interpolate import CloughTocher2DInterpolator

FINE, COARSE, NOISE, FACET, STEP, EDGE = 3200, 192, 0.02, 2.5, 4.0, 95.0
TURNED = np.radians(10.0)


def setup_of(quads: int, symmetry: str, form: str, thickness: str) -> FitSetup:
    """A fit, its data without noise; `thickness` is the option of the data."""
    project = known_project()
    (test,) = project.tests.values()
    assert isinstance(test, BubbleTest) and isinstance(test.data, KnownSolution)
    fine = FINE if symmetry == "quarter" else COARSE  # of a full disk nothing is used
    data = replace(test.data, elements=fine, symmetry=symmetry)
    case = replace(test, elements=quads, symmetry=symmetry, data=data)
    law = project.law
    if form != "cubic":
        law = law.model_validate({"form": form, "strain_range": law.strain_range,
                                  "bounds": {"E1": [0.02, 3.0], "E2": [0.01, 2.0],
                                             "G12": [0.0005, 0.2]}})  # fmt: skip
    fabric = replace(project.fabric, thickness_change=thickness)
    changed = replace(project, tests={test.name: case}, law=law, fabric=fabric)
    return prepare_fit(changed, changed.chosen(None, fitted=True))  # type: ignore[arg-type]


def seen(fields: Sequence[DisplacementField], points: np.ndarray, turned: float) -> list:
    """The fields at the points of a camera that is turned."""
    c, s = np.cos(turned), np.sin(turned)
    turn = np.array([[c, -s], [s, c]])
    moved = []
    for field in fields:
        whole = mirrored(field)
        at = CloughTocher2DInterpolator(whole.points, whole.displacement)(points @ turn)
        moved.append(np.column_stack([at[:, :2] @ turn.T, at[:, 2]]))
    return moved


def main() -> None:
    count = int(sys.argv[1]) if len(sys.argv) > 1 else 100
    quads = int(sys.argv[2]) if len(sys.argv) > 2 else 192
    chosen = sys.argv[3:]
    constant, other = "constant", "incompressible"
    cases = {
        "right law": ("quarter", "cubic", constant, constant, 0.0),
        "constants": ("quarter", "constant", constant, constant, 0.0),
        "other thickness option": ("quarter", "cubic", other, constant, 0.0),
        "turned by 10 degrees": ("full", "cubic", constant, constant, TURNED),
        "right law, full disk": ("full", "cubic", constant, constant, 0.0),
    }
    for words, (symmetry, form, of_data, of_fit, turned) in cases.items():
        if chosen and words not in chosen:
            continue
        computed = setup_of(quads, "quarter", "cubic", of_data)
        setup = setup_of(quads, symmetry, form, of_fit)
        (prepared,), (source,) = setup.tests, computed.tests
        assert isinstance(prepared, PreparedBubble) and isinstance(source, PreparedBubble)
        assert source.known is not None
        side = np.arange(0.0 if symmetry == "quarter" else -99.0, 99.1, STEP)
        points = np.stack(np.meshgrid(side, side), axis=-1).reshape(-1, 2)
        points = points[np.hypot(*points.T) < EDGE]
        exact = seen(source.fields, points, turned)
        distance = np.hypot(*(points[:, None] - points).T)
        root = np.linalg.cholesky(np.exp(-((distance / FACET) ** 2)) + 1e-9 * np.eye(len(points)))
        told, ratios, rms = 0, [], []
        for number in range(count):
            random = np.random.default_rng([number, 11])
            fields = tuple(
                DisplacementField(
                    f.pressure, points, u + NOISE * root @ random.standard_normal(u.shape)
                )
                for f, u in zip(source.fields, exact, strict=True)
            )
            measured = replace(prepared, fields=fields, known=None, by_this_model=False)
            one = replace(setup, tests=(measured,))
            problem = one.problem()
            size = problem.unknowns.size
            known = source.known
            values = known.beta if size > 3 else [known.modulus(n, np.full(1, 0.03))[0]
                                                  for n in ("G12", "E2", "E1")]  # fmt: skip
            start = problem.unknowns.at(np.asarray(values, dtype=float))
            optimum = LevenbergMarquardt().minimise(problem, start, one.options)
            if optimum is None:
                print(f"{words}, field {number}: no fit")
                continue
            y, b = (tuple(v.tolist()) for v in (optimum.best.unknowns, optimum.coefficients))
            record = StartRecord(number, (0, 0), optimum.value, optimum.status, 0, y, b, 0.0)
            sure = with_certainty(one, problem, best_fit(problem, [record], 1e-7)).certainty
            assert sure is not None
            found = sure.discrepancy["bubble"]
            told += found.told
            ratios.append(found.ratio)
            rms.append(found.rms)
        print(
            f"{words:24s}{told:4d} of {len(ratios)} told, ratio {np.median(ratios):8.3g} (at most "
            f"{max(ratios):.3g}, by chance {found.largest:.3g}), smooth {np.median(rms):.2g} mm",
            flush=True,
        )


if __name__ == "__main__":
    main()
