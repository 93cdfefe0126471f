"""`bubblefit report FOLDER`: the page again, on paper, or two of them side by side."""

from __future__ import annotations

import os
from pathlib import Path

import click

from ..errors import InputError
from .arguments import PATH
from .examples import examples
from .exits import exits


@click.command(
    "report",
    epilog=examples(
        "bubblefit report out/fabric",
        "bubblefit report out/fabric --format pdf",
        "bubblefit report out/cubic out/spline --out both.html",
    ),
)
@click.argument("folders", type=PATH, nargs=-1, required=True, metavar="FOLDER [OTHER]")
@click.option(
    "--format", "kind", type=click.Choice(["html", "pdf"]), default="html", show_default=True,
    help="pdf: printed by a browser, where there is one.",
)  # fmt: skip
@click.option(
    "--out", type=PATH, help="The file.  [FOLDER/report.html; of two: FOLDER-beside-OTHER.html]"
)
@exits
def command(folders: tuple[Path, ...], kind: str, out: Path | None) -> None:
    """Make the page of an output folder again, or one of two folders side by side.

    Everything is computed from what the folder holds: the same bytes but for the day. Of a run
    that is not finished the page says what is recorded so far.
    """
    import tempfile

    from ..reports.content import beside
    from ..reports.html import PAGE, write_page
    from ..reports.pdf import print_page
    from ..reports.unfinished import page_of_folder

    if len(folders) > 2:
        raise InputError(None, "FOLDER", f"give one folder or two, not {len(folders)}")
    for folder in folders:
        if not folder.is_dir():
            raise InputError(folder, "", "there is no such folder")
    reports = [page_of_folder(folder) for folder in folders]
    if len(folders) == 1:
        base, report, usual = folders[0], reports[0], folders[0] / PAGE
    else:
        base = Path(os.path.commonpath([folder.resolve() for folder in folders]))
        names = [folder.resolve().relative_to(base).as_posix() for folder in folders]
        if "." in names or names[0] == names[1]:
            raise InputError(folders[1], "", "give two folders, neither within the other")
        report = beside((names[0], reports[0]), (names[1], reports[1]))
        plain = [folder.resolve().name for folder in folders]
        usual = Path(f"{plain[0]}-beside-{plain[1]}.html")
    path = out or (usual if kind == "html" else usual.with_suffix(".pdf"))
    if kind == "html":
        write_page(base, report, path)
    else:
        with tempfile.TemporaryDirectory() as place:
            print_page(write_page(base, report, Path(place) / PAGE), path)
    click.echo(f"page: {path}")
