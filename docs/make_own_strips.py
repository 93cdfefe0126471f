"""The test of docs/how-to/own-strip-tests.md: public strips of a nylon ripstop.

python docs/make_own_strips.py FOLDER [DATA]   # DATA: the folder with strips_directions/strips.csv
"""

from __future__ import annotations

import csv
import sys
from pathlib import Path

from make_own_bubble import run

DATA = Path(__file__).resolve().parents[2] / "shared" / "data"
DEGREES = {"0": "warp", "90": "fill", "45": "bias"}
CHANGES = (
    ('form = "cubic"', 'form = "quadratic"'),
    ("width = 25.0", "width = 27.0"),
    ("grip_distance = 75.0", "grip_distance = 101.0"),
    ("gauge_length = 20.0", "gauge_length = 97.0"),
    ("final_length = 23.0", "final_length = 100.9"),
    ("final_length = 24.0", "final_length = 100.7"),
    ("final_length = 28.0", "final_length = 101.0"),
)


def write(folder: Path, data: Path = DATA) -> Path:
    """Write the project that `init --own` writes, with the changes of the document; its path."""
    tests = "--own", "--strips", "1", "--bubble", "0", "--thickness", "0.17"
    run(Path(), "init", str(folder), *tests)
    with open(data / "strips_directions" / "strips.csv", encoding="utf-8") as stream:
        rows = list(csv.DictReader(stream))
    (folder / "data").mkdir()
    for degrees, direction in DEGREES.items():
        curve = [(r["elongation_mm"], r["force_N"]) for r in rows if r["direction_deg"] == degrees]
        lines = ["elongation (mm),force (N)", *map(",".join, curve)]
        (folder / "data" / f"{direction}1.csv").write_text("\n".join(lines) + "\n")
    path = folder / "project.toml"
    text = path.read_text()
    for old, new in CHANGES:
        assert old in text, old
        text = text.replace(old, new)
    path.write_text(text)
    return path


def main() -> None:
    project = str(write(Path(sys.argv[1]), *map(Path, sys.argv[2:])))
    run(Path(), "check", project)
    run(Path(), "fit", project, "--starts", "3", "--jobs", "2")


if __name__ == "__main__":
    main()
