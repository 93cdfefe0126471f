"""Where the package lies, and where it keeps what outlives a run."""

from __future__ import annotations

import os
from pathlib import Path

#: The package, and its templates of decks and pages.
ROOT = Path(__file__).resolve().parent.parent
TEMPLATES = ROOT / "templates"


def cache_folder() -> Path:
    """Return $BUBBLEFIT_CACHE, else the user's cache folder of this system; it may not be there."""
    from platformdirs import user_cache_path

    named = os.environ.get("BUBBLEFIT_CACHE")
    return Path(named) if named else user_cache_path("bubblefit", appauthor=False)
