"""Abaqus/Explicit: *FABRIC with uniaxial test data."""

from __future__ import annotations

from ...rendering import render
from ..card import MaterialCard
from .base import (
    DENSITY,
    Export,
    Says,
    density_remarks,
    heading,
    range_remarks,
)
from .curves import fabric_curves
from .formats import CurveOptions, Format


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
