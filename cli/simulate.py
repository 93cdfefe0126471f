"""`bubblefit simulate`: forward analyses with material cards."""

from __future__ import annotations

import click

from .simulate_bend import simulate_bend
from .simulate_bubble import simulate_bubble
from .simulate_uniaxial import simulate_uniaxial


@click.group("simulate")
def command() -> None:
    """One forward analysis with a material card; of strips and beams, with one or several."""


command.add_command(simulate_bubble)
command.add_command(simulate_uniaxial)
command.add_command(simulate_bend)
