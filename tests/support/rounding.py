"""Data disturbed by so little that no printed number may change, such as by another rounding."""

from dataclasses import replace

import numpy as np
from bubblefit.experiments.bubble import prepared as bubbles
from bubblefit.experiments.strips import reading as strips

#: The relative disturbance of all data in a run of the tests, as a number.
VARIABLE = "BUBBLEFIT_DISTURBED"


def disturb_data(monkeypatch, share, seed=1):
    """Multiply what strips and bubbles are fitted to by 1 - share to 1 + share, value by value.

    The same data are disturbed alike whenever they are read.
    """

    def disturbed(values):
        random = np.random.default_rng([seed, values.size])
        return values * (1.0 + share * random.uniform(-1.0, 1.0, values.shape))

    def disturbed_curves(*arguments, read=strips.read_load_curves, **options):
        curves = read(*arguments, **options)
        return type(curves)(
            replace(curve, elongation=disturbed(curve.elongation), load=disturbed(curve.load))
            for curve in curves
        )

    def disturbed_fields(make):
        def wrapped(*arguments):
            fields, *others = make(*arguments)
            moved = (replace(f, displacement=disturbed(f.displacement)) for f in fields)
            return (tuple(moved), *others)

        return wrapped

    monkeypatch.setattr(strips, "read_load_curves", disturbed_curves)
    for name in ("_computed", "read_measured"):
        monkeypatch.setattr(bubbles, name, disturbed_fields(getattr(bubbles, name)))
