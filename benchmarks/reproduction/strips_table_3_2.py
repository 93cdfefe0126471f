"""Compare the thesis' Table 3.2 with its own load polynomials, reading by reading.

The thesis reports e_uniaxial = 50.1 N for these coefficients. RMS errors in N of Eqs 3.4 to 3.6.
"""

import sys
from dataclasses import replace
from pathlib import Path

import bubblefit as bf
import numpy as np
from bubblefit.solvers.membrane.solver import MembraneSolver

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))
from common import EXAMPLES, LAW_3_2

PUBLISHED = 50.1


def held(gamma):
    return replace(LAW_3_2, strain_range=np.array([0.153, 0.232, gamma]))


LAW = held(1.0)
THIN = {"thickness_change": "incompressible"}
READINGS = {
    "constant thickness, nu12 0.24 (the thesis' shells)": LAW,
    "incompressible thickness": replace(LAW, **THIN),
    "nu12 = 0: straight strips keep their width": replace(LAW, nu12=0.0),
    "nu12 = 0, incompressible": replace(LAW, nu12=0.0, **THIN),
    **{f"G12 held beyond shear {gamma:g}": held(gamma) for gamma in (0.555, 0.44, 0.3, 0.25)},
    "incompressible, G12 held beyond shear 0.555": replace(held(0.555), **THIN),
}


def main():
    (test,) = bf.read_project(EXAMPLES / "uniaxial-valmex7318" / "project.toml").tests.values()
    models = test.models()
    print(f"{'reading':<52}{'warp':>8}{'fill':>8}{'bias':>8}{'sum':>8}   thesis {PUBLISHED}")
    for reading, law in READINGS.items():
        errors = []
        for direction, model in models.items():
            history = MembraneSolver().run(model, law)
            target = test.strips[direction].polynomial(np.array(model.elongations))
            errors.append(float(np.sqrt(np.mean((history.load - target) ** 2))))
        print(f"{reading:<52}" + "".join(f"{e:>8.1f}" for e in [*errors, sum(errors)]))


if __name__ == "__main__":
    main()
