"""The file that carries a law's moduli into the material library, whatever their number.

A deck cannot: CalculiX copies the constants of a material into a field of 21 numbers (2.20; 2.21
makes it as long as it must be) and writes on beyond its end without a word.
"""

from __future__ import annotations

import hashlib

from ...materials.law import HypoelasticLaw
from ...materials.pieces import piece_constants

SUFFIX = ".law"
#: First line of the file, before the law's number.
TITLE = "bubblefit law"


def law_number(law: HypoelasticLaw) -> int:
    """What a deck calls the law's moduli: made of all their digits, below 1.1e12."""
    return int.from_bytes(hashlib.sha256(_numbers(law).encode()).digest()[:5], "big")


def law_text(law: HypoelasticLaw) -> str:
    """Text of the file: title and number; how many pieces E1, E2 and G12 have; a line a piece.

    A piece is the strain up to which it holds and four coefficients (MPa, highest power of the
    strain first), those of E1 before those of E2 and of G12.
    """
    return f"{TITLE} {law_number(law)}\n{_numbers(law)}"


def law_files(law: HypoelasticLaw) -> dict[str, str]:
    """The file by its name, to lie where ccx runs: the library reads every *.law there."""
    return {f"bubblefit-{law_number(law)}{SUFFIX}": law_text(law)}


def _numbers(law: HypoelasticLaw) -> str:
    constants = piece_constants(law)
    counts, pieces = constants[:3], constants[3:]
    rows = [[f"{count:.0f}" for count in counts]]
    rows += [[repr(value) for value in pieces[i : i + 5]] for i in range(0, len(pieces), 5)]
    return "".join(" ".join(row) + "\n" for row in rows)
