"""What is shown of each kind of test: a module a kind, which registers its presenter."""

from importlib import import_module
from pathlib import Path

from ...experiments.base import Kind


def load_presenter(kind: Kind) -> None:
    """Import the module of a kind of ours."""
    if (Path(__file__).parent / f"{kind.name}.py").exists():
        import_module(f".{kind.name}", __package__)
