"""The project file of a joint fit: a bubble and strips of one material."""

from __future__ import annotations

import functools
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from ..errors import InputError
from .bubble import BubbleProject, bubble_settings
from .fit import FitProject, common_settings, parse
from .uniaxial import UniaxialProject, default_breaks, default_range, uniaxial_settings
from .uniaxial_schema import JointFile


@dataclass(frozen=True, eq=False, kw_only=True)
class JointProject(FitProject):
    """What a joint fit is asked to do: both experiments with the material and fit they share.

    bubble_weight, uniaxial_weight : of the mean relative RMS error of each data set.
    """

    bubble: BubbleProject
    uniaxial: UniaxialProject
    bubble_weight: float
    uniaxial_weight: float

    def __post_init__(self) -> None:
        super().__post_init__()
        # A solver named on the command line runs both.
        shared = {"solver": self.solver, "solver_options": self.solver_options}
        for name in ("bubble", "uniaxial"):
            object.__setattr__(self, name, replace(getattr(self, name), **shared))


def read_joint(
    path: Path, data_folder: Path | None = None, strip_folder: Path | None = None
) -> JointProject:
    """Read a project file (TOML) with its load curves.

    Parameters
    ----------
    data_folder, strip_folder : where the bubble's files and the load curves lie, instead of what
        the file says.

    Raises
    ------
    InputError : one line naming the file and the dotted key.
    """
    path = Path(path)
    file = parse(path, {"joint": JointFile})
    strips = uniaxial_settings(path, file, file.uniaxial, strip_folder, True, "--strip-data")
    bubble = bubble_settings(path, file, data_folder, True)
    if not np.isclose(strips["thickness"], bubble["thickness"], rtol=1e-9):
        problem = "expected the same thickness as bubble.thickness: it is one material"
        raise InputError(path, "uniaxial.thickness", problem)
    weights = file.joint
    for name, weight in weights.model_dump().items():
        if not weight > 0:
            problem = "expected above 0; to fit one alone run `bubblefit bubble` or `uniaxial`"
            raise InputError(path, f"joint.{name}", problem)
    ends = default_range(strips["strips"], strips["bias_angle"])
    breaks = functools.partial(default_breaks, strips["strips"])
    common = common_settings(path, file, ends, breaks)
    return JointProject(
        **common,
        thickness=bubble["thickness"],
        bubble=BubbleProject(**common, **bubble, objective="e"),
        uniaxial=UniaxialProject(**common, **strips, objective="relative"),
        bubble_weight=weights.bubble,
        uniaxial_weight=weights.uniaxial,
    )
