"""A second implementation of what bubblefit reports; it imports nothing of bubblefit.

`python tests/audit FOLDER [--project FILE]` recomputes the numbers of a finished output folder by
the definitions of docs/reference/files.md, and prints what differs. In the tests, `audit(path)`.

Parts
-----
`pages.py`    `Page`: headings, tables (merged where the page folds them), facts and sentences of
              report.html.
`folders.py`  `Folder`: everything in an output folder, with its project and its measured data.
`ledger.py`   `Ledger`: every number that is reported; auditors claim them, with how each was
              checked. What nobody claims is an error.
`laws.py`     `Law`: moduli of a material card.
`tools.py`    tables and terminals of commands that leave no folder: `audit_table`,
              `audit_printed`.
Other modules hold auditors. A module that defines `COMMANDS`, a mapping of the `command` of
result.json (or of the name of a CSV where there is no result.json) to a function
`auditor(folder, ledger)`, is found by itself (`run.py`).

How an auditor reads
--------------------
    def audit_profile(folder, ledger):
        profile = folder.result["profiles"][0]
        # a leaf of a JSON file, or a whole branch: dicts and lists are compared leaf by leaf
        ledger.json("level", 0.95, "echoed")
        ledger.json(("profiles", 0, "MPa"), folder.card.modulus("E1", 0.0))
        # a column of a CSV: every row, or those of a mask
        ledger.column("profile.csv", "MPa", expected, "recomputed", rel=1e-8)
        # a table of the page, cell by cell: text as it stands, numbers with their digits,
        # None: not looked at, and so not claimed
        ledger.table("Profiles", ["modulus", "MPa"], [["E1", 364.255]], digits=4)
        # sentences wherever they stand (page, strings of JSON and CSV, terminal); each group is
        # a number, and what it must be; the pattern's other numbers are wording
        ledger.text(r"(\\S+) analyses", [profile["analyses"]], "consistent")
        # what was looked at otherwise
        ledger.find("profile.csv", "the curve does not touch zero")

`how` is "recomputed" (from definitions, card, data), "consistent" (equal to a number elsewhere that
is itself audited), or "echoed" (of the project, the card or the command). Tolerances: `rel`, `abs`
for numbers at full length; printed numbers must be rounded to their digits, and right.
"""

from .run import audit, audit_printed, audit_table, is_known

__all__ = ["audit", "audit_printed", "audit_table", "is_known"]
