"""Readers of measured files, by content or `format`; InputError names file, line and column."""

from importlib import import_module
from typing import Any

_PLACES = {
    "format_names": "registry", "read_bending_curves": "bending", "read_field": "fields",
    "read_fields": "fields", "read_frames": "frames", "read_load_curves": "curves",
    "read_machine_loads": "machine_tables", "read_published_polynomials": "curves",
    "read_surfaces": "fields",
}  # fmt: skip
__all__ = [*_PLACES]


def __getattr__(name: str) -> Any:
    if name in _PLACES:
        return getattr(import_module(f".{_PLACES[name]}", __name__), name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
