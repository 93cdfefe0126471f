"""Compare the thesis' Table 4.1: surfaces that follow the known bubble (R², Eq. 4.4).

Prints the second table of docs/validation/published-bubble.md, both pressures; then parts of the
disk, other degrees and meshes, and what an odd cubic leaves of u_y along the fill axis at 22 kPa.
"""

import numpy as np
from bubblefit.meshes.bubble_model import BubbleModel
from bubblefit.meshes.disk import disk_mesh
from bubblefit.readers.fields import powers
from bubblefit.solvers.membrane.solver import MembraneSolver
from dead_pressure import LOADS, cut, known_bubble

#: By pressure in kPa: x, y, z.
TABLE_4_1 = {
    22: (0.99999, 0.99971, 0.99999), 59: (0.99999, 0.99980, 0.99999),
    97: (0.99998, 0.99994, 0.99999), 132: (0.99994, 0.99989, 0.99999),
    186: (0.99986, 0.99970, 0.99998), 251: (0.99967, 0.99901, 0.99994),
    300: (0.99962, 0.99836, 0.99994),
}  # fmt: skip
#: Quads of the full disk.
MESHES = (48, 200, 3200)
#: Parts of the disk by the least x and y in mm.
PARTS = {"full": (-200.0, -200.0), "half y >= 0": (-200.0, -1e-6), "quarter": (-1e-6, -1e-6)}


def r_squared(points, displacement, degree):
    """(3,) of the least-squares surfaces of that degree through all points."""
    term = powers(points / 100.0, degree)
    left = displacement - term @ np.linalg.lstsq(term, displacement, rcond=None)[0]
    about = displacement - displacement.mean(axis=0)
    return np.asarray(1 - (left**2).sum(axis=0) / (about**2).sum(axis=0))


def rows(model, history, part="full", degree=4):
    """R² (pressures, 3) over a part of the disk."""
    points = model.mesh.points[:, :2]
    on = (points > PARTS[part]).all(axis=1)
    return np.array([r_squared(points[on], u[on], degree) for u in history.displacement])


def main():
    model, law = known_bubble()
    histories = {}
    for name, load in LOADS.items():
        with load():
            histories[name] = MembraneSolver().run(model, law)
    tables = {name: rows(model, history) for name, history in histories.items()}
    print("full disk, degree 4: published, follower pressure, dead pressure")
    for i, (kpa, published) in enumerate(TABLE_4_1.items()):
        parts = [
            f"{axis} {published[k]:.5f} {tables['follower'][i, k]:.5f} {tables['dead'][i, k]:.5f}"
            for k, axis in enumerate("xyz")
        ]
        print(f"{kpa:5d}   " + "   ".join(parts))
    for part in ("half y >= 0", "quarter"):
        for k, axis in enumerate("xy"):
            values = rows(model, histories["dead"], part)[:, k]
            print(f"dead pressure, {part}, {axis}: " + ", ".join(f"{v:.5f}" for v in values))
    for degree in (5, 7):
        least = rows(model, histories["follower"], degree=degree)[:, 1].min()
        print(f"follower pressure, full disk, degree {degree}: y {least:.5f} or more")
    for quads in MESHES:
        coarse = BubbleModel(
            disk_mesh(100.0, quads, "full"), model.thickness, model.pressures, model.increments
        )
        y = rows(coarse, MembraneSolver().run(coarse, law))[0, 1]
        print(f"follower pressure, {len(coarse.mesh.quads)} quads: y at 22 kPa {y:.4f}")
    places, values = cut(model, histories["follower"].displacement[0], 1)
    odd = np.stack([places, places**3], axis=1)
    left = values[:, 0] - odd @ np.linalg.lstsq(odd, values[:, 0], rcond=None)[0]
    share = 100 * (left**2).sum() / (values[:, 0] ** 2).sum()
    print(f"u_y on the fill axis at 22 kPa: the best odd cubic leaves {share:.1f} % of the squares")


if __name__ == "__main__":
    main()
