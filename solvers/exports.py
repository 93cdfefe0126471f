"""Every format that a card can be exported in, by its name."""

from __future__ import annotations

from collections.abc import Mapping

from ..materials.exports import curves, designers, subroutines
from ..materials.exports.base import CSV, Format
from .calculix import library as calculix

FORMATS: Mapping[str, Format] = {
    each.name: each
    for each in (
        subroutines.NLELAST,
        subroutines.HYPELA2,
        subroutines.UMAT,
        curves.FABRIC,
        curves.MAT34,
        curves.LAW58,
        *designers.FORMATS,
        CSV,
        calculix.FORMAT,
    )
}
