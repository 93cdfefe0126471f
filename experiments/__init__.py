"""What was measured: displacement fields and the polynomial surfaces fitted to them."""
