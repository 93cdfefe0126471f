"""`bubblefit study`: what refinement and Poisson's ratio change in an analysis."""

from __future__ import annotations

import click

from .study_mesh import study_mesh
from .study_nu12 import study_nu12


@click.group("study")
def command() -> None:
    """What refinement, or nu12, changes in the analyses of a project."""


command.add_command(study_mesh)
command.add_command(study_nu12)
