"""Formats of exported cards by name, CalculiX's among them."""

from collections.abc import Mapping

from ..materials.exports import curves, designers, subroutines
from ..materials.exports.base import CSV, ExportFormat
from .calculix.library import FORMAT

FORMATS: Mapping[str, ExportFormat] = {
    export_format.name: export_format
    for export_format in (
        subroutines.NLELAST,
        subroutines.HYPELA2,
        subroutines.UMAT,
        curves.FABRIC,
        curves.MAT34,
        curves.LAW58,
        curves.LAW158,
        *designers.FORMATS,
        CSV,
        FORMAT,
    )
}
