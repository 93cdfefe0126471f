"""The constitutive law, its positivity and the material card."""
