"""Define the constitutive law, its forms, the material card and its exports."""
