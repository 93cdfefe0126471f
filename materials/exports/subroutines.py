"""Export the law as user subroutines (Marc HYPELA2, Abaqus UMAT), and as Marc's NLELAST tables."""

import math
from collections.abc import Mapping
from typing import Any

import numpy as np

from ...errors import InputError
from ...storage.templates import render
from ..card import MaterialCard
from ..deformation_curves import bar
from ..law import HypoelasticLaw
from ..modulus_tables import JUMP, ModulusTable, modulus_tables
from . import base
from .curves import material_name

#: STATE VARS, temperature included: strain, stress, and the transverse shears of thick shells.
STATE_VARIABLES = {"membrane": 7, "thick shell": 9}
#: Least transverse shear modulus of thick shells, MPa.
SMALLEST_MODULUS = 1e-3
#: The check of a licence holder: engineering strain of one element, in equal increments.
ELONGATION = 0.1
SHEAR = 0.01
INCREMENTS = 100
SUBROUTINE_REMARKS = base.ExportRemarks(
    carries=(
        "the whole law: tangent moduli of log strain in any form, nu12, the range in which moduli "
        "hold",
    ),
    loses=("the transverse shear of thick shells is linear, with G12 at no strain",),
    confirm=("the conventions listed below; no Marc was at hand",),
)


def hypela2(card: MaterialCard, options: base.UnitsOptions) -> base.Export:
    """Write the subroutine for one card, whatever the number of its material in Marc."""
    units = options.unit_system
    head = base.heading(card, "MSC Marc user subroutine HYPELA2", SUBROUTINE_REMARKS, "!", units)
    return base.Export({".f": hypela2_source({1: card.law}, head, units=units)}, SUBROUTINE_REMARKS)


def hypela2_source(
    laws: Mapping[int, HypoelasticLaw],
    head: str = "! MSC Marc user subroutine HYPELA2",
    own_state: bool = True,
    symmetric: bool = True,
    units: base.UnitSystem = base.MILLIMETRES,
) -> str:
    """Return Fortran source of the subroutine, in fixed and free form at once.

    Parameters
    ----------
    laws : mapping of int to HypoelasticLaw
        Laws by MATUS(1), the number of the material; one law is used for all numbers.
    head : str
        First line of the source, a comment.
    own_state : bool
        Whether an increment starts from state variables, else from Marc's strain and stress.
    symmetric : bool
        Whether only the symmetric part of the tangent is passed on.
    units : base.UnitSystem
        Of the laws.
    """
    written: list[dict[str, Any]] = [
        {
            "id": number,
            "constants": base.law_constants(law),
            "across": max(float(law.G12(0.0)), SMALLEST_MODULUS / units.megapascals),
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
        units=units,
        double=base.double,
        fortran=base.logical,
    )


def _check(law: HypoelasticLaw) -> dict[str, Any] | None:
    """Return the answers expected of one element; None where the law fails on the way."""
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


HYPELA2 = base.ExportFormat("marc-hypela2", hypela2)
#: Table numbers in the deck, by modulus.
NUMBERS = {"E1": 11, "E2": 12, "G12": 13}
#: The modulus is held as far as this from the ends of its table, whether or not Marc extrapolates.
GUARD = 1.0


def nlelast(card: MaterialCard, options: base.ExportTableOptions) -> base.Export:
    """Write TABLE and NLELAST blocks of an extended-format deck."""
    tables = modulus_tables(card.law, options.points, options.reach)
    largest = max(table.error for table in tables.values())
    loses = [
        f"moduli are straight lines between {options.points} points (more where a modulus has "
        f"pieces) from zero to the end of the range: off by {100 * largest:.2g} % at most"
    ]
    if any(len(table.jumps) for table in tables.values()):
        loses.append(f"the jumps of the moduli are {JUMP:g} of strain wide")
    if card.law.area_power == 0:
        loses.append("the card's incompressible thickness: NLELAST has no such choice")
    remarks = base.ExportRemarks(
        carries=(
            "tangent moduli of log strain, nu12, moduli held outside their range",
            "stress is Cauchy stress under LARGE STRAIN; published Marc results of this law "
            "agree with the integral of E over log strain",
        ),
        loses=(*loses, *base.range_remarks(card, options.reach)),
        confirm=(
            "the data blocks of NLELAST and the variable type 73 of its tables: no public deck "
            "shows them (bubblefit docs marc-deck)",
            "that tables of G12 are looked up with the engineering shear, sign included",
        ),
    )
    text = render(
        "marc/nlelast_card.dat.j2",
        head=base.heading(
            card, "MSC Marc NLELAST, extended format", remarks, "$", options.unit_system
        ),
        tables=[
            {"name": name.lower(), "number": NUMBERS[name], "rows": guarded(tables[name])}
            for name in NUMBERS
        ],
        nu12=card.law.nu12,
        name=_name(card),
        real=lambda value: f"{value:20.13E}",
    )
    return base.Export({".dat": text}, remarks)


def guarded(table: ModulusTable) -> list[list[float]]:
    """Return strain and modulus of a table, and one point more beyond each end."""
    rows = np.column_stack([table.strain, table.modulus])
    rows = np.pad(rows, ((1, 1), (0, 0)), "edge")
    rows[[0, -1], 0] += [-GUARD, GUARD]
    numbers: list[list[float]] = rows.tolist()
    return numbers


def _name(card: MaterialCard) -> str:
    """Return the card's name in letters, digits and "_", 24 characters at most."""
    name = "".join(c if c.isascii() and c.isalnum() else "_" for c in card.name.lower())
    return name.strip("_")[:24] or "fabric"


NLELAST = base.ExportFormat("marc", nlelast, base.ExportTableOptions)
#: Section Poisson's ratio: how Abaqus changes the thickness (0: not at all; 0.5: incompressible).
SECTION_POISSON = {"constant": 0.0, "incompressible": 0.5}


def umat(card: MaterialCard, options: base.UnitsOptions) -> base.Export:
    """Write the subroutine (the same for all cards) and the *USER MATERIAL with its constants."""
    poisson = SECTION_POISSON[card.law.thickness_change]
    remarks = base.ExportRemarks(
        carries=(
            "the whole law: tangent moduli of log strain in any form, nu12, the range in which "
            "moduli hold; the exact, unsymmetric tangent",
            f"thickness: by the section, POISSON={poisson:g} ({card.law.thickness_change})",
        ),
        loses=("transverse shear: give *TRANSVERSE SHEAR STIFFNESS for shells",),
        confirm=(
            "no Abaqus was at hand: the interface is the documented one, compiled and compared "
            "point by point; pull one element",
            "STRAN is the sum of increments along axes that turn with the material: log strain "
            "but for 1e-6 on paths of proportional stretch and shear (bubblefit docs exports)",
        ),
    )
    context = {
        "name": material_name(card),
        "constants": list(base.law_constants(card.law)),
        "poisson": poisson,
        "thickness": card.thickness,
        "exact": repr,
    }
    source = render(
        "abaqus/umat.f.j2",
        head=base.heading(
            card, "Abaqus/Standard user subroutine UMAT", remarks, "!", options.unit_system
        ),
    )
    material = render(
        "abaqus/umat.inp.j2",
        head=base.heading(card, "Abaqus/Standard material", remarks, "**", options.unit_system),
        **context,
    )
    return base.Export({".f": source, ".inp": material}, remarks)


UMAT = base.ExportFormat("abaqus-umat", umat)
