"""bubblefit: test data in, validated material card of a coated fabric out."""

__version__ = "0.1.0"
