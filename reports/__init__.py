"""Figures, the page and VTU files."""

from .beam import BeamBodies, plot_beam
from .bending import BendLine, BendPanel, BendReadings, plot_bending, plot_bending_cases, plot_gas
from .biaxial import BiaxialPanel, plot_biaxial
from .charts import Chart, Charts, Series, dots, line
from .clock import plot_clock
from .content import Download, Facts, Listing, Picture, Report, Section, Table, Words, pictures
from .convergence import ConvergencePanel, plot_convergence
from .curves import plot_curves
from .html import percent, write_report
from .laws import LawRow, plot_laws
from .loads import StripCurves, plot_loads
from .maps import Maps, Shade, Solid, maps_of
from .moduli import plot_moduli
from .moduli_together import plot_moduli_together
from .nu12 import plot_nu12
from .optima import plot_optima
from .orders import OrderErrors, plot_orders
from .packed import pack
from .pinned import plot_pinned
from .plan import plot_plan
from .profiles import plot_profiles
from .registration import plot_registration
from .rises import plot_rises
from .scatter import plot_heights
from .sphere import plot_spheres
from .strip import plot_strip
from .surface import plot_disk
from .vtu import write_vtu
from .weights import plot_weights

__all__ = [
    "BeamBodies",
    "BendLine",
    "BendPanel",
    "BendReadings",
    "BiaxialPanel",
    "Chart",
    "Charts",
    "ConvergencePanel",
    "Download",
    "Facts",
    "LawRow",
    "Listing",
    "Maps",
    "OrderErrors",
    "Picture",
    "Report",
    "Section",
    "Series",
    "Shade",
    "Solid",
    "StripCurves",
    "Table",
    "Words",
    "dots",
    "line",
    "maps_of",
    "pack",
    "percent",
    "pictures",
    "plot_beam",
    "plot_bending",
    "plot_bending_cases",
    "plot_biaxial",
    "plot_clock",
    "plot_convergence",
    "plot_curves",
    "plot_disk",
    "plot_gas",
    "plot_heights",
    "plot_laws",
    "plot_loads",
    "plot_moduli",
    "plot_moduli_together",
    "plot_nu12",
    "plot_optima",
    "plot_orders",
    "plot_pinned",
    "plot_plan",
    "plot_profiles",
    "plot_registration",
    "plot_rises",
    "plot_spheres",
    "plot_strip",
    "plot_weights",
    "write_report",
    "write_vtu",
]
