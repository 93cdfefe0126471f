"""Figures, the HTML report and VTU files."""
