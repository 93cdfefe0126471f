"""Biaxial tests of a cruciform: loads per width and strains along warp and fill."""
