"""The command line of run_marc, in its current and in its older form."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

#: Options that take a word, in both forms: job, version, background, domains, threads, user code.
WORDS = {
    "-j": "job", "-jid": "job", "-v": "verify", "-b": "background", "-u": "user",
    "-nte": "count", "-nts": "count", "-nps": "count", "-nprocd": "count", "-nthread": "count",
    "-save": "word", "-prog": "word", "-dir": "folder", "-q": "word",
}  # fmt: skip


@dataclass
class Command:
    """What is asked for."""

    job: str
    folder: Path
    user: Path | None = None
    background: bool = False


class WrongCommand(Exception):
    """run_marc would not take it."""


def parse(arguments: list[str]) -> Command:
    """Options and their words, by pairs."""
    found: dict[str, str] = {"folder": "."}
    i = 0
    while i < len(arguments):
        option = arguments[i]
        if option not in WORDS:
            raise WrongCommand(f"unknown option {option!r}")
        if i + 1 == len(arguments) or arguments[i + 1].startswith("-"):
            raise WrongCommand(f"{option} needs a word")
        word, kind = arguments[i + 1], WORDS[option]
        if kind == "count" and not (word.isdigit() and int(word) > 0):
            raise WrongCommand(f"{option} {word!r}: expected a number of processes or threads")
        if kind in ("verify", "background") and word not in ("yes", "no", "y", "n"):
            raise WrongCommand(f"{option} {word!r}: expected yes or no")
        if kind == "job" and "job" in found:
            raise WrongCommand("two jobs")
        found[kind] = word
        i += 2
    if "job" not in found:
        raise WrongCommand("no job: -j NAME")
    folder = Path(found["folder"])
    user = None
    if "user" in found:
        user = folder / found["user"]
        user = user if user.suffix else user.with_suffix(".f")
    # Without -b no run_marc returns at once and Marc goes on in the background.
    background = found.get("background", "yes") in ("yes", "y")
    return Command(found["job"].removesuffix(".dat"), folder, user, background)
