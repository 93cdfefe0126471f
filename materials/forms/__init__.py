"""Forms of the tangent moduli: how the numbers of a law make three curves."""
