"""The Python interface: what `import bubblefit` brings, and what it leaves for later."""

from __future__ import annotations

import subprocess
import sys

import bubblefit
import pytest

#: Slow to import, or not wanted until a figure or a table is asked for.
LATER = {"numba", "scipy", "matplotlib", "pandas", "pydantic", "gmsh", "nlopt", "jinja2", "click"}


def modules_after(code: str) -> set[str]:
    """Names of all modules that are there when the code has run."""
    code = f"import sys\n{code}\nprint(*sys.modules)"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    return set(done.stdout.split())


def test_importing_is_quick() -> None:
    modules = modules_after("import bubblefit")
    assert not LATER & modules
    assert len([name for name in modules if name.split(".")[0] == "bubblefit"]) < 15


def test_result_files_of_other_programs_are_read_by_meshio() -> None:
    code = """
import bubblefit, meshio
known = meshio.extension_to_filetypes
assert ".frd" in known and ".t19" in known, known
"""
    assert "meshio" in modules_after(code)


def test_a_project_is_read_without_figures() -> None:
    known = "examples/bubble-known-solution/project.toml"
    code = f"""
import bubblefit, pathlib
bubblefit.read_project(pathlib.Path(bubblefit.__file__).parent / "{known}")
"""
    assert not {"matplotlib", "gmsh", "click"} & modules_after(code)


def test_every_name_is_there() -> None:
    assert set(bubblefit.__all__) <= set(dir(bubblefit))
    for name in bubblefit.__all__:
        thing = getattr(bubblefit, name)
        assert thing.__name__ == name and thing.__doc__
    with pytest.raises(AttributeError, match="no attribute 'nothing'"):
        _ = bubblefit.nothing


def test_the_interface_knows_no_terminal() -> None:
    code = "import bubblefit\nfor name in bubblefit.__all__: getattr(bubblefit, name)"
    assert not {"click", "bubblefit.cli"} & modules_after(code)
