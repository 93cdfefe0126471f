"""Figures, the HTML report and VTU files."""

from .html import Report, StartRow, Table, write_report
from .moduli import plot_moduli
from .optima import PUBLISHED_OPTIMA, plot_optima
from .profiles import plot_profiles
from .scatter import plot_heights
from .vtu import write_vtu

__all__ = [
    "PUBLISHED_OPTIMA",
    "Report",
    "StartRow",
    "Table",
    "plot_heights",
    "plot_moduli",
    "plot_optima",
    "plot_profiles",
    "write_report",
    "write_vtu",
]
