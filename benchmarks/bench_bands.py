"""Check what biases the moduli of the known solution, and whether bands and notes are right."""

from dataclasses import replace

import bubblefit as bf
import numpy as np
from bubblefit.experiments.bubble.field_shape import mirrored
from bubblefit.inference.reported import moduli_error, reported_moduli
from bubblefit.readers.fields import DisplacementField
from bubblefit.runs.certainty import with_certainty
from common import known_project, known_setup, settled, start_on
from scipy.interpolate import CloughTocher2DInterpolator

MODULI = ("E1", "E2", "G12")
#: The lines to uncomment in the example: load steps in kPa beside the pressures.
STEPS = (4, 11, 40, 78, 115, 160, 220, 275)
#: mm: noise, and the Gaussian of a facet over which it is alike; share of the strain reached.
NOISE, FACET, SHARE = 0.02, 2.5, 0.9
CONSTANTS = {"E1": [0.02, 3.0], "E2": [0.01, 2.0], "G12": [0.0005, 0.2]}
#: By name: symmetry and form of the fit, thickness option of the data, degrees of turning.
CASES = {
    "right law": ("quarter", "cubic", "constant", 0.0),
    "constants": ("quarter", "constant", "constant", 0.0),
    "other thickness option": ("quarter", "cubic", "incompressible", 0.0),
    "turned by 10 degrees": ("full", "cubic", "constant", 10.0),
    "right law, full disk": ("full", "cubic", "constant", 0.0),
}


def bias(starts=3):
    """Fit data of other meshes and load steps, and by polynomial surfaces; STARTS each."""
    base = known_project()
    (test,) = base.tests.values()
    steps = np.unique([*test.pressures, *(1e-3 * np.array(STEPS))])
    other = replace(test.data, elements=1800, increments=tuple(map(float, steps)))
    cases = {
        "the same model": test,
        "data of a finer mesh, other load steps": replace(test, data=other),
        "the same of a very fine mesh": replace(test, data=replace(other, elements=7200)),
    }
    for degree in (4, 6, 8):
        words = f"surfaces of degree {degree}"
        cases[words] = replace(test, match_by="surfaces", match_degree=degree)
    print(f"{'':40s}{'e':>9s}{'E1, %':>8s}{'E2, %':>8s}{'G12, %':>8s}{'half way':>10s}"
          f"{'mesh out: E1':>14s}{'E2':>7s}{'G12':>7s}"
          f"{'in band, %: E1':>17s}{'E2':>7s}{'G12':>7s}")  # fmt: skip
    for words, case in cases.items():
        fit = bf.fit(replace(base, tests={case.name: case}), starts=starts)
        known, sure = fit.law.with_beta(test.data.beta), fit.best.certainty
        assert sure is not None
        errors = moduli_error(fit.law, known, fit.best.reached)
        half = moduli_error(fit.law, known, 0.5 * fit.best.reached)["G12"]
        settings = fit.project.fit.model_copy(update={"mesh_error": "taken out"})
        setup = replace(fit.setup, project=replace(fit.project, fit=settings))
        best = with_certainty(setup, fit.problem, replace(fit.best, certainty=None))
        assert best.certainty is not None and best.certainty.taken_out
        without = moduli_error(best.law, known, best.reached)
        row = "".join(f"{100 * errors[name]:8.2g}" for name in MODULI)
        left = "".join(f"{100 * without[name]:7.2g}" for name in MODULI)
        inside = "".join(
            f"{100 * np.mean(held(sure.moduli[n].band, known.modulus(n, sure.strain[n]))):7.0f}"
            for n in MODULI
        )
        print(f"{words:40s}{fit.objective:9.2g}{row}{100 * half:10.2g}       {left}   {inside}",
              flush=True)  # fmt: skip


def held(band, true):
    return (band[0] <= true) & (true <= band[1])


def correlated(points):
    distance = np.hypot(*(points[:, None] - points).T)
    whole = np.exp(-((distance / FACET) ** 2)) + 1e-9 * np.eye(len(points))
    return NOISE * np.linalg.cholesky(whole)


def noisy(pressures, points, exact, root, seed):
    random = np.random.default_rng(seed)
    return tuple(
        DisplacementField(p, points, u + root @ random.standard_normal(u.shape))
        for p, u in zip(pressures, exact, strict=True)
    )


def coverage(fields=100, quads=432):
    """Count how often the bands of fits to FIELDS noisy fields hold the truth.

    Data of 7200 quads at the nodes of a disk of QUADS, noise alike over a facet; strains up to 0.9
    of what is reached; the band (95 %), that without the mesh's error, and noise alone.
    """
    project = known_project()
    (test,) = project.tests.values()
    data = replace(test.data, elements=7200)
    case = replace(test, elements=quads, symmetry="quarter", data=data, noise=1e-3)
    setup = known_setup(replace(project, tests={test.name: case}))
    (prepared,), (comparison,) = setup.tests, setup.problem().comparisons
    targets, known = comparison.objective.targets, prepared.known
    nodes = comparison.model.mesh.points[:, :2]
    root = correlated(nodes)
    inside = {}
    moduli = {}
    widths = {}
    for number in range(fields):
        seen = noisy([t.pressure for t in targets], nodes,
                     [t.displacement for t in targets], root, [number, 7])  # fmt: skip
        one = replace(setup, tests=(replace(prepared, fields=seen),))
        beta = known.beta[list(one.problem().unknowns.free)]
        done = settled(one, beta, number)
        if done is None:
            print(f"field {number}: no fit")
            continue
        problem, best = done
        sure = best.certainty
        assert sure.mesh is not None
        out = best.law.with_beta(problem.unknowns.beta(sure.corrected.best))
        without = reported_moduli(sure.corrected, out, sure.strain)
        for name, strain in sure.strain.items():
            some = strain <= SHARE * strain[-1]
            true, own = known.modulus(name, strain), best.law.modulus(name, strain)
            noise = 1.96 * sure.linear_sigma[name] * own
            for what, band in (
                ("as reported", sure.moduli[name].band),
                ("mesh's error taken out", without[name].band),
                ("noise alone, 1.96 sigma", (own - noise, own + noise)),
            ):
                inside.setdefault(f"{what}, {name}", []).append(held(band, true)[some])
            moduli.setdefault(name, []).append(out.modulus(name, strain)[some] / true[some])
            ends = without[name].band[:, some] / true[some]
            widths.setdefault(name, []).append((ends[1] - ends[0]) / (2 * 1.96))
    for words, share in inside.items():
        print(f"{words:30s}{100 * np.mean(np.concatenate(share)):6.1f} % of the truth inside")
    for name, own in moduli.items():
        least = min(map(len, own))  # what is reached differs a little from field to field
        wide, off = (np.array([one[:least] for one in of]) for of in (widths[name], own))
        ratio = wide.mean(axis=0) / off.std(axis=0)
        print(f"width of the band over scatter, {name}: {np.median(ratio):.2f} (median)")


def discrepancy(fields=100, quads=192, *chosen):
    """Count in how many of FIELDS noisy fields a wrong form of law or model is noticed.

    Data of 3200 quads at points 4 mm apart, matched on a disk of QUADS. CHOSEN: names of `CASES`.
    """
    for words in chosen or CASES:
        symmetry, form, of_data, degrees = CASES[words]
        turned = np.radians(degrees)
        (source,) = form_setup(quads, "quarter", "cubic", of_data).tests
        setup = form_setup(quads, symmetry, form, "constant")
        (prepared,), known = setup.tests, source.known
        side = np.arange(0.0 if symmetry == "quarter" else -99.0, 99.1, 4.0)
        points = np.stack(np.meshgrid(side, side), axis=-1).reshape(-1, 2)
        points = points[np.hypot(*points.T) < 95.0]
        exact, root = camera(source.fields, points, turned), correlated(points)
        noticed, ratios, rms = 0, [], []
        for number in range(fields):
            seen = noisy([f.pressure for f in source.fields], points, exact, root, [number, 11])
            measured = replace(prepared, fields=seen, known=None, by_this_model=False)
            one = replace(setup, tests=(measured,))
            beta = known.beta
            if one.problem().unknowns.size <= 3:
                beta = [known.modulus(n, np.full(1, 0.03))[0] for n in ("G12", "E2", "E1")]
            done = settled(one, beta, number)
            if done is None:
                print(f"{words}, field {number}: no fit")
                continue
            found = done[1].certainty.discrepancy["bubble"]
            noticed += found.is_significant
            ratios.append(found.f_ratio)
            rms.append(found.rms)
        print(f"{words:24s}{noticed:4d} of {len(ratios)} told, ratio {np.median(ratios):8.3g} "
              f"(at most {max(ratios):.3g}, by chance {found.critical_ratio:.3g}), "
              f"smooth {np.median(rms):.2g} mm", flush=True)  # fmt: skip


def form_setup(quads, symmetry, form, thickness):
    """Prepare a fit, its data without noise; `thickness` is the option of the data."""
    project = known_project()
    (test,) = project.tests.values()
    fine = 3200 if symmetry == "quarter" else 192  # of a full disk nothing is used
    data = replace(test.data, elements=fine, symmetry=symmetry)
    case = replace(test, elements=quads, symmetry=symmetry, data=data)
    law, fabric = project.law, replace(project.fabric, thickness_change=thickness)
    if form != "cubic":
        given = {"form": form, "strain_range": law.strain_range, "bounds": CONSTANTS}
        law = law.model_validate(given)
    return known_setup(replace(project, tests={test.name: case}, law=law, fabric=fabric))


def camera(fields, points, turned):
    c, s = np.cos(turned), np.sin(turned)
    turn = np.array([[c, -s], [s, c]])
    moved = []
    for field in map(mirrored, fields):
        at = CloughTocher2DInterpolator(field.points, field.displacement)(points @ turn)
        moved.append(np.column_stack([at[:, :2] @ turn.T, at[:, 2]]))
    return moved


if __name__ == "__main__":
    start_on(bias, coverage, discrepancy)
