"""Decks of the user's own: any finite element program's input with parameters to be found."""

from ...materials.law import HypoelasticLaw
from ..base import BaseKind, MakeSolver, PreparedTest
from .prepared import prepare_deck
from .section import DeckSection
from .test import DeckTest, read


class DeckKind(BaseKind):
    """An input deck of the user's own, with what is measured of its results."""

    name = "deck"
    title = "an input deck of your own, with what of its results was measured"
    section = DeckSection
    folder_key = "folder"
    fitted = True
    read = staticmethod(read)

    def prepare(self, test: DeckTest, law: HypoelasticLaw, make_solver: MakeSolver) -> PreparedTest:
        """Return the prepared test; its template was filled once."""
        return prepare_deck(test, law, make_solver)


KIND = DeckKind()
