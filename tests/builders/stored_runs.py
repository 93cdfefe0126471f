"""A law and a bent cylinder whose runs with a card are stored."""

import numpy as np
from bubblefit.materials.law import HypoelasticLaw
from bubblefit.meshes.cylinder_model import inflated_cylinder

WAY = np.linspace(0.0, 240.0, 61)


def law(e1=500.0):
    return HypoelasticLaw.linear(e1, 150.0, 20.0)


def model(symmetry="quarter"):
    way = WAY[1:].tolist()
    return inflated_cylinder(150.0, 0.14, 0.81, 40.0, deflections=way, symmetry=symmetry)
