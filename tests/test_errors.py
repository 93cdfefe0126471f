"""Errors of bad input: one line, whatever the names and values hold."""

import pickle

from bubblefit.errors import InputError, one_line


def test_message_stays_one_line_whatever_a_name_holds():
    error = InputError("a\nb\x1b[31m.csv", "line 1, column 'x\u202ey\u2028'", "ärger – 0,5 µm")
    text = "a\\nb\\x1b[31m.csv: line 1, column 'x\\u202ey\\u2028': ärger – 0,5 µm"
    assert str(error) == str(pickle.loads(pickle.dumps(error))) == text
    assert one_line("a\u00a0b") == "a\u00a0b" and one_line("\udcff") == "\\udcff"
