"""Make mistakes that the types of the package show, or mypy finds an ignore unused."""

import bubblefit as bf

bf.Fabric("a", thickness="wide")  # type: ignore[arg-type]
bf.fits  # type: ignore[attr-defined]  # noqa: B018
bf.Bubble(radius=100.0, pressures=[0.05], element=48)  # type: ignore[call-arg]
bf.Bubble.read("frames/*.csv", [0.05], radius=100.0, elements="many")  # type: ignore[arg-type]
bf.Strips(width=25.0, increment=10)  # type: ignore[call-arg]
bf.Cylinder(150.0, 0.06, spam=600.0)  # type: ignore[call-arg]
bf.Law("constant", bound={"E1": [20, 2000]})  # type: ignore[call-arg]
bf.Sheet(mode=3)  # type: ignore[call-arg]
bf.fit(bf.read_project("project.toml"), startss=1)  # type: ignore[call-arg]
