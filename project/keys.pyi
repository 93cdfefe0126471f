"""Keyword arguments in Python, made of the sections of a project (docs/make_keys.py)."""

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any, Literal, TypedDict

from numpy.typing import ArrayLike

from . import objects

class BubbleKeys(TypedDict, total=False):
    """Further arguments of `Bubble`."""

    weight: float
    nominal_radius: float | None
    inflation: Literal["all"] | int
    increments: ArrayLike | None
    elements: int
    symmetry: Literal["full", "quarter"]
    generator: Literal["blocks", "gmsh"]
    objective: str | Callable[..., Any]
    noise: float | None
    match: Mapping[str, Any]
    nuisance: Mapping[str, Any]
    cord: Sequence[Mapping[str, Any]]
    data: Mapping[str, Any]
    filter: Mapping[str, Any] | None
    correlation: Mapping[str, Any]
    pressure: Mapping[str, Any] | None
    coordinates: Literal["reference", "deformed"] | None
    camera_axes: bool | None

class BubbleFileKeys(BubbleKeys, total=False):
    """Further arguments of `Bubble.read`."""

    name: str | None
    radius: float | Literal["clamp"] | None
    ellipse: Mapping[str, Any] | None
    sheet: objects.Sheet | Mapping[str, Any] | None
    format: str | None
    comment: str
    decimal: Literal[".", ","] | None
    pattern: str | Path | None
    indices: ArrayLike | None
    folder: str | Path
    reference: str | Path | None
    columns: Mapping[str, Any]
    flag_column: str | None
    valid_column: str | None
    length_unit: Literal["mm", "m", "in"] | None
    registration: objects.Registration | Mapping[str, Any] | None

class StripsKeys(TypedDict, total=False):
    """Further arguments of `Strips`."""

    gauge_length: float | None
    final_length: float | None
    side_by_side: int
    grip_distance: float | None
    bias_angle: float
    increments: int
    warp: Mapping[str, Any] | None
    fill: Mapping[str, Any] | None
    bias: Mapping[str, Any] | None
    data: Mapping[str, Any]
    noise: float | None
    compliance: float
    compliance_prior: float | None
    rate: float | None
    conditioning: str | None
    match: Literal["polynomial", "points"]
    objective: str | Callable[..., Any]
    weight: float
    weights: Mapping[str, Any]
    until_largest_load: bool
    order: int
    through_origin: bool
    specimens: int | None

class StripsFileKeys(StripsKeys, total=False):
    """Further arguments of `Strips.read`."""

    name: str | None
    width: float | None
    format: str | None
    comment: str
    decimal: Literal[".", ","] | None
    folder: str | Path
    sheet: str | None
    polynomials: str | Path | None
    directions: Mapping[str, Any] | None
    columns: Mapping[str, Any]
    load_unit: Literal["N", "kN", "lbf", "kN/m", "N/mm", "N/5cm", "lbf/in"] | None
    length_unit: Literal["mm/mm", "mm", "cm", "m", "in", "%"] | None

class BiaxialKeys(TypedDict, total=False):
    """Further arguments of `Biaxial`."""

    weight: float
    width: float | None
    load_share: float | ArrayLike | None
    load_share_deviation: float | None
    ratios: Sequence[str] | None
    range: ArrayLike | None
    cycle: Literal["last"] | int
    conditioning: int
    points: int
    noise: float | None
    data: Mapping[str, Any]

class BiaxialFileKeys(BiaxialKeys, total=False):
    """Further arguments of `Biaxial.read`."""

    name: str | None
    format: str | None
    comment: str
    decimal: Literal[".", ","] | None
    folder: str | Path
    sheet: str | None
    pairs: Mapping[str, Any] | None
    columns: Mapping[str, Any]
    load_unit: (
        Literal["kN/m", "N/mm", "N/m", "N/cm", "N/50mm", "N/5cm", "lbf/in", "N", "kN", "lbf"] | None
    )
    strain_unit: Literal["%", "‰", "mm/mm"] | None

class CylinderKeys(TypedDict, total=False):
    """Further arguments of `Cylinder`."""

    cord: Sequence[Mapping[str, Any]]
    length: float | None
    seam_width: float | None
    element_size: float | None
    symmetry: Literal["full", "quarter"]
    span: float | None
    support_diameter: float | None
    saddle: Mapping[str, Any] | None
    mass_per_area: float | None
    collar: Mapping[str, Any] | None
    deflection: float | None
    frames: int | None
    deflections: ArrayLike | None
    places: ArrayLike | None
    slope_over: float | None
    cap_warp: Literal["x", "y"]
    gas: Mapping[str, Any]
    measured: Mapping[str, Any]
    model: Literal["membrane", "beam"]
    wall: Mapping[str, Any] | None
    load_spacing: float | None
    load_width: float | None
    roller_below_axis: float | None
    mass_per_length: float | None
    friction: float | None
    preload: float
    zero: Literal["none", "first", "line"]

class CylinderFileKeys(CylinderKeys, total=False):
    """Further arguments of `Cylinder.read`."""

    name: str | None
    diameter: float
    pressure: float
    format: str | None
    comment: str
    decimal: Literal[".", ","] | None
    folder: str | Path
    load: Mapping[str, Any]
    repetition: str | None

class DeckKeys(TypedDict, total=False):
    """Further arguments of `Deck`."""

    weight: float
    folder: str | Path
    files: Sequence[str]
    geo: str | None
    result: str
    timeout: float | None
    side_by_side: int | None
    surrogate: str | None
    surrogate_times: ArrayLike

class DeckFileKeys(DeckKeys, total=False):
    """Further arguments of `Deck.read`."""

    name: str | None
    program: Literal["calculix", "marc"] | Sequence[str]
    template: str
    parameters: Mapping[str, Any]
    compare: Sequence[Mapping[str, Any]]

class SheetKeys(TypedDict, total=False):
    """Arguments of `Sheet`."""

    surface: Literal["flat", "measured"]
    degree: int | None
    modes: int
    prior: float | None
    slack: bool
    slack_prior: float
    tension: ArrayLike
    tension_prior: float | None
    metric: int
    metric_prior: float
    misfit: float | None
    rim: Literal["fixed", "measured"]
    constant_field: Sequence[Literal["dx", "dy", "dz"]]
    from_pressure: float | None

class RegistrationKeys(TypedDict, total=False):
    """Arguments of `Registration`."""

    plane: Literal["found", "clamp", "edge", "camera"]
    centre: ArrayLike | None
    warp: float | None
    warp_points: Sequence[ArrayLike] | None
    warp_is: Literal["stiff", "soft"]
    remove_clamp_motion: bool

class LawKeys(TypedDict, total=False):
    """Further arguments of `Law`."""

    symmetry: Literal["orthotropic", "balanced", "isotropic"]
    nu12: float
    strain_range: ArrayLike | None
    bounds: Mapping[str, Any] | None
    margin: Mapping[str, Any] | None
    closed_path: float | None
    memory: Mapping[str, Any] | None
    knots: Any
    breaks: Any

class FitKeys(TypedDict, total=False):
    """Further keys of [fit] in `fit`."""

    gradient: Literal["exact", "differences"]
    constraints: Literal["margin", "boolean"]
    solver: str
    max_analyses: int | None
    tolerance: float
    coarse_to_fine: bool | None
    unknowns: Mapping[str, Any]
    mesh_error: Literal["told", "taken out"]
    cache: bool | str | Path
