"""The pictures and the table of docs/how-to/gallery.md: one made test, analysed well and badly.

python docs/make_gallery.py FOLDER [CASE ...]    # writes the test there, fits it, draws

The test is that of make_own_bubble.py, whose moduli are known. Every case changes one thing.
"""

from __future__ import annotations

import csv
import json
import subprocess
import sys
from pathlib import Path

from make_own_bubble import HERE, write_frames, write_project
from PIL import Image

#: Case: (old, new) texts of the project file.
CASES = {
    "good": (),
    "radius": (("radius = 100", "radius = 97"),),
    "axes": (
        ("[bubble.data.points.registration]", "[bubble.data.points.registration]\nwarp = 0.0"),
    ),
    "constant": (('form = "cubic"', 'form = "constant"'),),
}
SHOWN = ("moduli.png",)
WIDTH = 900


def analyse(folder: Path, case: str, text: str) -> None:
    """Check and fit a case, print its warnings and moduli, and keep its pictures."""
    for old, new in CASES[case]:
        assert text.count(old) == 1, old
        text = text.replace(old, new)
    (folder / f"{case}.toml").write_text(text)
    out = folder / case
    command = ["fit", f"{case}.toml", "--out", case, "--starts", "1", "--overwrite"]
    run = subprocess.run(
        [sys.executable, "-m", "bubblefit", *command], cwd=folder, capture_output=True, text=True
    )
    print(f"\n== {case}: exit code {run.returncode}")
    if run.returncode:
        print(run.stderr.strip())
        return
    print(run.stdout)
    for row in csv.DictReader((out / "notes.csv").open()):
        print("  note", row["kind"], "|", row["note"])
    result = json.loads((out / "result.json").read_text())
    print("  misfit", json.dumps(result.get("misfit"))[:300])
    pictures = [Image.open(out / name).convert("RGB") for name in SHOWN if (out / name).exists()]
    for name, picture in zip(SHOWN, pictures, strict=False):
        small = picture.resize((WIDTH, round(WIDTH * picture.height / picture.width)))
        small.quantize(64).save(HERE / "pictures" / f"gallery-{case}-{name}", optimize=True)


def main() -> None:
    folder = Path(sys.argv[1])
    folder.mkdir(parents=True, exist_ok=True)
    if not (folder / "project.toml").exists():
        write_frames(folder)
        write_project(folder)
    text = (folder / "project.toml").read_text()
    for case in sys.argv[2:] or CASES:
        analyse(folder, case, text)


if __name__ == "__main__":
    main()
