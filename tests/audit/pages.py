"""Read report.html: its sections, tables, facts and sentences."""

import re
from dataclasses import dataclass, field
from html.parser import HTMLParser
from pathlib import Path

SENTENCES = {"p", "li", "dd", "dt", "h1", "h2", "h3", "figcaption", "summary", "pre", "time"}
WITHOUT_END = {"meta", "link", "img", "br", "input", "hr", "col"}


@dataclass(eq=False)
class Table:
    """A table of the page; `header` and `rows` hold text."""

    section: str
    title: str
    header: list = field(default_factory=list)
    rows: list = field(default_factory=list)
    note: str = ""

    def column(self, name):
        at = self.header.index(name)
        return [row[at] for row in self.rows]


class _Reader(HTMLParser):
    """Collect what a reader sees, in order."""

    def __init__(self, page):
        super().__init__(convert_charrefs=True)
        self.page = page
        self.texts = []  # of open elements: (tag, pieces)
        self.section = self.heading = ""
        self.tables = None  # of the open div or details "table"
        self.labels = []
        self.footer = False

    def handle_starttag(self, tag, attributes):
        attributes = dict(attributes)
        classes = (attributes.get("class") or "").split()
        if tag in ("div", "details") and "table" in classes:
            self._close()
            self.tables, self.heading = [], ""
        elif tag == "footer":
            self.footer = True
        if tag == "table":
            if self.tables is None:
                self.tables = []
            self.tables.append(([], []))
        elif tag == "tr" and self.tables:
            self.tables[-1][1].append([])
        elif tag == "svg" and attributes.get("aria-label"):
            self.page.sentences.append(("chart", self.section, attributes["aria-label"]))
        if tag in SENTENCES or tag in ("td", "th"):
            self.texts.append((tag, []))

    def handle_data(self, data):
        if self.texts:
            self.texts[-1][1].append(data)

    def handle_endtag(self, tag):
        if self.texts and self.texts[-1][0] == tag:
            text = " ".join("".join(self.texts.pop()[1]).replace("\u00a0", " ").split())
            self._text(tag, text)
        elif tag == "footer":
            self.footer = False
        elif tag == "section":
            self._close()

    def _text(self, tag, text):
        if tag == "th":
            self.tables[-1][0].append(text)
            return
        if tag == "td":
            self.tables[-1][1][-1].append(text)
            return
        if tag == "h2":
            self._close()
            self.section = self.heading = text
        elif tag in ("h3", "summary"):
            self._close()
            self.heading = text
            self.tables = []
            if tag == "summary":
                self.heading, self.page.counts[len(self.page.tables)] = _counted(text)
        elif tag == "dt":
            self.labels.append(text)
        elif tag == "dd":
            self.page.facts.append((self.section, self.heading, self.labels[-1], text))
        if tag == "p" and self.tables and self.tables[-1][1]:
            # The note of a table, or the next part: the table has ended in either case.
            self._close(text)
        if not self.footer and text:
            self.page.sentences.append((tag, self.section, text))

    def _close(self, note=""):
        if self.tables and self.tables[0][0]:
            table = Table(self.section, self.heading or self.section, note=note)
            table.header, table.rows = _merged(self.tables)
            self.page.tables.append(table)
        self.tables = None


def _counted(text):
    """Return a title and the number of rows, of "Starts, best first (4 rows)"."""
    match = re.fullmatch(r"(.*) \((\d+) rows\)", text)
    return (match[1], int(match[2])) if match else (text, None)


def _merged(tables):
    """Return header and rows of a table that the page folds, whose first columns are repeated."""
    header, rows = tables[0][0], [row for row in tables[0][1] if row]
    header, rows = list(header), [list(row) for row in rows]
    for more_header, more_rows in tables[1:]:
        same = 0
        while same < len(more_header) and more_header[same] == tables[0][0][same]:
            same += 1
        header += more_header[same:]
        for row, more in zip(rows, [row for row in more_rows if row], strict=True):
            assert row[:same] == more[:same], "rows of a folded table do not fit each other"
            row += more[same:]
    return header, rows


class Page:
    """The page of a folder.

    Attributes
    ----------
    tables : list of Table
    facts : list of (section, heading, label, text)
    sentences : list of (tag, section, text), headings and captions of charts among them
    counts : numbers of rows that headings of closed tables name, by the number of the table
    """

    def __init__(self, path):
        text = Path(path).read_text(encoding="utf-8")
        text = re.sub(r"<(script|style)\b.*?</\1>", "", text, flags=re.S)
        # Of a chart only its description is text.
        text = re.sub(r"(<svg\b[^>]*>).*?</svg>", r"\1</svg>", text, flags=re.S)
        self.tables, self.facts, self.sentences, self.counts = [], [], [], {}
        reader = _Reader(self)
        reader.feed(text)
        reader.close()
        summary = re.search(r'<p class="summary">(.*?)</p>', text, flags=re.S)
        self.summary = "" if summary is None else summary[1].replace("\u00a0", " ")

    def table(self, title, number=0):
        """Return the table of a title; number : of those with the same title."""
        return [table for table in self.tables if table.title == title][number]

    def fact(self, label, heading=None):
        """Return the text beside a label, "" where there is none."""
        fitting = (t for _, h, own, t in self.facts if own == label and heading in (None, h))
        return next(fitting, "")
