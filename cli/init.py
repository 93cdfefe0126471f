"""`bubblefit init DIR`: a commented example project to start from."""

from __future__ import annotations

from contextlib import suppress
from pathlib import Path

import click

from ..errors import InputError, OutputError
from .options import exits

EXAMPLES = Path(__file__).parent.parent / "examples"
#: By name: the folder of the example, and what to type next (in the folder that was written).
KINDS = {
    "known": ("bubble-known-solution", "bubblefit bubble {}", "project.toml"),
    "measured": ("bubble-valmex7318", "bubblefit bubble {} --data DIR", "test1-linear.toml"),
    "uniaxial": ("uniaxial-valmex7318", "bubblefit uniaxial {}", "project.toml"),
    "bend": ("bend-valmex7318", "bubblefit bend {}", "project.toml"),
    "joint": ("joint-valmex7318", "bubblefit joint {} --data DIR", "test1.toml"),
}


@click.command("init")
@click.argument("folder", type=click.Path(path_type=Path))
@click.option(
    "--example",
    type=click.Choice(list(KINDS)),
    default="known",
    show_default=True,
    help="A bubble from a known solution; from measured DIC files; strip tests; bending;"
    " bubble and strips together.",
)
@exits
def command(folder: Path, example: str) -> None:
    """Write a commented example project into FOLDER (nothing there is written over)."""
    name, advice, project = KINDS[example]
    source = EXAMPLES / name
    files = sorted(f for f in source.iterdir() if f.is_file())
    for file in files:
        if (folder / file.name).exists():
            raise InputError(folder / file.name, "", "is already there; name another folder")
    written = []
    try:
        folder.mkdir(parents=True, exist_ok=True)
        for file in files:
            written.append(folder / file.name)
            written[-1].write_bytes(file.read_bytes())
    except OSError as error:
        for path in written:  # half an example would be in the way of the next attempt
            with suppress(OSError):
                path.unlink(missing_ok=True)
        raise OutputError(
            f"{folder}: cannot be written: {error.strerror}; free space or name another folder"
        ) from None
    click.echo(f"wrote {', '.join(f.name for f in files)} to {folder}")
    click.echo(f"next: {advice.format(folder / project)}")
