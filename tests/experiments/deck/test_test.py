"""experiments/deck/test.py: the test of a section, its parameters and its settings."""

from bubblefit.project.project import read_project

from ...builders.decks import bar, bar_project
from ...support.refusals import complaint


def test_parameters_are_shared_unknowns_that_starts_draw(tmp_path, monkeypatch):
    test = bar(tmp_path, monkeypatch).tests["bar"]
    first, second = test.parameters
    assert (first.name, first.unit, first.lower, first.upper) == ("C10", "MPa", 0.05, 3.0)
    assert first.shared and first.drawn and first.start == (0.05 * 3.0) ** 0.5
    assert second.start == 0.5
    assert test.reads_files and len(test.data_files()) == 1


def test_settings_tell_another_template(tmp_path, monkeypatch):
    test = bar(tmp_path, monkeypatch).tests["bar"]
    settings = test.settings()
    (tmp_path / "solve.py").write_text("# another\n")
    assert test.settings()["files"] != settings["files"]
    assert test.settings()["section"] == settings["section"]


def test_comparisons_have_names_of_their_own(tmp_path, monkeypatch):
    path = bar_project(tmp_path, monkeypatch)
    text = path.read_text()
    path.write_text(text + text[text.index("[[deck.compare]]") :])
    message = complaint(read_project, path)
    assert "deck[0].compare[1].name: 'force' is there twice; name one of them" in message
