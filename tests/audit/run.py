"""Audit a folder with all auditors that know what wrote it."""

import argparse
import importlib
import pkgutil
import sys
import traceback
from pathlib import Path

from . import tools
from .common import audit_collections, audit_repeated
from .folders import Folder
from .ledger import Ledger

PARTS = {"folders", "ledger", "laws", "pages", "run", "__main__"}


def auditors():
    """Return the auditor of each command, of all modules of the package."""
    package = __package__
    folder = str(Path(__file__).parent)
    commands = {}
    for module in pkgutil.iter_modules([folder]):
        if module.name not in PARTS:
            loaded = importlib.import_module(f"{package}.{module.name}")
            commands |= getattr(loaded, "COMMANDS", {})
    return commands


def is_known(path):
    """Return whether an auditor knows what wrote a folder."""
    folder = Folder(path)
    return bool({folder.command, *folder.tables} & set(auditors()))


def audit(path, project=None, terminal="", base=None):
    """Return the ledger of a folder after all auditors have looked at it.

    Numbers that nobody claims are among its findings.
    """
    folder = Folder(path, project, terminal, base)
    ledger = Ledger(folder)
    names = [folder.command, *folder.tables]
    known = auditors()
    chosen = [known[name] for name in names if name in known]
    if not chosen:
        ledger.find(str(path), f"no auditor knows the command {names[0]!r}")
    for auditor in dict.fromkeys(chosen):
        try:
            auditor(folder, ledger)
        except (
            KeyError,
            IndexError,
            ValueError,
            TypeError,
            StopIteration,
            ArithmeticError,
        ) as error:
            # A folder whose parts do not fit each other: what is missing there is the finding.
            where = traceback.extract_tb(error.__traceback__)[-1]
            ledger.find(str(path), f"the auditor fails at {where.name}: {error!r}")
    audit_collections(folder, ledger)
    audit_repeated(ledger)
    for line in ledger.unclaimed():
        ledger.find(line, "nobody audits this number")
    return ledger


def audit_table(tool, path, terminal="", base=None):
    """Return the ledger of the table that a tool (gauge, sphere) wrote, and of what it printed."""
    path = Path(path)
    folder = Folder(path.parent, terminal=terminal, base=base, files=[path.name])
    return _closed(folder, tools.TABLES[tool])


def audit_printed(command, terminal, base):
    """Return the ledger of what a command printed that writes nothing; None of other commands."""
    if command not in tools.PRINTED:
        return None
    return _closed(Folder(base, terminal=terminal, base=base, files=[]), tools.PRINTED[command])


def _closed(folder, auditor):
    folder.result = folder.check = folder.page = folder.card_text = None
    folder.starts = []
    ledger = Ledger(folder)
    auditor(folder, ledger)
    for line in ledger.unclaimed():
        ledger.find(line, "nobody audits this number")
    return ledger


def main(arguments=None):
    """Print the findings and the counts of a folder; return the exit code."""
    parser = argparse.ArgumentParser(prog="python tests/audit", description=__doc__)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--project", type=Path, help="project file; else as the folder says")
    parser.add_argument("--base", type=Path, help="folder in which the command was typed")
    given = parser.parse_args(arguments)
    ledger = audit(given.folder, given.project, base=given.base)
    for finding in ledger.findings:
        print(finding)
    kinds = ("recomputed", "consistent", "echoed", "exempt", "unclaimed")
    print(f"{'numbers':<28}" + "".join(f"{kind:>12}" for kind in kinds))
    total = dict.fromkeys(kinds, 0)
    for source, counts in ledger.counts().items():
        print(f"{source:<28}" + "".join(f"{counts[kind]:>12}" for kind in kinds))
        for kind in kinds:
            total[kind] += counts[kind]
    reported = sum(total.values()) - total["exempt"]
    share = 1.0 - total["unclaimed"] / reported if reported else 1.0
    print(f"{'all':<28}" + "".join(f"{total[kind]:>12}" for kind in kinds))
    print(f"{100 * share:.1f} % of {reported} numbers audited, {len(ledger.findings)} findings")
    return 1 if ledger.findings else 0


if __name__ == "__main__":
    sys.exit(main())
