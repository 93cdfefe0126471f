"""Fortran subroutines as their host programs would load them: compiled, called through ctypes."""

import ctypes
import shutil
import subprocess

import numpy as np
import pytest
from bubblefit.materials.law import HypoelasticLaw

# Table 4.2, MPa.
BETA = 1e3 * np.array(
    [-7.96788e-3, 0.710747, -0.156912, 0.0200439, -10.6241, 13.7830, -0.931830, 0.139437,
     -479.622, 212.650, -20.2028, 0.806350]
)  # fmt: skip
MODULI = ((800.0, 450.0, 900.0), (140.0, 110.0, 240.0), (20.0, 14.0, 40.0))
BREAKS = [[0.01, 0.03], [0.02, 0.06], [0.01, 0.04]]


def trilinear(**options):
    return HypoelasticLaw.trilinear(*MODULI, BREAKS, **options)


LAWS = {
    "cubic": HypoelasticLaw(BETA, strain_range=np.full(3, 0.13)),
    "held": HypoelasticLaw(BETA, strain_range=np.array([0.02, 0.03, 0.04])),
    "other nu12": HypoelasticLaw(BETA, 0.3, np.full(3, 0.13)),
    "linear": HypoelasticLaw.linear(800.0, 140.0, 20.0),
    "incompressible": HypoelasticLaw(BETA, 0.24, np.full(3, 0.13), "incompressible"),
    "tri-linear": trilinear(),
    # The fill range ends before its second break, the shear range before its first.
    "tri-linear, held": trilinear(strain_range=[0.13, 0.05, 0.008]),
}


def build(folder, source, *flags, beside=""):
    """Compile the text `source` (and `beside`, what the host program has) into a library.

    Skips where there is no gfortran.
    """
    compiler = shutil.which("gfortran")
    if compiler is None:
        pytest.skip("no Fortran compiler: install gfortran")
    folder.mkdir(parents=True, exist_ok=True)
    names = []
    for name, text in (("law.f", source), ("host.f", beside)):
        (folder / name).write_text(text)
        names.append(name)
    done = subprocess.run(
        [compiler, "-O2", "-ffp-contract=off", "-fPIC", "-shared", "-fimplicit-none", "-Wall",
         "-Wno-unused-dummy-argument", *flags, *names, "-o", "law.so"],
        cwd=folder, capture_output=True, text=True,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    assert "Warning" not in done.stderr, done.stderr
    return ctypes.CDLL(str(folder / "law.so"))


def reals(*values):
    return np.array(values, dtype=float)


def address(array):
    return array.ctypes.data_as(ctypes.c_void_p)


def strain_path(seed, steps=9):
    """(steps, 3) log strains of a walk that loads, unloads, shears both ways and turns back."""
    random = np.random.default_rng(seed)
    walk = np.cumsum(random.normal(0.003, 0.012, (steps, 3)), axis=0)
    walk[:, 2] = np.cumsum(random.normal(0.0, 0.02, steps))
    return walk


def close(found, wanted, tolerance=1e-11):
    np.testing.assert_allclose(found, wanted, rtol=0, atol=tolerance * np.abs(wanted).max())
