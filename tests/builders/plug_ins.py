"""Distributions that add something to bubblefit: by pip, or what it leaves, written by hand."""

import shutil
import subprocess
import sys


def install_by_pip(source, place):
    shutil.copytree(source, place / "source", ignore=shutil.ignore_patterns("__pycache__"))
    subprocess.run(
        [sys.executable, "-m", "pip", "install", "--quiet", "--no-deps", "--no-index",
         "--no-build-isolation", "--target", place / "site", place / "source"],
        check=True,
    )  # fmt: skip
    return place / "site"


def install_plug_in(
    folder, name, text, distribution="acme-things", module=None, group="bubblefit.laws"
):
    module = module or f"acme_{name}"
    if text:
        (folder / f"{module}.py").write_text(text)
    info = folder / f"{distribution.replace('-', '_')}-2.5.dist-info"
    info.mkdir(exist_ok=True)
    (info / "METADATA").write_text(f"Metadata-Version: 2.1\nName: {distribution}\nVersion: 2.5\n")
    with (info / "entry_points.txt").open("a") as file:
        file.write(f"[{group}]\n{name} = {module}:THING\n")
