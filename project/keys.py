"""Types of keyword arguments of tests, laws and fits, which keys.pyi lists for type checkers."""

from typing import Any, TypeAlias

_Keys: TypeAlias = dict[str, Any]
BubbleKeys = BubbleFileKeys = StripsKeys = StripsFileKeys = _Keys
BiaxialKeys = BiaxialFileKeys = CylinderKeys = CylinderFileKeys = _Keys
DeckKeys = DeckFileKeys = SheetKeys = RegistrationKeys = LawKeys = FitKeys = _Keys
