"""The hypoelastic orthotropic law, vectorised over integration points.

d sigma = D(eps) d eps in the convected warp/fill frame, with TANGENT moduli that depend on the
logarithmic strain component in their own direction: G12 on |gamma12|, E2 on eps2, E1 on eps1.
The law's form (materials/forms/) says how the coefficients beta make these three curves. In the
cubic form, with g = |gamma12|, e1 = eps1, e2 = eps2,

    G12 = b0 g^3 + b1 g^2 + b2 g + b3,  E2 = b4 e2^3 + ... + b7,  E1 = b8 e1^3 + ... + b11.

nu21 = nu12 E2/E1; the stress is Cauchy stress in the material frame. An increment has the mean of
each modulus over its own strain increment (`pieces.increment_modulus`).
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Literal, Self

import numpy as np
from numpy.typing import ArrayLike

from ..compilation import compiled
from ..errors import InputError
from ..wording import html_table
from .forms.base import (
    COMPONENTS,
    EVEN,
    RATIO_ENDS,
    SHEAR,
    UNLIMITED,
    Array,
    LawForm,
    crimp_map,
    held_strain,
    map_in_range,
    modulus_rows,
    pieces_of,
    ratio_map,
)
from .forms.polynomial import CONSTANT, CUBIC
from .forms.spline import TriLinear
from .forms.symmetry import at_nu12, modulus_labels
from .memory import NAMES, PLAIN, Memory
from .pieces import (
    CauchyGreen,
    CompiledLaw,
    Coupling,
    LawSlopes,
    LawTangent,
    PointState,
    point_response,
)
from .point_law import membrane_stress, stress_update

ThicknessChange = Literal["constant", "incompressible"]
__all__ = ["COMPONENTS", "UNLIMITED", "HypoelasticLaw", "ThicknessChange"]
#: Relative change of a modulus at the end of a piece from which on it counts as a jump.
JUMP = 1e-6


@dataclass(frozen=True, eq=False)
class HypoelasticLaw:
    """A material law of a coated fabric: tangent moduli, Poisson's ratio, and perhaps a memory.

    Parameters
    ----------
    beta : (size,) array_like, MPa
        Coefficients, as the form takes them.
    nu12 : float
        Poisson's ratio, 0 to below 1.
    strain_range : (3,) array_like, optional
        Ends of the log strains (eps1, eps2, gamma12). Beyond its end and below zero a modulus is
        constant; without a range it follows its form up to any strain.
    thickness_change : {"constant", "incompressible"}
        "constant": the thickness stays that at rest, t0, as in shells that keep it;
        "incompressible": it is t0 / area ratio.
    form : LawForm
        How the coefficients make the moduli; an isotropic one takes the law's Poisson's ratio.
    memory : Memory, optional
        Constants of unloading and reloading (`memory.py`); without them loading, unloading and
        reloading follow the same curve.

    Attributes
    ----------
    pieces : (3, P, 5) ndarray, MPa
        The moduli as piecewise cubics (`forms.base.pieces_of`).

    Raises
    ------
    InputError
        For coefficients, a strain range, nu12, an option or a memory that a law cannot have.
    """

    beta: Array
    nu12: float = 0.24
    strain_range: Array = None  # type: ignore[assignment]
    thickness_change: ThicknessChange = "constant"
    form: LawForm = CUBIC
    memory: Memory | None = None
    pieces: Array = field(init=False, repr=False)

    def __post_init__(self) -> None:
        beta = self._checked_beta()
        range_or_none = [UNLIMITED] * 3 if self.strain_range is None else self.strain_range
        ends = np.array(range_or_none, dtype=float)
        if ends.shape != (3,) or not (ends > 0).all():
            problem = f"expected 3 positive ends (eps1, eps2, gamma12), got {ends}"
            raise InputError(None, "strain_range", problem)
        if not 0 <= self.nu12 < 1:
            raise InputError(None, "nu12", f"expected 0 <= nu12 < 1, got {self.nu12}")
        if self.thickness_change not in ("constant", "incompressible"):
            problem = f"expected 'constant' or 'incompressible', got {self.thickness_change!r}"
            raise InputError(None, "thickness_change", problem)
        if self.memory is not None and len(crimp_map(self.form)):
            raise InputError(None, "memory", f"a {self.form.name} law has none")
        form = at_nu12(self.form, self.nu12)
        pieces = pieces_of(form, beta, ends.tolist())
        beta.flags.writeable = False
        ends.flags.writeable = False
        values = {"beta": beta, "strain_range": ends, "form": form, "pieces": pieces}
        for name, value in values.items():
            object.__setattr__(self, name, value)

    def _checked_beta(self) -> Array:
        """Return a copy of the coefficients; InputError if their number, or one of them, is wrong.

        Wrong is one that the form does not use and that is not zero.
        """
        form = self.form
        beta = np.array(self.beta, dtype=float)
        if beta.shape != (form.size,) or not np.isfinite(beta).all():
            problem = f"expected {form.size} finite coefficients, got shape {beta.shape}"
            raise InputError(None, "beta", problem)
        surplus = [i for i in range(form.size) if i not in form.free and beta[i] != 0.0]
        if surplus:
            names = ", ".join(form.labels[i] for i in surplus)
            values = ", ".join(f"{beta[i]:g}" for i in surplus)
            problem = f"a {form.name} law has no {names}: expected 0, got {values}"
            raise InputError(None, "beta", problem)
        return beta

    @classmethod
    def linear(
        cls,
        e1: float,
        e2: float,
        g12: float,
        nu12: float = 0.24,
        thickness_change: ThicknessChange = "constant",
    ) -> Self:
        """Return the law of constant moduli (MPa)."""
        beta = np.zeros(12)
        beta[[3, 7, 11]] = g12, e2, e1
        return cls(beta, nu12, None, thickness_change, CONSTANT)  # type: ignore[arg-type]

    @classmethod
    def trilinear(
        cls,
        e1: Sequence[float],
        e2: Sequence[float],
        g12: Sequence[float],
        breaks: ArrayLike,
        nu12: float = 0.24,
        strain_range: ArrayLike | None = None,
        thickness_change: ThicknessChange = "constant",
    ) -> Self:
        """Return the law of moduli that are constant in three regions of their strain.

        Parameters
        ----------
        e1, e2, g12 : (3,) sequence of float, MPa
        breaks : (3, 2) array_like
            Log strains between the regions, two for each of (eps1, eps2, gamma12).
        nu12, strain_range, thickness_change
            See the class.
        """
        for name, values in (("E1", e1), ("E2", e2), ("G12", g12)):
            if np.shape(values) != (3,):
                raise InputError(None, name, f"expected 3 moduli, got {values}")
        beta = np.zeros(12)
        beta[[3, 2, 1, 7, 6, 5, 11, 10, 9]] = (*g12, *e2, *e1)
        return cls(beta, nu12, strain_range, thickness_change, TriLinear.at(breaks))  # type: ignore[arg-type]

    @cached_property
    def jumps(self) -> bool:
        """Return whether a modulus jumps somewhere in the strain range."""
        left_pieces = self.pieces[:, :-1, 1:]
        right_pieces = self.pieces[:, 1:, 1:]
        powers = self.pieces[:, :-1, :1] ** [3, 2, 1, 0]
        left = (left_pieces * powers).sum(axis=-1)
        right = (right_pieces * powers).sum(axis=-1)
        size = np.maximum(np.abs(left), np.abs(right))
        return bool((np.abs(right - left) > JUMP * size).any())

    @cached_property
    def coupling(self) -> Coupling:
        """Return all constants beside the pieces of the moduli, as `CompiledLaw.coupling`.

        They are nu12, the gains (MPa) of E1 and E2 by their load ratios, then T1, T2 and S (MPa) of
        a law with crimp, or the constants of the memory.
        """
        maps = np.concatenate([ratio_map(self.form), crimp_map(self.form)])
        remembered = () if self.memory is None else self.memory.constants
        return (self.nu12, *(maps @ self.beta).tolist(), *remembered)

    @cached_property
    def compiled(self) -> CompiledLaw:
        """Return the constants as compiled functions take them."""
        return CompiledLaw(self.pieces, self.coupling, self.area_power)

    @property
    def state(self) -> int:
        """Return the number of entries of a strain vector: 3, or 9 with a memory (`memory.py`)."""
        return PLAIN if self.memory is None else 3 * PLAIN

    @property
    def area_power(self) -> float:
        """Return the power of the area ratio in J sigma: 1 constant, 0 incompressible thickness."""
        return 1.0 if self.thickness_change == "constant" else 0.0

    def number(self, name: str) -> float:
        """Return a constant by its name: "nu12", or one of the memory as in `memory.NAMES`."""
        if name == "nu12":
            return self.nu12
        return float(self.coupling[PLAIN + NAMES.index(name)])

    def with_numbers(self, beta: ArrayLike, numbers: Mapping[str, float]) -> Self:
        """Return the law with other coefficients and other constants, by the names of `number`."""
        memory = self.memory
        if memory is not None:
            memory = memory.with_constants({n: x for n, x in numbers.items() if n in NAMES})
        nu12 = numbers.get("nu12", self.nu12)
        return replace(self, beta=np.asarray(beta, float), nu12=nu12, memory=memory)

    def with_beta(self, beta: ArrayLike) -> Self:
        """Return the law with other coefficients (size,), MPa."""
        return replace(self, beta=np.asarray(beta, dtype=float))

    def modulus(self, name: str, strain: ArrayLike, ratio: float = EVEN) -> Array:
        """Return a tangent modulus (MPa) at log strains.

        Parameters
        ----------
        name : str
            "E1", "E2" or "G12".
        strain : array_like
            Log strains, of any shape, which is that of the result.
        ratio : float
            Normalised load ratio of the yarns of E1 or E2, on which a few forms depend.
        """
        pieces = self.pieces[COMPONENTS[name]]
        strain_in_range = held_strain(COMPONENTS[name], strain, pieces[-1, 0])
        c = pieces[np.searchsorted(pieces[:-1, 0], strain_in_range), 1:]
        at_even_loads = (
            (c[..., 0] * strain_in_range + c[..., 1]) * strain_in_range + c[..., 2]
        ) * strain_in_range + c[..., 3]
        gain = 0.0 if name == SHEAR else self.coupling[1 + COMPONENTS[name]]
        return at_even_loads + (ratio - EVEN) * gain

    def modulus_rows(self, name: str, strain: ArrayLike, ratio: float = EVEN) -> Array:
        """Return (n, size), d modulus / d beta at log strains (n,), also outside the range."""
        return modulus_rows(self.form, name, strain, self.strain_range.tolist(), ratio)

    def __repr__(self) -> str:
        return f"{self.form.name} law, nu12 {self.nu12:g}: {self.moduli_words()}"

    def moduli_words(self) -> str:
        """Return the moduli without strain and at the end of the strain range in words."""
        words = []
        for name, label in modulus_labels(self.form).items():
            end = float(self.strain_range[COMPONENTS[name]])
            modulus = f"{label} {self.modulus(name, 0.0):.4g}"
            if end < UNLIMITED:
                words.append(f"{modulus} to {self.modulus(name, end):.4g} MPa at {100 * end:.3g} %")
            else:
                words.append(f"{modulus} MPa")
        return "; ".join(words)

    def _repr_html_(self) -> str:
        return moduli_html(self, f"{self.form.name} law, nu12 {self.nu12:g}")

    @property
    def of_load_ratio(self) -> bool:
        """Return whether stiffness may depend on the ratio of the loads along warp and fill."""
        return bool(ratio_map(self.form).any() or len(crimp_map(self.form)))

    def E1(self, strain: ArrayLike) -> Array:
        """Return the tangent modulus along the warp (MPa) at log strains of any shape."""
        return self.modulus("E1", strain)

    def E2(self, strain: ArrayLike) -> Array:
        """Return the tangent modulus along the fill (MPa) at log strains of any shape."""
        return self.modulus("E2", strain)

    def G12(self, strain: ArrayLike) -> Array:
        """Return the tangent shear modulus (MPa) at shear strains of any shape."""
        return self.modulus("G12", strain)

    def increment(
        self, strain_old: ArrayLike, strain_new: ArrayLike, stress_old: ArrayLike
    ) -> tuple[Array, Array]:
        """Return stress (n, 3) MPa and tangent (n, 3, 3) MPa after an increment of first loading.

        Both results are NaN where the law has no stress.

        Parameters
        ----------
        strain_old, strain_new : (n, 3) array_like
            Log strain.
        stress_old : (n, 3) array_like, MPa
            Cauchy stress.
        """
        old = np.atleast_2d(np.asarray(strain_old, dtype=float))[:, :PLAIN]
        return self.follow(old, strain_new, stress_old)[:2]

    def follow(
        self, state: ArrayLike, strain: ArrayLike, stress: ArrayLike
    ) -> tuple[Array, Array, Array]:
        """Return stress, tangent and state after an increment of any history.

        Parameters
        ----------
        state : (n, 3) or (n, 9) array_like
            Log strain before the increment, or the state that the previous call returned.
        strain : (n, 3) array_like
            Log strain at the end of the increment.
        stress : (n, 3) array_like, MPa
            Cauchy stress before the increment.

        Returns
        -------
        stress : (n, 3) ndarray, MPa
        tangent : (n, 3, 3) ndarray, MPa
            d stress / d strain; both are NaN where the law has no stress.
        state : (n, 3) or (n, 9) ndarray
        """
        old = self._padded(state)
        new = self._padded(strain)
        stress_old = np.ascontiguousarray(np.atleast_2d(stress), dtype=float)
        return (*_increments(self.compiled, old, new, stress_old), new)

    def _padded(self, strain: ArrayLike) -> Array:
        """Return (n, state) with zeros of what is not given."""
        rows = np.atleast_2d(np.asarray(strain, dtype=float))[:, : self.state]
        padded = np.zeros((len(rows), self.state))
        padded[:, : rows.shape[1]] = rows
        return padded

    def second_piola_kirchhoff(
        self,
        gradient: ArrayLike,
        strain_old: ArrayLike | None = None,
        stress_old: ArrayLike | None = None,
    ) -> tuple[Array, Array, Array, Array]:
        """Return 2nd Piola-Kirchhoff stress after an increment.

        Parameters
        ----------
        gradient : (n, 2, 2) or (n, 3, 2) array_like
            Its columns are the images of the unit warp and fill vectors.
        strain_old : (n, 3) or (n, 9) array_like, optional
            State of the last call; zero by default.
        stress_old : (n, 3) array_like, MPa, optional
            Corotated stress of the last call; zero by default.

        Returns
        -------
        pk2 : (n, 3) ndarray, MPa
        stiffness : (n, 3, 3) ndarray, MPa
            d(pk2)/dE.
        state : (n, 3) or (n, 9) ndarray
            Log strain, then what a memory keeps.
        stress : (n, 3) ndarray, MPa
            Corotated Cauchy stress.
        """
        f = np.asarray(gradient, dtype=float)
        right = np.einsum("nki,nkj->nij", f, f)
        zero = np.zeros((len(f), 3))
        state_before = zero if strain_old is None else np.asarray(strain_old, dtype=float)
        old = np.pad(state_before, ((0, 0), (0, self.state - state_before.shape[1])))
        stress = zero if stress_old is None else np.ascontiguousarray(stress_old, dtype=float)
        return _pull_backs(self.compiled, right, old, stress)


def moduli_html(
    law: HypoelasticLaw,
    caption: str,
    band: Callable[[str, Array], tuple[Array, Array]] | None = None,
    level: str = "",
) -> str:
    """Return an HTML table of the moduli at zero strain, halfway to and at the end of the range.

    Parameters
    ----------
    band : callable or None
        Function of the name of a modulus and log strains (n,) that returns the ends of its band.
    level : str
        Heading of the band's column, as "95 %".
    """
    rows: list[list[object]] = []
    for name, label in modulus_labels(law.form).items():
        end = float(law.strain_range[COMPONENTS[name]])
        strain = end * np.array([0.0, 0.5, 1.0]) if end < UNLIMITED else np.zeros(1)
        ends = [""] * len(strain)
        if band is not None:
            pairs = zip(*band(name, strain), strict=True)
            ends = [f"{low:.4g} to {high:.4g}" for low, high in pairs]
        values = zip(strain, law.modulus(name, strain), ends, strict=True)
        rows += [
            [label, f"{100 * x:.3g} %", f"{value:.4g}", band_text] for x, value, band_text in values
        ]
    return html_table(caption, ["", "strain", "MPa", level], rows)


@compiled()
def _increments(  # type: ignore[no-untyped-def]
    law,
    old,
    new,
    stress_old,
):
    """Return stress (n, 3) and tangent (n, 3, 3), MPa, after an increment of first loading.

    Both are NaN where the law has no stress. old, new : (n, 3) log strains.
    """
    n = len(old)
    stress = np.empty((n, 3))
    tangent = np.empty((n, 3, 3))
    slopes = point_response().law.slopes
    for i in range(n):
        before = PointState(old[i], stress_old[i])
        after = PointState(new[i], stress[i])
        if not stress_update(law, before, after, LawTangent(tangent[i], slopes)):
            stress[i] = np.nan
            tangent[i] = np.nan
    return stress, tangent


@compiled()
def _pull_backs(  # type: ignore[no-untyped-def]
    law,
    right,
    old,
    stress_old,
):
    """Return 2nd Piola-Kirchhoff stress and its tangent, strain and stress of a membrane.

    All are NaN where the law has no stress.

    Parameters
    ----------
    law : CompiledLaw
    right : (n, 2, 2) array
        Right Cauchy-Green tensors after the increment.
    old, stress_old : (n, law.state) and (n, 3) arrays
        Log strains (with what a memory adds) and Cauchy stresses (MPa) before it.
    """
    n = len(right)
    pk2 = np.empty((n, 3))
    stiffness = np.empty((n, 3, 3))
    strain = np.empty((n, old.shape[1]))
    stress = np.empty((n, 3))
    response = point_response()
    for i in range(n):
        m = 0.5 * (right[i, 0, 0] + right[i, 1, 1])
        q = 0.5 * (right[i, 0, 0] - right[i, 1, 1])
        green = CauchyGreen(m, q, right[i, 0, 1])
        before = PointState(old[i], stress_old[i])
        after = PointState(strain[i], stress[i])
        if membrane_stress(law, green, before, after, response):
            pk2[i] = response.pk2
            stiffness[i] = response.stiffness
        else:
            pk2[i] = np.nan
            stiffness[i] = np.nan
            strain[i] = np.nan
            stress[i] = np.nan
    return pk2, stiffness, strain, stress


def law_slopes(law: HypoelasticLaw, parameters: Sequence[str], thickness: float) -> LawSlopes:
    """Return derivatives of a law's constants by parameters: of the pieces and of `law.coupling`.

    Parameters
    ----------
    law : HypoelasticLaw
    parameters : sequence of str
        "beta_i" (MPa), "nu12" at constant moduli, one of `memory.NAMES`, or "thickness" (mm);
        derivatives by any other are zero. For the thickness they are those of moduli times
        thickness, over the thickness.
    thickness : float, mm
        Thickness at rest.
    """
    of_beta = map_in_range(law.form, law.strain_range.tolist())
    rows = np.zeros((*of_beta.shape[:3], len(parameters)))
    coupling = np.zeros((len(law.coupling), len(parameters)))
    # What is in MPa beside the moduli: gains, and constants of crimp.
    gains = np.vstack([ratio_map(law.form), crimp_map(law.form)])
    of_gains = slice(1, 1 + len(gains))
    for j, name in enumerate(parameters):
        if name.startswith("beta_"):
            place = int(name.removeprefix("beta_"))
            rows[..., j] = of_beta[..., place]
            coupling[of_gains, j] = gains[:, place]
        elif name == "nu12":
            coupling[0, j] = 1.0
        elif name in NAMES and law.memory is not None:
            coupling[PLAIN + NAMES.index(name), j] = 1.0
        elif name == "thickness":
            # Loads are moduli times thickness: a thicker sheet is strained as a stiffer one is
            # (its stress is another, but nothing that takes this derivative uses the stress).
            rows[..., j] = of_beta @ law.beta / thickness
            coupling[of_gains, j] = np.array(law.coupling[of_gains]) / thickness
    return LawSlopes(rows, coupling)


def law_beside(law: HypoelasticLaw, name: str, change: float) -> HypoelasticLaw:
    """Return a law with an entry of beta ("beta_i", MPa) or "nu12" changed by `change`."""
    if name == "nu12":
        return replace(law, nu12=abs(law.nu12 + change))
    beta = law.beta.copy()
    beta[int(name.removeprefix("beta_"))] += change
    return law.with_beta(beta)


def usual_step(
    law: HypoelasticLaw,
    name: str,
    thickness: float,
    share: float,
) -> float:
    """Return a step of a parameter of `law_slopes` that changes moduli by a share of their size."""
    powers = law.pieces[..., :1] ** np.arange(3.0, -1.0, -1.0)
    rows = law_slopes(law, [name], thickness).rows[..., 0] * powers
    size = np.abs((law.pieces[..., 1:] * powers).sum(axis=-1)).max()
    return float(share * (size / np.abs(rows).max() if rows.any() else 1.0))


def definite_rows(
    form: LawForm,
    nu12: float,
    strain_range: Sequence[float],
    margin: float = 1.02,
) -> Array:
    """Return (n, size) rows so that the law is definite in uniaxial tension where rows @ beta >= 0.

    A law is positive definite while E1 E2 > (nu12 E2)^2. A strip in tension contracts across, so
    that the modulus across is that at zero strain: E1(0) > nu12^2 E2(eps2) in tension along the
    fill, E1(eps1) > nu12^2 E2(0) along the warp. Moduli that depend on the load ratio are taken at
    that of the tension, and at equal loads, where every path begins.

    Parameters
    ----------
    form : LawForm
    nu12 : float
    strain_range : (3,) sequence of float
        Ends of the log strains (eps1, eps2, gamma12) up to which it holds.
    margin : float
        Least allowed value of E1 / (nu12^2 E2).
    """
    share = margin * nu12**2
    none, alone = RATIO_ENDS

    def rows(name: str, strain: ArrayLike, ratio: float) -> Array:
        return modulus_rows(form, name, strain, strain_range, ratio)

    warp, fill = (form.grid(k, strain_range[k]) for k in range(2))
    return np.vstack(
        [
            rows("E1", [0.0], none) - share * rows("E2", fill, alone),
            rows("E1", warp, alone) - share * rows("E2", [0.0], none),
            rows("E1", [0.0], EVEN) - share * rows("E2", [0.0], EVEN),
        ]
    )
