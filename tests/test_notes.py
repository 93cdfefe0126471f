"""Notes of a result: kinds are open, the gravest come first."""

import pickle

from bubblefit.notes import Note, NoteKind, gravest_notes, marks_of, note_records
from bubblefit.runs.certainty import MESH

from .support.refusals import raised


def test_kind_of_note_of_a_plug_in_is_ranked_and_recorded():
    kind = NoteKind("creep")
    note = pickle.loads(pickle.dumps(Note(kind, "the load fell by 3 %", "a strip")))
    assert note.kind is kind and kind == "creep" and kind.mark == 0
    assert note_records([note]) == [
        {"of": "a strip", "kind": "creep", "note": "the load fell by 3 %"}
    ]
    assert gravest_notes([note, Note(MESH, "m")]) == ["m"] and marks_of([note]) == []
    raised(ValueError, "named by words", NoteKind, " ")
