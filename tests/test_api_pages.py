"""Pages of the Python interface are complete, and the index names each."""

from __future__ import annotations

import bubblefit

from .places import ROOT
from .scripts import script

MAKER = script("docs/make_api.py")


def test_the_index_names_every_page() -> None:
    index = (ROOT / "docs/reference/api/README.md").read_text()
    for name in MAKER.pages():
        assert f"`reference/api/{name.removesuffix('.md')}`" in index


def test_the_interface_is_on_them() -> None:
    pages = "".join(MAKER.pages().values())
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
