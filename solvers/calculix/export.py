"""CalculiX: the material that calls the library of the law, and the library's source."""

from __future__ import annotations

from ...materials.card import MaterialCard
from ...materials.exports.base import Export, Options, Says, heading, render
from .library import FLAGS, LIBRARY_FILE, MATERIAL, SOURCE, STATE_VARIABLES, constants


def calculix(card: MaterialCard, options: Options) -> Export:
    """*MATERIAL with *USER MATERIAL and *DEPVAR, and the C source to be compiled for it."""
    says = Says(
        carries=(
            "the whole law: tangent moduli of log strain, nu12, the range in which moduli hold, "
            "polynomials or tri-linear, thickness constant or incompressible",
        ),
        loses=(
            "the unsymmetric part of the tangent (CalculiX takes the symmetric one): more "
            "iterations, the same result",
            "through the thickness and in transverse shear the material is linear (constants 18 "
            "and 19)",
        ),
        confirm=("that this ccx loads material libraries (Debian's does not): bubblefit doctor",),
    )
    text = render(
        "calculix/card.inp.j2",
        head=heading(card, "CalculiX material", says, "**"),
        material=MATERIAL,
        constants=constants(card.law),
        states=STATE_VARIABLES,
        library=LIBRARY_FILE,
        flags=" ".join(FLAGS),
    )
    return Export({".inp": text, ".c": SOURCE.read_text(encoding="utf-8")}, says)
