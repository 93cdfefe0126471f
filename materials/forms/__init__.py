"""Define forms of the moduli, a module each: how the numbers of a law make three curves."""
