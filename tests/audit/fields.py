"""Centre, axes and apex of measured fields of a bubble."""

import numpy as np
from scipy.optimize import least_squares

from .measured import table_of


def frames_of(folder, section):
    """Return name, places, displacements, heights of each file of frames; None if not plain."""
    points = section.get("data", {}).get("points", {})
    files, columns = points.get("files"), points.get("columns", {})
    if not files or points.get("length_unit", "mm") != "mm":
        return None
    frames = []
    for name in files:
        table = table_of(folder.project_path.parent / name)
        names = [columns.get(key, key) for key in ("x", "y", "dx", "dy", "dz")]
        if table is None or not set(names) <= set(table.columns):
            return None
        values = table[names].to_numpy(float)
        z = columns.get("z", "z")
        heights = table[z].to_numpy(float) if z in table else np.zeros(len(table))
        frames.append((name, values[:, :2], values[:, 2:], heights))
    return frames


def _powers(u, v, degree, parity=None):
    return np.stack([
        u**i * v**j for i in range(degree + 1) for j in range(degree + 1 - i)
        if parity is None or (i + j) % 2 == parity
    ], axis=1)  # fmt: skip


def apex(places, moved, heights, radius):
    """Return rise (mm), k1 + k2 (1/mm), strains along x and y, and sigma of k1 + k2."""
    near = np.hypot(*places.T) < 0.5 * radius
    u = places[near] / radius
    terms = _powers(*u.T, 4)
    index = {(i, j): k for k, (i, j) in enumerate(
        (i, j) for i in range(5) for j in range(5 - i))}  # fmt: skip
    after = np.column_stack([places + moved[:, :2], heights + moved[:, 2]])[near]
    before = np.column_stack([places, heights])[near]
    a, b = (np.linalg.lstsq(terms, own, rcond=None)[0] for own in (after, before))
    ax, ay = a[index[1, 0]] / radius, a[index[0, 1]] / radius
    bx, by = b[index[1, 0]] / radius, b[index[0, 1]] / radius
    normal = np.cross(ax, ay)
    normal /= np.linalg.norm(normal)
    xx, xy, yy = (f * a[index[k]] @ normal / radius**2 for f, k in (
        (2, (2, 0)), (1, (1, 1)), (2, (0, 2))))  # fmt: skip
    metric = np.array([[ax @ ax, ax @ ay], [ax @ ay, ay @ ay]])
    curvature = -float(np.trace(np.linalg.solve(metric, np.array([[xx, xy], [xy, yy]]))))
    strain = [float(np.log(np.linalg.norm(p) / np.linalg.norm(q))) for p, q in ((ax, bx), (ay, by))]
    left = after[:, 2] - terms @ a[:, 2]
    both = [index[2, 0], index[0, 2]]
    covariance = float(left @ left) / (len(left) - terms.shape[1]) * np.linalg.pinv(terms.T @ terms)
    scatter = 2 / radius**2 * float(np.sqrt(covariance[np.ix_(both, both)].sum()))
    return float(a[index[0, 0]][2] - b[index[0, 0]][2]), curvature, strain, scatter


def centre_of(frames, radius):
    """Return the centre of the rim of known radius through which the sheet does not rise.

    The rise is a polynomial times what vanishes on the rim, and a shift; the standard error is that
    of both coordinates together.
    """
    rises = [np.median(moved[:, 2]) for _, _, _, moved, _ in frames]
    high = [f for f, r in zip(frames, rises, strict=True) if r > 0.5 * max(rises)][-4:]

    def left(centre):
        parts = []
        for _, _, places, moved, _ in high:
            inside = np.hypot(*places.T) < 1.02 * radius
            u, v = ((places[inside] - centre) / radius).T
            rim = (1 - u**2 - v**2)[:, None]
            terms = rim * np.hstack([_powers(u, v, 4, 0), _powers(u, v, 3, 1)])
            terms = np.hstack([terms, np.ones((len(u), 1))])
            orthogonal = np.linalg.qr(terms)[0]
            rise = moved[inside, 2]
            parts.append(rise - orthogonal @ (orthogonal.T @ rise))
        return np.concatenate(parts)

    best = least_squares(left, np.zeros(2), x_scale=radius)
    variance = 2 * best.cost / max(len(best.fun) - 2, 1)
    covariance = variance * np.linalg.pinv(best.jac.T @ best.jac)
    return best.x, float(np.sqrt(np.trace(covariance)))


def axes_of(frame):
    """Return the angle of the rise's axes, by its part of two periods around the centre."""
    _, _, places, moved, _ = frame
    angle, r = np.arctan2(places[:, 1], places[:, 0]), np.hypot(*places.T)
    ring = (r > 0.3 * r.max()) & (r < 0.9 * r.max())
    terms = np.stack([np.cos(2 * angle), np.sin(2 * angle), np.ones_like(r), r**2, r**4], axis=1)
    a, b = np.linalg.lstsq(terms[ring], moved[ring, 2], rcond=None)[0][:2]
    return float(np.degrees(0.5 * np.arctan2(b, a)))
