"""No form at all: a fit seeks only parameters of decks, and has no law of the fabric."""

from dataclasses import dataclass

import numpy as np

from .base import Array, LawForm, Offer, register_form


@dataclass(frozen=True)
class NoLaw(LawForm):
    """A form without coefficients, whose moduli are zero and are not reported."""

    name = "none"
    size = 0
    labels: tuple[str, ...] = ()
    modulus_of: tuple[str, ...] = ()

    def piece_map(self) -> Array:
        return np.zeros((3, 1, 4, 0))

    def grid(self, component: int, end: float) -> Array:
        return np.array([0.0])

    def describe(self) -> str:
        return "No law: only parameters of decks are sought."


register_form(Offer("none", lambda *_: NoLaw(), of_strain=False))
