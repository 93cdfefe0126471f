"""Moduli of a material card, from its file, by docs/reference/law.md.

A modulus is a function of the logarithmic strain along its direction (E1: along warp, E2: along
fill, G12: the absolute shear angle); outside the valid strains it keeps its end value.
"""

from itertools import pairwise

import numpy as np
from scipy.interpolate import CubicSpline

MODULI = ("E1", "E2", "G12")
DIRECTION = {"E1": "warp", "E2": "fill", "G12": "shear"}
#: Order of the blocks of beta.
BLOCKS = ("G12", "E2", "E1")
MPA = {"GPa": 1000.0, "MPa": 1.0, "kPa": 1e-3, "Pa": 1e-6, "N/mm^2": 1.0, "N/mm2": 1.0}
POLYNOMIALS = ("constant", "linear", "quadratic", "cubic")


class Law:
    """A law with its thickness (mm).

    Attributes
    ----------
    beta : coefficients in the unit of the card.
    ends : valid strain by modulus, the upper end.
    """

    def __init__(self, form, beta, *, unit, nu12, thickness, ends, knots=None, breaks=None):
        self.form, self.unit, self.nu12, self.thickness = form, unit, nu12, thickness
        self.beta = np.array(beta, dtype=float)
        self.ends, self.knots, self.breaks = ends, knots, breaks

    @classmethod
    def of_card(cls, card):
        """Return the law of a card as TOML."""
        valid = card.get("valid_strain", {})
        ends = {name: valid.get(key, [0.0, np.inf])[1] for name, key in DIRECTION.items()}
        return cls(
            card.get("form", "cubic"),
            card["beta"],
            unit=card.get("unit", "GPa"),
            nu12=card.get("nu12", 0.24),
            thickness=card["thickness_mm"],
            ends=ends,
            knots=card.get("knots"),
            breaks=card.get("breaks"),
        )

    @property
    def mpa(self):
        """MPa of one unit of the card."""
        return MPA[self.unit]

    def modulus(self, name, strain, beta=None):
        """Return a modulus in MPa at strains; beta : other coefficients, unit of the card."""
        beta = self.beta if beta is None else np.asarray(beta, dtype=float)
        strain = np.clip(np.asarray(strain, dtype=float), 0.0, self.ends[name])
        return self.mpa * self._value(name, strain, beta)

    def modulus_beyond(self, name, strain, beta):
        """Return a modulus in MPa at strains, also beyond the valid ones of the card."""
        return self.mpa * self._value(name, np.asarray(strain, dtype=float), np.asarray(beta))

    def rows(self, name, strain):
        """Return (strains, coefficients): derivatives of a modulus (unit of the card) by beta."""
        unit = np.eye(len(self.beta))
        strain = np.clip(np.atleast_1d(np.asarray(strain, dtype=float)), 0.0, self.ends[name])
        return np.stack([self._value(name, strain, one) for one in unit], axis=-1)

    def _value(self, name, strain, beta):
        if self.form in POLYNOMIALS:
            start = 4 * BLOCKS.index(name)
            return np.polyval(beta[start : start + 4], strain)
        if self.form == "trilinear":
            start = 4 * BLOCKS.index(name)
            first, second = self.breaks[DIRECTION[name]]
            third_region, middle, first_region = beta[start + 1 : start + 4]
            beyond = np.where(strain <= second, middle, third_region)
            return np.where(strain <= first, first_region, beyond)
        if self.form in ("spline", "spline-ratio", "spline-crimp"):
            start = 0
            for block in BLOCKS:
                knots = self.knots[DIRECTION[block]]
                if block == name:
                    values = beta[start : start + len(knots)]
                    return _spline(knots, values, strain)
                start += len(knots)
        if self.form == "load-ratio":
            return np.full(np.shape(strain), beta[{"G12": 0, "E2": 1, "E1": 3}[name]])
        raise ValueError(f"the form {self.form!r} has no definition here")

    @property
    def labels(self):
        """Names of the coefficients that are free, in the order of beta."""
        if self.form in POLYNOMIALS:
            least = 3 - POLYNOMIALS.index(self.form)
            return [f"beta_{4 * block + k}" for block in range(3) for k in range(least, 4)]
        if self.form == "trilinear":
            return [f"beta_{k}" for k in (1, 2, 3, 5, 6, 7, 9, 10, 11)]
        if self.form == "load-ratio":
            return ["G12", "E2 at 1:1", "dE2", "E1 at 1:1", "dE1"]
        names = []
        for block in BLOCKS:
            knots = self.knots[DIRECTION[block]]
            digits = next(
                n for n in range(3, 18) if len({f"{k:.{n}f}" for k in knots}) == len(knots)
            )
            names += [f"{block} at {knot:.{digits}f}" for knot in knots]
        return names

    @property
    def free(self):
        """Numbers of the free coefficients within beta."""
        if self.form in (*POLYNOMIALS, "trilinear"):
            return [int(label.removeprefix("beta_")) for label in self.labels]
        return list(range(len(self.labels)))


def _spline(knots, values, strain):
    """Return a line through two knots, a parabola through three, else a not-a-knot spline."""
    strain = np.clip(strain, knots[0], knots[-1])
    if len(knots) <= 3:
        return np.polyval(np.polyfit(knots, values, len(knots) - 1), strain)
    assert all(a < b for a, b in pairwise(knots))
    return CubicSpline(knots, values, bc_type="not-a-knot")(strain)
