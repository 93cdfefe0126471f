"""The pictures of README.md and of the start page, from a test whose answer is known.

python docs/make_overview.py FOLDER    # FOLDER: where make_own_bubble.py has written and fitted it

The first picture shows the measured bubble, the report page and the card; the second one the
beginning of the page of the first example. Needs matplotlib and a browser.
"""

from __future__ import annotations

import runpy
import subprocess
import sys
from pathlib import Path
from typing import Any

import matplotlib.pyplot as plt
import numpy as np
import tomllib
from bubblefit.reports.html import BROWSERS, browser_command
from PIL import Image

HERE = Path(__file__).resolve().parent
PICTURES = HERE / "pictures"
OWN_BUBBLE = runpy.run_path(str(HERE / "make_own_bubble.py"))
OUT = "out"
INK, GREY = "#1f2933", "#8a94a0"


def screenshot(page: Path, target: Path, size: tuple[int, int], scale: float = 2.0) -> Image.Image:
    """Return a picture of the beginning of a page as a browser shows it."""
    program = next(name for name in BROWSERS if subprocess.run(["which", name]).returncode == 0)
    command = browser_command(program, target.parent / "browser")
    command += [f"--screenshot={target}", f"--window-size={size[0]},{size[1]}"]
    command += [f"--force-device-scale-factor={scale}", "--hide-scrollbars", page.as_uri()]
    subprocess.run(command, check=True, capture_output=True)
    return Image.open(target).convert("RGB")


def measured_points(folder: Path, frame: str) -> np.ndarray:
    """Return the (n, 3) positions, mm, that the camera saw, in the coordinates of the sheet."""
    table = np.genfromtxt(folder / "data" / frame, delimiter=",", skip_header=1)
    seen = table[table[:, 6] >= 0]
    return (seen[:, :3] - OWN_BUBBLE["SHIFT"] + seen[:, 3:6]) @ OWN_BUBBLE["TURN"]


def draw_bubble(axes: Any, points: np.ndarray) -> None:
    """Draw measured points and their heights."""
    drawing = axes.scatter(*points.T, c=points[:, 2], s=9, cmap="viridis", depthshade=False)
    axes.set_box_aspect((1, 1, 0.42))
    axes.view_init(24, -60)
    axes.set(xticks=[-100, 0, 100], yticks=[-100, 0, 100], zticks=[0, 20, 40])
    axes.set_xlabel("warp, mm", labelpad=4)
    axes.set_ylabel("fill, mm", labelpad=4)
    bar = plt.colorbar(drawing, ax=axes, orientation="horizontal", shrink=0.6, pad=0.08)
    bar.set_label("height, mm")


def card_text(card: Path) -> str:
    """Return the beginning of a card, numbers shortened to the width of the picture."""
    content = tomllib.loads(card.read_text(encoding="utf-8"))
    lines = [f'{key} = "{content[key]}"' for key in ("name", "law", "form", "unit")]
    rows = [", ".join(f"{value:.4g}" for value in four) for four in chunks(content["beta"], 4)]
    lines += ["beta = [", *(f"    {row}," for row in rows), "]"]
    lines += [f"{key} = {content[key]}" for key in ("nu12", "thickness_mm")]
    lines += ["", "[valid_strain]"]
    lines += [f"{key} = [{a:g}, {b:.3g}]" for key, (a, b) in content["valid_strain"].items()]
    return "\n".join([*lines, "", "[certainty]", "..."])


def chunks(values: list[float], size: int) -> list[list[float]]:
    """Return consecutive parts of a list."""
    return [values[start : start + size] for start in range(0, len(values), size)]


def overview(folder: Path) -> None:
    """Draw bubble, page and card side by side."""
    page = screenshot(folder / OUT / "report.html", folder / "page.png", (720, 800))
    plt.rcParams.update({"font.size": 11, "text.color": INK, "axes.labelcolor": INK})
    figure = plt.figure(figsize=(16, 6.6), dpi=100)
    titles = ("1  The test: points that cameras measured", "2  The report page", "3  The material card")
    for title, left in zip(titles, (0.02, 0.345, 0.72), strict=True):
        figure.text(left, 0.945, title, fontsize=17, weight="bold")
    draw_bubble(figure.add_axes((0.0, 0.02, 0.33, 0.9), projection="3d"), measured_points(folder, "step_06_300kPa.csv"))
    panel = figure.add_axes((0.345, 0.03, 0.355, 0.88))
    panel.imshow(page, aspect="auto")
    card = figure.add_axes((0.72, 0.03, 0.27, 0.88), facecolor="#f6f8fa")
    card.text(0.03, 0.975, card_text(folder / OUT / "material.toml"), family="monospace", va="top", fontsize=11.5, transform=card.transAxes)
    for axes in (panel, card):
        axes.set(xticks=[], yticks=[])
        for spine in axes.spines.values():
            spine.set_color(GREY)
    figure.savefig(folder / "overview.png")
    save(Image.open(folder / "overview.png"), "overview.png")


def save(picture: Image.Image, name: str) -> None:
    """Write a picture of the documents in few colours."""
    picture.convert("RGB").quantize(128).save(PICTURES / name, optimize=True)


def main() -> None:
    """Draw both pictures."""
    folder = Path(sys.argv[1]).resolve()
    overview(folder)


if __name__ == "__main__":
    main()
