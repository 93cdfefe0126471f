"""Conversion of results to plain values: the numbers, texts, lists and dicts that JSON has."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping, Sequence
from dataclasses import fields, is_dataclass
from typing import Any


def json_text(content: Any) -> str:
    """Return the text of a JSON file with a value; numbers that are not finite become null."""
    return json.dumps(plain_values(content), indent=1, allow_nan=False) + "\n"


def plain_values(value: Any) -> Any:
    """Convert dataclasses, arrays and mappings to plain values; a number not finite is None."""
    if is_dataclass(value):
        return {f.name: plain_values(getattr(value, f.name)) for f in fields(value)}
    if hasattr(value, "tolist"):
        value = value.tolist()
    if isinstance(value, float) and not math.isfinite(value):
        return None
    if isinstance(value, Mapping):
        return {key: plain_values(item) for key, item in value.items()}
    if isinstance(value, Sequence) and not isinstance(value, str):
        return [plain_values(item) for item in value]
    return value if isinstance(value, int | float | None) else str(value)
