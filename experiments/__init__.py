"""What was measured: displacement fields with surfaces, load curves with polynomials."""
