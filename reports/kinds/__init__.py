"""Presenters of the built-in kinds of test: one module or folder for each kind.

Each registers its presenter when it is imported.
"""

from importlib import import_module
from pathlib import Path
from pkgutil import iter_modules

from ...experiments.base import Kind


def load_presenter(kind: Kind) -> None:
    """Import the module that presents a kind of test, if it is a built-in kind."""
    if kind.name in (module.name for module in iter_modules([str(Path(__file__).parent)])):
        import_module(f".{kind.name}", __package__)
