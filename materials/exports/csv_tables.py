"""A table that any program and any spreadsheet reads."""

from __future__ import annotations

import numpy as np

from ..card import MaterialCard
from ..responses import trellis_angle, trellis_curve, uniaxial_curve
from ..tables import ModulusTable, modulus_tables
from .base import Export, Format, Says, TableOptions, heading, range_remarks

COLUMNS = "direction,log_strain,tangent_modulus_MPa,test_strain,test_stress_MPa"


def csv(card: MaterialCard, options: TableOptions) -> Export:
    """Tangent modulus and nominal stress by strain, warp, fill and shear below one another."""
    tables = modulus_tables(card.law, options.points, options.reach)
    says = Says(
        carries=(
            "E1 of eps1, E2 of eps2, G12 of gamma12 (engineering; even in it), at "
            f"{options.points} log strains each",
            "test_strain and test_stress: nominal strain and stress (force over reference area) "
            "of a strip along warp or fill, free to contract; for shear the change of angle in "
            "radians and the stress that does work on it, yarns held at their length",
        ),
        loses=(
            "everything between the points; nu12 is in this heading and in the contraction of "
            "the strips only",
            *range_remarks(card, options.reach),
        ),
    )
    head = [
        heading(card, "Tables of a fabric", says, "#"),
        f"# nu12: {float(card.law.nu12)!r}",
        COLUMNS,
    ]
    rows = [row for name in ("E1", "E2", "G12") for row in _rows(card, tables[name])]
    return Export({".csv": "\n".join([*head, *rows]) + "\n"}, says)


def _rows(card: MaterialCard, table: ModulusTable) -> list[str]:
    keep = table.strain >= 0
    strain, modulus = table.strain[keep], table.modulus[keep]
    if table.name == "G12":
        direction = "shear"
        angles = np.array([trellis_angle(gamma) for gamma in strain])
        x, y, _ = trellis_curve(card.law, angles, "nominal")
    else:
        direction, pulled = ("warp", 0) if table.name == "E1" else ("fill", 1)
        x, y = uniaxial_curve(card.law, pulled, strain, "nominal")
    columns = zip(strain, modulus, x, y, strict=True)
    return [f"{direction}," + ",".join(f"{v:.12g}" for v in row) for row in columns]


FORMAT = Format("csv", csv, TableOptions)
