"""Abaqus/Standard: the law as user subroutine UMAT, and the material that calls it."""

from __future__ import annotations

from ...rendering import render
from ..card import MaterialCard
from .abaqus_fabric import material_name
from .base import Export, Says, heading
from .formats import Format, NoOptions
from .fortran import law_constants

#: Section Poisson's ratio: how Abaqus changes the thickness (0: not at all; 0.5: incompressible).
SECTION_POISSON = {"constant": 0.0, "incompressible": 0.5}


def umat(card: MaterialCard, options: NoOptions) -> Export:
    """The subroutine (the same for all cards) and the *USER MATERIAL with this card's constants."""
    poisson = SECTION_POISSON[card.law.thickness_change]
    says = Says(
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
        "constants": list(law_constants(card.law)),
        "poisson": poisson,
        "thickness": card.thickness,
        "exact": repr,
    }
    source = render(
        "abaqus/umat.f.j2", head=heading(card, "Abaqus/Standard user subroutine UMAT", says, "!")
    )
    material = render(
        "abaqus/umat.inp.j2", head=heading(card, "Abaqus/Standard material", says, "**"), **context
    )
    return Export({".f": source, ".inp": material}, says)


FORMAT = Format("abaqus-umat", umat)
