"""Decks of the user's own: any finite element program's input with parameters to be found."""

from ..base import BaseKind
from .prepared import prepare_deck
from .section import DeckSection
from .test import read


class DeckKind(BaseKind):
    """An input deck of the user's own, with what is measured of its results."""

    name = "deck"
    title = "an input deck of your own, with what of its results was measured"
    section = DeckSection
    folder_key = "folder"
    fitted = True
    read = staticmethod(read)
    prepare = staticmethod(prepare_deck)


KIND = DeckKind()
