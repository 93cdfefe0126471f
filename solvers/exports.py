"""Every format that a card can be exported in, by its name."""

from __future__ import annotations

from collections.abc import Mapping

from ..materials.exports import registry
from ..materials.exports.base import Format
from .calculix import library as calculix

FORMATS: Mapping[str, Format] = {each.name: each for each in (*registry.FORMATS, calculix.FORMAT)}
