"""`bubblefit schema`: the JSON Schema of the project file."""

from __future__ import annotations

from pathlib import Path

import click

from .examples import examples
from .exits import exits


@click.command(
    "schema",
    epilog=examples(
        "bubblefit schema",
        "bubblefit schema --out project.schema.json",
    ),
)
@click.option("--out", type=click.Path(path_type=Path), help="File to write [print it].")
@exits
def command(out: Path | None) -> None:
    """Print or write the JSON Schema of the project file, plug-ins' kinds of test included.

    Editors complete and check a project whose first line names it: #:schema project.schema.json
    """
    from ..files import write_text
    from ..project.schema import schema_text

    if out is None:
        click.echo(schema_text(), nl=False)
        return
    write_text(out, schema_text())
    click.echo(f"written to {out}")
