"""Compare the thesis' Table 3.2 with its own load polynomials, reading by reading.

The thesis reports e_uniaxial = 50.1 N for these coefficients. RMS errors in N of Eqs 3.4 to 3.6.
"""

import argparse
from dataclasses import replace
from pathlib import Path

import bubblefit as bf
import numpy as np
from bubblefit.materials.law import HypoelasticLaw
from bubblefit.solvers.membrane.solver import MembraneSolver

# Thesis Table 3.2, GPa; beta_0 is garbled in the scan, its last digits are those of Table 4.2.
TABLE_3_2 = [
    -7.96599e-3, 7.49311e-1, -1.50931e-1, 2.05148e-2,
    -1.13743e1, 1.07160e1, -6.17621e-1, 1.41287e-1,
    -4.78030e2, 2.11227e2, -2.02600e1, 8.15340e-1,
]  # fmt: skip
PUBLISHED = 50.1
EXAMPLE = Path(__file__).parents[2] / "examples" / "uniaxial-valmex7318" / "project.toml"
LAW = HypoelasticLaw(1e3 * np.array(TABLE_3_2), strain_range=np.array([0.153, 0.232, 1.0]))


def held(gamma):
    return replace(LAW, strain_range=np.array([0.153, 0.232, gamma]))


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
    (test,) = bf.read_project(EXAMPLE).tests.values()
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
    argparse.ArgumentParser(description=__doc__).parse_args()
    main()
