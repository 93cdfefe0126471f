"""Pages of the Python interface: up to date with the docstrings, and complete."""

from __future__ import annotations

import bubblefit

from .places import ROOT
from .scripts import script

MAKER = script("docs/make_api.py")


def test_pages_are_up_to_date() -> None:
    """Else: make docs."""
    stale = [path.name for path, text in MAKER.pages().items() if path.read_text() != text]
    assert not stale


def test_the_interface_is_on_them() -> None:
    pages = "".join(path.read_text() for path in (ROOT / "docs/reference/api").glob("*.md"))
    for name in bubblefit.__all__:
        assert f"### {name}\n" in pages or f"### class {name}\n" in pages


def test_signatures_and_entries() -> None:
    make = MAKER

    def fit(a: int, *rest: str, b: str = "x", **more: float) -> list[int]:
        """Fit.

        Parameters
        ----------
        a : first. b : in "x" or
            "y". more : of it.

        Returns
        -------
        Something.
        """
        return [a]

    assert "fit(a: int, *rest: str, b: str = 'x', **more: float) -> list[int]" in make.signature(
        "fit", fit
    )
    text = make.text_of(fit)
    assert '- `a`: first.\n- `b`: in "x" or "y".\n- `more`: of it.' in text
    assert "**Returns**\n\nSomething." in text
