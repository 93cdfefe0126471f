"""docs/adding.md: its code is the examples', its numbers are counted, its promise is kept."""

from __future__ import annotations

import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]
TEXT = (ROOT / "docs" / "adding.md").read_text()
EXTRAS = ROOT / "examples" / "plug-in" / "bubblefit_extras"
COBYLA = ROOT / "inference" / "methods" / "cobyla.py"


def test_the_code_is_that_of_the_example():
    blocks = re.findall(r"```(?:toml|python)\n(.*?)```", TEXT, re.DOTALL)
    paths = [*EXTRAS.glob("*.py"), EXTRAS.parent / "pyproject.toml", COBYLA]
    sources = [plain(path.read_text()) for path in paths]
    assert len(blocks) > 8
    for block in blocks:
        assert any(plain(block) in source for source in sources), block


def plain(text):
    """Lines without their indent, and without empty ones: formatters of documents change both."""
    return "\n".join(line.strip() for line in text.splitlines() if line.strip())


def test_the_lines_of_the_example_are_counted():
    said = {name: int(lines) for name, lines in re.findall(r"(\w+\.py), (\d+) \|", TEXT)}
    assert said == {
        path.name: len(path.read_text().splitlines())
        for path in EXTRAS.glob("*.py")
        if path.name != "__init__.py"
    }


@pytest.mark.slow
def test_a_form_a_kind_and_a_format_are_one_file_each_inside(tmp_path):
    """In a copy of the house, each file of the example where it belongs, and nothing else."""
    house = tmp_path / "bubblefit"
    skip = shutil.ignore_patterns(".*", "tests", "docs", "examples", "benchmarks", "__pycache__")
    shutil.copytree(ROOT, house, ignore=skip, symlinks=True)
    before = {path: path.read_bytes() for path in house.rglob("*") if path.is_file()}
    put(
        house / "materials/forms/saturating.py",
        "saturating.py",
        "from bubblefit.materials.forms.base import register_form\n\nregister_form(SATURATING)",
    )
    put(
        house / "readers/formats/riglog.py",
        "riglog.py",
        "from bubblefit.readers.registry import register_format\n\nregister_format(RIGLOG)",
    )
    put(house / "experiments/datasheet/__init__.py", "datasheet.py", "")
    files = {path for path in house.rglob("*") if path.is_file()}
    assert len(files - before.keys()) == 3  # and none was changed
    code = f"""if True:
        import bubblefit as bf
        from bubblefit.readers.registry import format_of
        from bubblefit.runs.setup import law_of
        assert bf.__file__.startswith({str(house)!r})
        project = bf.read_project({str(ROOT / "examples/plug-in/project.toml")!r})
        assert list(project.tests) == ["supplier", "strips"], list(project.tests)
        print(law_of(project, list(project.tests.values())).form.name)
        print(format_of("machine table", {str(ROOT / "examples/plug-in/warp.rig")!r}).name)
        """
    done = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, timeout=120, cwd=tmp_path,
        env={"PYTHONPATH": str(tmp_path)},
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    assert done.stdout.split() == ["saturating", "riglog"]


def put(path, name, last):
    path.parent.mkdir(exist_ok=True)
    path.write_text(f"{(EXTRAS / name).read_text()}\n{last}\n")
