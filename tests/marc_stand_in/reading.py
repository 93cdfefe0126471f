"""A deck file to what it holds."""

from __future__ import annotations

from pathlib import Path

from .checks import check
from .content import Content
from .fields import Deck
from .history import read_history
from .model import read_model
from .parameters import read_parameters


def read_deck(path: Path) -> Content:
    """Everything in a deck.

    Raises
    ------
    DeckError : Marc would refuse it.
    """
    deck = Deck(path)
    content = Content(read_parameters(deck))
    read_model(deck, content)
    read_history(deck, content)
    check(content)
    return content
