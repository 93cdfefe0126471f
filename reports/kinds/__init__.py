"""What is shown of each kind of test: a module or folder a kind, which registers its presenter."""

from importlib import import_module
from pathlib import Path
from pkgutil import iter_modules

from ...experiments.base import Kind


def load_presenter(kind: Kind) -> None:
    """Import the module of a kind of ours."""
    if kind.name in (module.name for module in iter_modules([str(Path(__file__).parent)])):
        import_module(f".{kind.name}", __package__)
