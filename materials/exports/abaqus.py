"""Abaqus/Explicit: *FABRIC with uniaxial test data."""

from __future__ import annotations

from ...files import render
from ..card import MaterialCard
from .base import (
    DENSITY,
    CurveOptions,
    Export,
    Format,
    NoOptions,
    Says,
    density_remarks,
    fabric_curves,
    heading,
    law_constants,
    range_remarks,
)


def fabric(card: MaterialCard, options: CurveOptions) -> Export:
    """*MATERIAL with *FABRIC and three *UNIAXIAL tests, and how to orient it."""
    curves = fabric_curves(card, options, "nominal")
    says = Says(
        carries=(
            "nominal stress by nominal strain of strips along warp and fill, free to contract, "
            "and shear stress by change of angle: both elastic, path-independent",
        ),
        loses=(
            f"nu12 = {card.law.nu12:g}: warp, fill and shear are independent in *FABRIC; "
            + curves.uncoupled,
            "Abaqus/Explicit only; Abaqus/Standard needs --format abaqus-umat",
            f"stress along the yarns in shear alone (up to {curves.yarns:.3g} MPa in the card)",
            "hypoelasticity: the curves are total ones; unloading is along the same curve",
            *density_remarks(options.density),
            *range_remarks(card, options.reach),
        ),
        confirm=(
            "the order stress, strain of the data lines, and the sign and measure of the shear "
            "(radians between the yarns), with one element of each test",
        ),
    )
    text = render(
        "abaqus/fabric.inp.j2",
        head=heading(card, "Abaqus/Explicit *FABRIC", says, "**"),
        name=material_name(card),
        density=DENSITY if options.density is None else options.density,
        tests=[(1, curves.warp.tolist()), (2, curves.fill.tolist())],
        shear=curves.shear.tolist(),
    )
    return Export({".inp": text}, says)


def material_name(card: MaterialCard) -> str:
    """A name that Abaqus and CalculiX take: letters, digits and underscores, a letter first."""
    kept = "".join(c if c.isascii() and c.isalnum() else "_" for c in card.name.upper())
    kept = kept.strip("_")[:32]
    return kept if kept[:1].isalpha() else "FABRIC"


FORMAT = Format("abaqus-fabric", fabric, CurveOptions)


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


FORMAT_ABAQUS_UMAT = Format("abaqus-umat", umat)
