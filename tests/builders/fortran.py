"""Fortran subroutines as their host programs would load them: compiled, called through ctypes."""

import ctypes
import subprocess

import numpy as np
from bubblefit.materials.forms.spline import Spline
from bubblefit.materials.law import HypoelasticLaw

from ..marc_stand_in.laws import piecewise_law
from ..support import needs
from .laws import TABLE_4_2

# MPa.
BETA = 1e3 * np.array(TABLE_4_2)
MODULI = ((800.0, 450.0, 900.0), (140.0, 110.0, 240.0), (20.0, 14.0, 40.0))
BREAKS = [[0.01, 0.03], [0.02, 0.06], [0.01, 0.04]]


def trilinear(**options):
    return HypoelasticLaw.trilinear(*MODULI, BREAKS, **options)


def reals(*values):
    return np.array(values, dtype=float)


KNOTS = (np.linspace(0, 0.13, 6), (0, 0.02, 0.05, 0.13), np.linspace(0, 0.11, 8))


def spline(**options):
    """Splines of 6, 4 and 8 knots, as even and as uneven as they come."""
    g12, e2 = [20, 14, 12, 15, 22, 33, 41, 44], [140, 120, 190, 260]
    values = reals(*g12, *e2, 800, 430, 380, 620, 1100, 1300)
    form, ends = Spline.at([list(knots) for knots in KNOTS]), [0.13, 0.13, 0.11]
    return HypoelasticLaw(values, strain_range=ends, form=form, **options)


#: A modulus of every kind of piece: one that jumps, one with a kink, one of a single piece.
MIXED = (
    [[0.01, 0, 0, -9e3, 800.0], [0.04, 0, 5e4, 0, 500.0], [0.13, -4e4, 0, 3e3, 600.0]],
    [[0.03, 0, 0, -1e3, 140.0], [0.12, 0, 0, 2e3, 50.0]],
    [[0.1, 0, 0, 300.0, 15.0]],
)
LAWS = {
    "cubic": HypoelasticLaw(BETA, strain_range=np.full(3, 0.13)),
    "held": HypoelasticLaw(BETA, strain_range=np.array([0.02, 0.03, 0.04])),
    "other nu12": HypoelasticLaw(BETA, 0.3, np.full(3, 0.13)),
    "linear": HypoelasticLaw.linear(800.0, 140.0, 20.0),
    "incompressible": HypoelasticLaw(BETA, 0.24, np.full(3, 0.13), "incompressible"),
    "tri-linear": trilinear(),
    # The fill range ends before its second break, the shear range before its first.
    "tri-linear, held": trilinear(strain_range=[0.13, 0.05, 0.008]),
    "spline": spline(),
    "spline, incompressible": spline(thickness_change="incompressible"),
    "jumps and kinks": piecewise_law(*MIXED),
}
#: E1 is gone at 5 % of strain along the warp.
GONE = HypoelasticLaw(np.r_[0, 0, 0, 20.0, 0, 0, 0, 100.0, 0, 0, -1e4, 500.0])


def build(folder, source, *flags, beside=""):
    """Compile the text `source` (and `beside`, what the host program has) into a library."""
    compiler = needs.fortran()
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


def address(array):
    return array.ctypes.data_as(ctypes.c_void_p)


def strain_path(seed, steps=9):
    """(steps, 3) log strains of a walk that loads, unloads, shears both ways and turns back."""
    random = np.random.default_rng(seed)
    walk = np.cumsum(random.normal(0.003, 0.012, (steps, 3)), axis=0)
    walk[:, 2] = np.cumsum(random.normal(0.0, 0.02, steps))
    return walk


#: Sizes of increments of strain: from a whole test to less than rounding.
SIZES = (0.1, 1e-3, 1e-6, 1e-9, 1e-13)


def increments_everywhere(law, size, seed=0):
    """Strains (3,) before and after increments of about this size, from everywhere there is.

    At zero, at the end of every piece and within it, in compression, beyond the range, and with
    shear of both signs.
    """
    random = np.random.default_rng(seed)
    ends = [np.minimum(curve[:, 0], 0.2) for curve in law.pieces]
    for _ in range(40):
        places = [random.choice([0.0, -0.02, *curve, *(0.9 * curve), 1.2 * curve[-1]])
                  for curve in ends]  # fmt: skip
        places[2] *= random.choice([-1, 1])
        old, new = np.array(places) + size * random.uniform(-1, 1, (2, 3))
        # Programs are given the increment: the sum of it and the start is the end.
        yield old, old + (new - old)


def close(found, wanted, tolerance=1e-11):
    np.testing.assert_allclose(found, wanted, rtol=0, atol=tolerance * np.abs(wanted).max())
