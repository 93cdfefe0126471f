"""The pictures of README.md and of docs/start.md, from tests whose answers are known.

python docs/make_overview.py FOLDER    # fits in FOLDER, draws into docs/pictures

The first picture shows the bubble of make_own_bubble.py as a camera measures it, an extract of the
report page and the card; the second one the beginning of the page of the first example. A fit that
FOLDER holds is not repeated. Needs matplotlib and a browser.
"""

from __future__ import annotations

import re
import runpy
import subprocess
import sys
import tomllib
from pathlib import Path
from typing import Any

import matplotlib.pyplot as plt
import numpy as np
import pandas as pd
from bubblefit.reports.html import browser_command, find_browser
from PIL import Image
from scipy.interpolate import RBFInterpolator

HERE = Path(__file__).resolve().parent
PICTURES = HERE / "pictures"
OWN_BUBBLE = runpy.run_path(str(HERE / "make_own_bubble.py"))
FRAME = "step_06_300kPa.csv"
INK, GREY, PAPER = "#1f2933", "#8a94a0", "#f6f8fa"
#: What the extract of the page shows: its head and the moduli over strain.
EXTRACT = """<style>
main section:not([aria-labelledby=section-3]), nav, dl.facts, button { display: none }
</style></head>"""


def fit_own_bubble(folder: Path) -> Path:
    """Write the own bubble test and fit it with elements that resolve it; return the output."""
    out = folder / "out"
    if not (out / "report.html").is_file():
        OWN_BUBBLE["write_frames"](folder)
        path = OWN_BUBBLE["write_project"](folder)
        path.write_text(re.sub(r"(?m)^elements = \d+", "elements = 1600", path.read_text()))
        OWN_BUBBLE["run"](folder, "fit", path.name, "--out", "out", "--starts", "1")
    return out


def fit_first_example(folder: Path) -> Path:
    """Run the commands of the start page; return the output."""
    out = folder / "out" / "mine"
    if not (out / "report.html").is_file():
        OWN_BUBBLE["run"](folder, "init", "mine")
        OWN_BUBBLE["run"](folder, "fit", "mine/project.toml", "--starts", "4")
    return out


def screenshot(page: Path, size: tuple[int, int], extract: str = "") -> Image.Image:
    """Return the beginning of a page as a browser shows it, twice as sharp."""
    text = page.read_text(encoding="utf-8")
    if extract:  # the page's own policy refuses a style that is added
        text = re.sub(r'<meta http-equiv="Content-Security-Policy"[^>]*>', "", text)
        text = text.replace("</head>", extract, 1)
    shown = page.with_name("shown.html")
    shown.write_text(text, encoding="utf-8")
    picture = page.with_name("shown.png")
    browser = find_browser()
    assert browser is not None, "needs Chromium, Chrome or Edge on the PATH"
    command = browser_command(browser, page.with_name("browser"))
    command += ["--force-device-scale-factor=2", "--hide-scrollbars"]
    command += [f"--screenshot={picture}", f"--window-size={size[0]},{size[1]}", shown.as_uri()]
    subprocess.run(command, check=True, capture_output=True)
    return Image.open(picture).convert("RGB")


def measured_points(folder: Path) -> np.ndarray:
    """Return the (n, 3) positions, mm, that the camera saw, in the coordinates of the sheet."""
    table = pd.read_csv(folder / "data" / FRAME).to_numpy()
    points = table[table[:, 6] >= 0]
    return (points[:, :3] - OWN_BUBBLE["SHIFT"] + points[:, 3:6]) @ OWN_BUBBLE["TURN"]


def draw_bubble(axes: Any, points: np.ndarray) -> None:
    """Draw the measured points and the surface through them, coloured by height."""
    x, y, z = points.T
    radius, angle = np.meshgrid(np.linspace(0.0, 96.0, 40), np.linspace(0.0, 2.0 * np.pi, 120))
    grid = radius * np.cos(angle), radius * np.sin(angle)
    spline = RBFInterpolator(points[:, :2], z, neighbors=40, smoothing=1.0)
    height = spline(np.column_stack([part.ravel() for part in grid])).reshape(radius.shape)
    axes.plot_surface(*grid, height, cmap="viridis", rstride=1, cstride=1, alpha=0.75, linewidth=0)
    axes.scatter(x, y, z + 0.5, s=2.5, c=INK, depthshade=False)
    axes.set_box_aspect((1, 1, 0.42), zoom=0.9)
    axes.view_init(28, -58)
    axes.set(xticks=[-100, 0, 100], yticks=[-100, 0, 100], zticks=[0, 20, 40])
    axes.set_xlabel("warp, mm", labelpad=5)
    axes.set_ylabel("fill, mm", labelpad=5)
    axes.set_zlabel("height, mm", labelpad=-1)


def export_text(file: Path) -> str:
    """Return the beginning of what the camera's program exported, cut to the picture's width."""
    lines = file.read_text(encoding="utf-8").splitlines()
    shown = [lines[0], *lines[30:36]]
    return "\n".join([file.name, "", *(f"{line[:44]} ..." for line in shown), "..."])


def card_text(card: Path) -> str:
    """Return the main lines of a card, its numbers shortened to the width of the picture."""
    content = tomllib.loads(card.read_text(encoding="utf-8"))
    beta = [f"{value:.3g}" for value in content["beta"]]
    lines = [f'{key} = "{content[key]}"' for key in ("name", "law", "form", "unit")]
    lines += ["beta = ["]
    lines += [f"    {', '.join(beta[k : k + 4])}," for k in range(0, len(beta), 4)]
    lines += ["]", *(f"{key} = {content[key]}" for key in ("nu12", "thickness_mm"))]
    lines += ["", "[valid_strain]"]
    lines += [f"{key} = [{a:g}, {b:.3g}]" for key, (a, b) in content["valid_strain"].items()]
    lines += ["", "[certainty.band]"]
    for name, (strain, lower, upper) in content["certainty"]["band"].items():
        lines += [f"{name} = ["]
        lines += [f"    [{v[0]:.4g}, {v[1]:.4g}, ...]," for v in (strain, lower, upper)]
        lines += ["]"]
    return "\n".join(lines)


def overview(folder: Path) -> Image.Image:
    """Return bubble, page and card side by side."""
    out = fit_own_bubble(folder)
    page = screenshot(out / "report.html", (930, 1062), EXTRACT)
    plt.rcParams.update({"font.size": 11, "text.color": INK, "axes.labelcolor": INK})
    figure = plt.figure(figsize=(16, 8), dpi=100)
    shape = figure.add_axes((-0.01, 0.285, 0.345, 0.66), projection="3d")
    export = figure.add_axes((0.02, 0.03, 0.3, 0.235), facecolor=PAPER)
    panel = figure.add_axes((0.345, 0.03, 0.39, 0.89))
    card = figure.add_axes((0.75, 0.03, 0.24, 0.89), facecolor=PAPER)
    draw_bubble(shape, measured_points(folder))
    panel.imshow(page, aspect="auto")
    for axes, text, size in (
        (export, export_text(folder / "data" / FRAME), 10),
        (card, card_text(out / "material.toml"), 10.8),
    ):
        axes.annotate(text, (0, 1), (10, -10), "axes fraction", "offset points", va="top",
                      family="monospace", fontsize=size)  # fmt: skip
    for axes in (export, panel, card):
        axes.set(xticks=[], yticks=[])
        axes.spines[:].set_color(GREY)
    titles = {0.02: "1  A measured bubble", 0.345: "2  The report page", 0.75: "3  The card"}
    for left, title in titles.items():
        figure.text(left, 0.945, title, fontsize=17, weight="bold")
    figure.savefig(folder / "overview.png")
    return Image.open(folder / "overview.png")


def save(picture: Image.Image, name: str) -> None:
    """Write a picture of the documents in few colours, small ones such as a light among them."""
    few_colours = picture.convert("RGB").quantize(256, Image.Quantize.MAXCOVERAGE)
    few_colours.save(PICTURES / name, optimize=True)


def main() -> None:
    """Draw both pictures."""
    folder = Path(sys.argv[1]).resolve()
    for part in ("own", "first"):
        (folder / part).mkdir(parents=True, exist_ok=True)
    save(overview(folder / "own"), "overview.png")
    page = screenshot(fit_first_example(folder / "first") / "report.html", (860, 760))
    save(page.resize((page.width * 3 // 4, page.height * 3 // 4)), "start-report.png")


if __name__ == "__main__":
    main()
