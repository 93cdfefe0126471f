"""The embedded membrane solver with exact sensitivities."""
