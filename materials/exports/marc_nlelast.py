"""MSC Marc: the law as NLELAST with a table of each modulus."""

from __future__ import annotations

from ...rendering import render
from ..card import MaterialCard
from ..tables import JUMP, ModulusTable, modulus_tables
from .base import Export, Says, heading, range_remarks
from .formats import Format, TableOptions

#: Table numbers in the deck, by modulus.
NUMBERS = {"E1": 11, "E2": 12, "G12": 13}
#: The modulus is held as far as this from the ends of its table, whether or not Marc extrapolates.
GUARD = 1.0


def nlelast(card: MaterialCard, options: TableOptions) -> Export:
    """TABLE and NLELAST blocks of an extended-format deck."""
    tables = modulus_tables(card.law, options.points, options.reach)
    largest = max(table.error for table in tables.values())
    loses = [
        f"moduli are straight lines between {options.points} points (more where a modulus has "
        f"pieces) from zero to the end of the range: off by {100 * largest:.2g} % at most",
    ]
    if any(len(table.jumps) for table in tables.values()):
        loses.append(f"the jumps of the moduli are {JUMP:g} of strain wide")
    if card.law.area_power == 0:
        loses.append("the card's incompressible thickness: NLELAST has no such choice")
    says = Says(
        carries=(
            "tangent moduli of log strain, nu12, moduli held outside their range",
            "stress is Cauchy stress under LARGE STRAIN; published Marc results of this law "
            "agree with the integral of E over log strain",
        ),
        loses=(*loses, *range_remarks(card, options.reach)),
        confirm=(
            "the data blocks of NLELAST and the variable type 73 of its tables: no public deck "
            "shows them (bubblefit docs marc-deck)",
            "that tables of G12 are looked up with the engineering shear, sign included",
        ),
    )
    text = render(
        "marc/nlelast_card.dat.j2",
        head=heading(card, "MSC Marc NLELAST, extended format", says, "$"),
        tables=[
            {"name": name.lower(), "number": NUMBERS[name], "rows": _rows(tables[name])}
            for name in NUMBERS
        ],
        nu12=card.law.nu12,
        name=_name(card),
        real=_real,
    )
    return Export({".dat": text}, says)


def _rows(table: ModulusTable) -> list[tuple[float, float]]:
    strain, modulus = table.strain.tolist(), table.modulus.tolist()
    before = (strain[0] - GUARD, modulus[0])
    after = (strain[-1] + GUARD, modulus[-1])
    return [before, *zip(strain, modulus, strict=True), after]


def _name(card: MaterialCard) -> str:
    """A name of at most 24 characters that Marc takes."""
    kept = "".join(c if c.isascii() and c.isalnum() else "_" for c in card.name.lower())
    return kept.strip("_")[:24] or "fabric"


def _real(value: float) -> str:
    """20 columns with 13 digits."""
    return f"{value:20.13E}"


FORMAT = Format("marc", nlelast, TableOptions)
