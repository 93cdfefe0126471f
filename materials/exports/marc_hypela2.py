"""MSC Marc: the law as user subroutine HYPELA2."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import numpy as np

from ...errors import InputError
from ...rendering import render
from ..card import MaterialCard
from ..law import HypoelasticLaw
from ..responses import bar
from .base import Export, Says, heading
from .formats import Format, NoOptions
from .fortran import double, law_constants, logical

#: STATE VARS, temperature included: strain, stress, and the transverse shears of thick shells.
STATE_VARIABLES = {"membrane": 7, "thick shell": 9}
#: Least transverse shear modulus of thick shells, MPa.
LEAST = 1e-3
#: The check of a licence holder: engineering strain of one element, in equal increments.
ELONGATION, INCREMENTS, SHEAR = 0.1, 100, 0.01

SAYS = Says(
    carries=(
        "the whole law: tangent moduli of log strain in any form, nu12, the range in which moduli "
        "hold",
    ),
    loses=("the transverse shear of thick shells is linear, with G12 at no strain",),
    confirm=("the conventions listed below; no Marc was at hand",),
)


def hypela2(card: MaterialCard, options: NoOptions) -> Export:
    """The subroutine for one card, whatever the number of its material in Marc."""
    head = heading(card, "MSC Marc user subroutine HYPELA2", SAYS, "!")
    return Export({".f": hypela2_source({1: card.law}, head)}, SAYS)


def hypela2_source(
    laws: Mapping[int, HypoelasticLaw],
    head: str = "! MSC Marc user subroutine HYPELA2",
    own_state: bool = True,
    symmetric: bool = True,
) -> str:
    """Fortran source, good as fixed and as free form.

    Parameters
    ----------
    laws : by user material identification number (MATUS(1)); a single one is for all numbers.
    head : comment lines.
    own_state : strain and stress at the start from state variables, else from Marc's e and s.
    symmetric : hand over the symmetric part of the tangent, as Marc's default solver needs.
    """
    written: list[dict[str, Any]] = [
        {
            "id": number,
            "constants": law_constants(law),
            "across": max(float(law.G12(0.0)), LEAST),
            "power": law.area_power,
        }
        for number, law in laws.items()
    ]
    return render(
        "marc/hypela2.f.j2",
        head=head,
        laws=written,
        bar=_check(next(iter(laws.values()))),
        power=next(iter(laws.values())).area_power,
        states=STATE_VARIABLES,
        size=max(len(law["constants"]) for law in written),
        own_state=own_state,
        symmetric=symmetric,
        double=double,
        fortran=logical,
    )


def _check(law: HypoelasticLaw) -> dict[str, Any] | None:
    """What one element has to answer; None where the law fails on the way."""
    elongation = float(np.expm1(min(np.log1p(ELONGATION), law.strain_range[0])))
    ends = np.log1p(elongation * np.arange(1, INCREMENTS + 1) / INCREMENTS)
    try:
        strain, stress = bar(law, 0, ends)
    except InputError:
        return None
    shear, _ = law.increment(np.zeros(3), np.array([0.0, 0.0, SHEAR]), np.zeros(3))
    thinning = math.exp((law.area_power - 1) * (strain[-1, 0] + strain[-1, 1]))
    return {
        "elongation": elongation,
        "increments": INCREMENTS,
        "stress": stress[-1, 0] * thinning,
        "shear": float(shear[0, 2]),
    }


FORMAT = Format("marc-hypela2", hypela2)
