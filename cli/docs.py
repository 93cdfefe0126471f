"""`bubblefit docs`: the documents that come with this version, on the terminal."""

from __future__ import annotations

import sys
from collections.abc import Mapping
from pathlib import Path

import click

from ..documents import find_document, pages, title_of
from .examples import examples
from .exits import exits


@click.command(
    "docs",
    epilog=examples(
        "bubblefit docs",
        "bubblefit docs own-bubble-test",
        "bubblefit docs how-to/marc",
        "bubblefit docs project-file --path",
    ),
)
@click.argument("topic", required=False)
@click.option("--path", is_flag=True, help="Print where the page is, instead of the page.")
@exits
def command(topic: str | None, path: bool) -> None:
    """Read a page of the documents, or list them all.

    TOPIC is a page's name, with its folder where two have one name. On a terminal the page is laid
    out and paged; elsewhere it comes as it is written, in Markdown.
    """
    known = pages()
    if topic is None:
        click.echo("\n".join(_listed(known)))
        return
    name, others = find_document(topic, known)
    if others:
        click.echo(f"note: there is also {', '.join(others)}", err=True)
    if path:
        click.echo(str(known[name]))
    elif sys.stdout.isatty():
        _show(known[name])
    else:
        click.echo(known[name].read_text(encoding="utf-8"), nl=False)


def _listed(known: Mapping[str, Path]) -> list[str]:
    """A line a page, by its name."""
    wide = max(map(len, known)) + 2
    return [f"{name:<{wide}}{title_of(path)}" for name, path in known.items()]


def _show(page: Path) -> None:
    """Laid out, in the terminal's pager."""
    from rich.console import Console
    from rich.markdown import Markdown

    console = Console()
    with console.pager(styles=True):
        console.print(Markdown(page.read_text(encoding="utf-8")))
