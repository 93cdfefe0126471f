"""All that result.json says of a fit, and every warning, word by word."""

from __future__ import annotations

from dataclasses import replace

import bubblefit as bf
import numpy as np
import pytest
from bubblefit.runs.record import versions
from bubblefit.runs.result import TOGETHER, notes_of_fit

OPEN = "rests on the other directions"
LEFT = "points beyond the final length (or before zero) were left out"


def test_everything_of_two_tests(together: bf.Fit) -> None:
    fit, law = together, together.law
    result = dict(fit.result)
    assert result.pop("provenance") == "provenance.json"
    sure = fit.best.certainty
    assert sure is not None
    pinned = result.pop("pinned")
    assert list(pinned) == ["one", "two", TOGETHER]
    for name, sigma in sure.sigma.items():
        least, most = float(sigma.min()), float(sigma.max())
        own = {"least": least, "median": float(np.median(sigma)), "largest": most}
        assert pinned[TOGETHER][name] == own
    assert set(result.pop("tests")) == {"one", "two"}
    assert list(result.pop("mean_relative_error")) == ["one", "two"]
    assert result.pop("warnings") == [note.line for note in fit.notes]
    assert result.pop("notes") == [
        {"of": note.of, "kind": note.kind.value, "note": str(note)} for note in fit.notes
    ]
    for name, misfit in result.pop("misfit").items():
        own = fit.misfits[name]
        assert misfit == {
            "rms": own.rms, "noise": own.noise, "noise_is": "specimens' scatter", "unit": "N",
            "times_noise": pytest.approx(own.rms / own.noise),
        }  # fmt: skip
    ends = dict(zip(("warp", "fill", "shear"), fit.best.reached.tolist(), strict=True))
    assert result == {
        "command": "strips",
        "title": "made",
        "solver": "membrane",
        "method": "lm",
        "objective": fit.objective,
        "objective_is": "weighted sum of the tests' mean relative RMS errors",
        "moduli": "constant",
        "beta": {
            "unit": "GPa",
            "labels": [f"beta_{i}" for i in range(12)],
            "values": pytest.approx((1e-3 * law.beta).tolist()),
        },
        "nu12": 0.0,
        "strain_reached": ends,
        "valid_strain": {**ends, "warp": 0.12},
        "seed": 7,
        "starts": [
            {
                "start": number,
                "seed": [7, number],
                "objective": record.objective,
                "status": "converged",
                "analyses": record.analyses,
                "external_runs": 0,
                "cached_runs": 0,
            }
            for number, record in enumerate(fit.best.records)
        ],
        "coarse_to_fine": None,
        "analyses": sum(record.analyses for record in fit.best.records),
        "external_runs": 0,
        "cached_runs": 0,
        "wall_s": fit.wall_s,
        "versions": versions(),
        "uncertainty": {
            "noise": sure.noise,
            "values_that_err_as_one": sure.alike,
            "largest_relative_sigma": {n: float(s.max()) for n, s in sure.sigma.items()},
            "median_relative_sigma": {n: float(np.median(s)) for n, s in sure.sigma.items()},
            "largest_relative_mesh": {n: float(np.abs(s).max()) for n, s in sure.mesh.items()},
            "largest_relative_total": {n: float(s.max()) for n, s in sure.total.items()},
            "mesh_error": "told",
            "second_order": None,
            "smooth_beyond_noise": {},
        },
        "noise_given": {},
        "weights": {"one": 1.0, "two": 3.0},
    }


def told(fit: bf.Fit) -> list[tuple[str, str, str]]:
    return [(note.kind.value, note.of, str(note)) for note in fit.notes]


def test_every_note_of_two_tests(together: bf.Fit) -> None:
    words = "(1 sigma above 100 % everywhere)"
    assert told(together) == [
        (
            "uncertain",
            "",
            "G12 is uncertain by up to 1000 % (1 sigma with the tests' noise), worst at strain "
            "0.000",
        ),
        (
            "beyond law.strain_range",
            "one: warp",
            "warp strain reached 0.135, beyond law.strain_range 0.12: the modulus was held at its "
            "end value there; a wider range would let it vary",
        ),
        ("unmatched direction", "one", f"no bias strip of one is matched: G12 {OPEN}"),
        ("points left out", "one, warp", f"2 {LEFT}"),
        ("points left out", "one, fill", f"2 {LEFT}"),
        ("unmatched direction", "two", f"no fill strip of two is matched: E2 {OPEN}"),
        ("unmatched direction", "two", f"no bias strip of two is matched: G12 {OPEN}"),
        ("points left out", "two, warp", f"4 {LEFT}"),
        ("undetermined alone", "", f"one alone does not determine G12 {words}"),
        ("undetermined alone", "", f"two alone does not determine E2 {words}"),
        ("undetermined alone", "", f"two alone does not determine G12 {words}"),
    ]


def test_every_note_of_one_test(alone: bf.Fit) -> None:
    """Its name stands before none of them; nothing else could be meant."""
    noise = alone.result["uncertainty"]["noise"]["two: warp"]
    words = f"is uncertain by up to 1000 % (1 sigma at {noise:.2g} N noise), worst at strain 0.000"
    assert told(alone) == [
        ("uncertain", "", f"E2 {words}"),
        ("uncertain", "", f"G12 {words}"),
        ("unmatched direction", "", f"no fill strip of two is matched: E2 {OPEN}"),
        ("unmatched direction", "", f"no bias strip of two is matched: G12 {OPEN}"),
        ("points left out", "warp", f"4 {LEFT}"),
    ]
    assert alone.result["directions"] == alone.result["tests"]["two"]["directions"]
    assert alone.result["e_uniaxial_N"] == pytest.approx(alone.objective)
    assert "weights" not in alone.result and "mean_relative_error" not in alone.result


def test_remarks_and_unstable_equilibria_with_the_name_of_the_part(together: bf.Fit) -> None:
    best = together.best
    marked = [
        replace(h, unstable=("1 mm",) if k == 1 else (), remarks=("snaps",) if k == 2 else ())
        for k, h in enumerate(best.point.histories)
    ]
    point = replace(best.point, histories=tuple(marked))
    fit = replace(together, best=replace(best, point=point))
    said = [note.line for note in notes_of_fit(fit, {})]
    assert [line for line in said if "unstable" in line or "snaps" in line] == [
        "one: fill: unstable equilibrium at 1 mm: the model would not stay there",
        "two: warp: snaps",
    ]


def test_without_noise_nothing_is_so_many_times_the_noise(together: bf.Fit) -> None:
    fit = replace(together)
    name, misfit = next(iter(together.misfits.items()))
    fit.__dict__["misfits"] = {
        name: replace(misfit, noise=0.0),
        "other": replace(misfit, noise=4.0),
    }
    said = fit.result["misfit"]
    assert said[name]["times_noise"] is None and said[name]["noise"] == 0.0
    assert said["other"]["times_noise"] == pytest.approx(misfit.rms / 4.0)


def test_versions_of_what_computes() -> None:
    found = versions()
    names = ("bubblefit", "python", "numpy", "scipy", "numba", "nlopt", "quadprog", "meshio")
    assert tuple(found) == names
    assert (found["bubblefit"], found["numpy"]) == (bf.__version__, np.__version__)
