"""Make two mistakes that the types of the package show, or mypy finds an ignore unused."""

import bubblefit as bf

bf.Fabric("a", thickness="wide")  # type: ignore[arg-type]
bf.fits  # type: ignore[attr-defined]  # noqa: B018
