"""How many neighbouring values of a residual err as one, and what a fit then says of itself."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from bubblefit.inference.assessment import certainty
from bubblefit.inference.noise import alike, alike_in
from scipy.ndimage import gaussian_filter

from . import cases

SIDE, STEP = 40, 2.5
PLACES = STEP * np.stack(np.meshgrid(np.arange(SIDE), np.arange(SIDE)), axis=-1).reshape(-1, 2)


def noise(width: float, count: int, seed: int = 3) -> list[np.ndarray]:
    """Fields that are alike over a Gaussian of `width` steps: 4 pi width^2 err as one."""
    random = np.random.default_rng(seed)
    fields = random.standard_normal((count, SIDE, SIDE))
    if width:
        fields = np.array([gaussian_filter(field, width, mode="wrap") for field in fields])
    return [field.reshape(-1) for field in fields]


@pytest.mark.parametrize("width", [0.0, 0.7, 1.0, 1.5])
def test_smoothed_noise(width: float) -> None:
    fields = noise(width, 24)
    expected = max(1.0, 4 * np.pi * width**2)
    assert alike(fields, [PLACES] * 24) == pytest.approx(expected, rel=0.15)


def test_what_changes_its_sign_from_point_to_point_is_no_more_than_independent() -> None:
    field = (-1.0) ** np.indices((SIDE, SIDE)).sum(axis=0).reshape(-1)
    assert alike([field], [PLACES]) == 1.0


def test_blocks_count_alike_whatever_their_size() -> None:
    fields, places = noise(1.0, 12), [PLACES] * 12
    sizes = np.array([1.0, 100.0] * 6)
    scaled = [size * field for size, field in zip(sizes, fields, strict=True)]
    assert alike(scaled, places) == pytest.approx(alike(fields, places), rel=1e-12)


def test_nothing_to_compare() -> None:
    assert alike([np.zeros(5), np.ones(1)], [PLACES[:5], PLACES[:1]]) == 1.0
    assert alike([], []) == 1.0


def test_the_scatter_of_an_estimate() -> None:
    """A slope fitted to noise on a smooth field scatters as many independent values would have
    it, so many times fewer."""
    x = PLACES[:, 0] - PLACES[:, 0].mean()
    fields = noise(1.0, 400, seed=11)
    scatter = np.std([x @ field / (x @ x) for field in fields])
    white = np.std(fields) / np.sqrt(x @ x)
    said = white * np.sqrt(alike(fields[:30], [PLACES] * 30))
    assert scatter == pytest.approx(said, rel=0.12)
    assert scatter > 3 * white


def test_a_fit_is_as_much_less_sure() -> None:
    """Of 0.2 mm of noise that neighbours share, beside noise that is white and as large."""
    random = np.random.default_rng(5)
    nodes = cases.MODEL.mesh.points[:, :2]
    distance = np.hypot(*(nodes[:, None] - nodes).T)
    root = np.linalg.cholesky(np.exp(-((distance / 20.0) ** 2)) + 1e-9 * np.eye(len(nodes)))
    found = {}
    for name, mix in (("white", np.eye(len(nodes))), ("shared", root)):
        problem = cases.problem()
        (comparison,) = problem.comparisons
        objective = comparison.objective
        objective.targets = tuple(
            replace(
                target,
                displacement=target.displacement
                + 0.2 * mix @ random.standard_normal((len(nodes), 3)),
                at_rest=nodes,
            )
            for target in objective.targets
        )
        point = problem.evaluate(problem.unknowns.at(cases.LAW.beta), True)
        found[name] = certainty(problem, point, cases.LAW, np.full(3, 0.08))
        if name == "shared":
            assert alike_in(objective, point.residual) == found[name].alike["bubble"]
    assert found["white"].alike["bubble"] == pytest.approx(1.0, abs=0.15)
    assert 3.0 < found["shared"].alike["bubble"] < 12.0
    for name in ("E1", "E2", "G12"):
        ratio = found["shared"].sigma[name] / found["white"].sigma[name]
        noise_ratio = found["shared"].noise["bubble"] / found["white"].noise["bubble"]
        many = found["shared"].alike["bubble"] / found["white"].alike["bubble"]
        # Noise that is shared leaves blocks of other norms, and so of other weights.
        assert ratio == pytest.approx(noise_ratio * np.sqrt(many), rel=0.15)


def test_a_misfit_below_the_noise_does_not_tell() -> None:
    """Here it is a smooth one of 0.03 mm, beside 0.05 mm to reckon with."""
    problem = cases.problem()
    (comparison,) = problem.comparisons
    nodes = cases.MODEL.mesh.points[:, :2]
    comparison.objective.targets = tuple(
        replace(target, displacement=target.displacement + 0.03, at_rest=nodes)
        for target in comparison.objective.targets
    )
    point = problem.evaluate(problem.unknowns.at(cases.LAW.beta), True)
    assert certainty(problem, point, cases.LAW, np.full(3, 0.08)).alike == {"bubble": 1.0}


def test_along_a_curve() -> None:
    """Readings that follow each other by 0.6: (1 + 0.6) / (1 - 0.6) = 4 err as one; or by chance
    alone: of ten or a hundred white ones each counts."""
    random = np.random.default_rng(2)
    places = np.arange(2000.0)[:, None]
    white = random.standard_normal((6, 2000))
    follow = np.zeros_like(white)
    for k in range(1, 2000):
        follow[:, k] = 0.6 * follow[:, k - 1] + white[:, k]
    fine = places[:60]
    pieces = [piece for one in follow for piece in np.split(one[:1980], 33)]
    assert alike(pieces, [fine] * len(pieces)) == pytest.approx(4.0, rel=0.15)
    for count in (10, 100):
        found = [alike([random.standard_normal(count)], [places[:count]]) for _ in range(60)]
        assert np.median(found) == 1.0 and np.mean(found) < 1.15
