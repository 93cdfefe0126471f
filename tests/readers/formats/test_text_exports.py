"""readers/formats/text_exports.py: text exports of DICe and VIC-3D."""

import numpy as np
from bubblefit.readers.fields import read_fields
from bubblefit.readers.formats import text_exports
from bubblefit.readers.frames import FrameOptions, read_frames

from ...support.refusals import complaint


def test_failure_states_of_dice_are_dropped(tmp_path):
    """By DICe.h; all others are successes of some step."""
    good = {0, 1, 2, 3, 4, 6, 15, 18}
    names = [f"MODEL_{kind}_{a}" for kind in ("COORDINATES", "DISPLACEMENT") for a in "XYZ"]
    rows = [f"{k},0.1,{k}," + ",".join(map(str, range(k + 1, k + 7))) for k in range(25)]
    text = "\n".join([",".join(["SUBSET_ID", "SIGMA", "STATUS_FLAG", *names]), *rows, ""])
    path = tmp_path / "a.txt"
    for above in ("", "*** DICe\n"):
        path.write_text(above + text)
        (frame,) = read_frames([path])
        assert {int(x) - 1 for x in frame.points[:, 0]} == good == {*text_exports.SUCCESSFUL}
        assert frame.dropped == {"flagged as doubtful": 25 - len(good)}
    path.write_text(
        "SUBSET_ID,COORDINATE_X,COORDINATE_Y,DISPLACEMENT_X,DISPLACEMENT_Y\n0,9,9,1,1\n"
    )
    columns = {"x": "COORDINATE_X", "y": "COORDINATE_Y", "dx": "DISPLACEMENT_X"}
    columns |= {"dy": "DISPLACEMENT_Y"}
    options = FrameOptions(("x", "y", "dx", "dy"), columns)
    assert read_frames([path], options)[0].points[0, :2].tolist() == [9.0, -9.0]
    assert "has no MODEL_COORDINATES_X: planar" in complaint(read_frames, [path])


def test_small_letters_of_vic3d_are_places_in_the_picture(tmp_path):
    path = tmp_path / "old.csv"
    heads = ", ".join(f'"{name}"' for name in ("x", "y", "u", "v", *"XYZUVW", "sigma"))
    path.write_text(f"{heads}\n500,400,3,4,1,2,3,0.1,0.2,0.3,0.01\n0,0,0,0,0,0,0,0,0,0,-1\n")
    (field,) = read_fields([path], [0.1])
    assert field.source.format == "vic3d" and field.dropped == {"sigma below zero": 1}
    np.testing.assert_array_equal(np.append(field.points, field.z), [1, 2, 3])
    np.testing.assert_array_equal(field.displacement, [[0.1, 0.2, 0.3]])
    # In a table of unknown origin nobody can tell.
    assert "dx may be 'u' or 'U'" in complaint(read_fields, [path], [0.1], format="csv")
