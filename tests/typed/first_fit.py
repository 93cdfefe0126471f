import bubblefit as bf
import numpy as np

data = np.load("camera.npz")
fabric = bf.Fabric("VALMEX 7318", thickness=0.8)
arrays = data["points"], data["displacements"], data["pressures"]
bubble = bf.Bubble(*arrays, radius=100.0, elements=48, symmetry="quarter")
fit = bf.fit([bubble], bf.Law("constant"), fabric=fabric, starts=1, jobs=1)
moduli = fit.moduli()
