"""CalculiX: the material that calls the library of the law, and the library's source."""

from __future__ import annotations

from ...materials.card import MaterialCard
from ...materials.exports.base import Export, Says, heading
from ...materials.exports.formats import Format, NoOptions
from ...rendering import render
from .law_file import SUFFIX, law_text
from .library import FLAGS, LIBRARY_FILE, MATERIAL, SOURCE, STATE_VARIABLES, constants


def calculix(card: MaterialCard, options: NoOptions) -> Export:
    """*MATERIAL with *USER MATERIAL and *DEPVAR, the C source of its library, and its moduli."""
    says = Says(
        carries=(
            "the whole law: tangent moduli of log strain in any form, nu12, the range in which "
            "moduli hold, thickness constant or incompressible",
        ),
        loses=(
            "the unsymmetric part of the tangent (CalculiX takes the symmetric one): more "
            "iterations, the same result",
            "through the thickness and in transverse shear the material is linear (constants 3 "
            "and 4)",
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
    source = SOURCE.read_text(encoding="utf-8")
    return Export({".inp": text, ".c": source, SUFFIX: law_text(card.law)}, says)


FORMAT = Format("calculix", calculix)
