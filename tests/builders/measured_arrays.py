"""A bubble of a known law as the arrays that a camera's software saves."""

import bubblefit as bf
import numpy as np

FABRIC = bf.Fabric("made", thickness=0.8)


PRESSURES = np.linspace(0.005, 0.1, 20)


def project_of(*tests, form="constant", **more):
    return bf.Project.of(tests, bf.Law(form), fabric=FABRIC, **more)
