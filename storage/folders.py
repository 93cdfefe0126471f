"""Folders of the package and of the user's cache."""

from __future__ import annotations

import os
from pathlib import Path

#: Folder of the package, and that of its templates for input decks and pages.
ROOT = Path(__file__).resolve().parent.parent
TEMPLATES = ROOT / "templates"


def cache_folder() -> Path:
    """Return $BUBBLEFIT_CACHE, else the user's cache folder of this system; it may not be there."""
    from platformdirs import user_cache_path

    named = os.environ.get("BUBBLEFIT_CACHE")
    return Path(named) if named else user_cache_path("bubblefit", appauthor=False)
