"""Examples below the help of every command, written alike so that a test can try each."""

from __future__ import annotations

HEAD = "Examples:"


def examples(*lines: str) -> str:
    """The epilog of a command: what could be typed, a line each, not wrapped by click."""
    typed = "".join(f"  {line}\n" for line in lines)
    return f"\b\n{HEAD}\n{typed}"


def examples_in(epilog: str | None) -> list[str]:
    """The lines of an epilog that `examples` wrote."""
    _, head, typed = (epilog or "").partition(f"{HEAD}\n")
    return [line.strip() for line in typed.splitlines() if line.strip()] if head else []
