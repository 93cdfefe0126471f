"""Recognition of tables of bubbles without cameras by the headings that laboratories write."""

import pytest
from bubblefit.errors import InputError
from bubblefit.project.gauge_files import pressure_of, read_apex, read_heights, read_profiles


def table(folder, heading, rows=((10, 9.6, 7.3), (20, 12.1, 9.2), (30, 14.0, 10.1)), name="a.csv"):
    count = heading.count(",") + 1
    lines = [",".join(f"{value:g}" for value in row[:count]) for row in rows]
    path = folder / name
    path.write_text("\n".join([heading, *lines]) + "\n")
    return path


@pytest.mark.parametrize(
    ("heading", "places"),
    [
        ("Druck (mbar),Scheitel (mm)", None),
        ("pressure (kPa),apex (mm),warp 50 (mm)", [[0.0, 0.0], [50.0, 0.0]]),
        ("pressure (kPa),fill 50 (mm),z 0/0 (mm)", [[0.0, 50.0], [0.0, 0.0]]),
        ("p (kPa),laser 30;-20 (mm),laser 0;0 (mm)", [[30.0, -20.0], [0.0, 0.0]]),
    ],
)
def test_places_of_gauges_stand_in_their_headings(tmp_path, heading, places):
    gauges = read_heights(table(tmp_path, heading.replace(";", " ")))
    assert gauges.keys.get("places") == places and gauges.is_central == (places is None)
    assert not gauges.remarks


def test_what_headings_do_not_tell_is_a_remark(tmp_path):
    gauges = read_heights(table(tmp_path, "gauge pressure,height left,height right"))
    assert gauges.keys["pressure_unit"] == "kPa" and gauges.keys["length_unit"] == "mm"
    assert {*gauges.remarks} == {"pressure_unit", "length_unit", "places"}
    assert gauges.keys["columns"] == {"height": ["height left", "height right"]}


def test_gauge_pressure_is_no_height(tmp_path):
    with pytest.raises(InputError, match="no column of heights"):
        read_heights(table(tmp_path, "time (s),gauge pressure (kPa)"))


def test_profiles_with_and_without_pressure(tmp_path):
    assert read_profiles(table(tmp_path, "x (mm),z (mm),p (kPa)")).has_pressure
    profiles = read_profiles(table(tmp_path, "s,dz"))
    assert not profiles.has_pressure and profiles.keys == {"length_unit": "mm"}
    for heading in ("x 50 (mm),z (mm)", "position (mm),deflection (mm),force (N)"):
        with pytest.raises(InputError):
            read_profiles(table(tmp_path, heading))


def test_curvatures_say_what_has_to_be_confirmed(tmp_path):
    heading = "Pressure_02,CurvatureMD_02,StrainTD"
    apex = read_apex(table(tmp_path, heading, [(1, -0.0004, 0.001), (2, -0.0006, 0.002)]))
    assert apex.keys["columns"] == {
        "curvature_warp": "CurvatureMD_02",
        "strain_fill": "StrainTD",
    }
    assert (apex.keys["curvature_unit"], apex.keys["strain_unit"]) == ("1/mm", "mm/mm")
    assert "half" in apex.remarks["curvature_is"]
    per_metre = table(tmp_path, "p (kPa),kappa warp", [(1, 0.4), (2, 0.6)])
    assert read_apex(per_metre).keys["curvature_unit"] == "1/m"


def test_pressures_of_profiles_stand_in_names_or_heads(tmp_path):
    assert pressure_of(table(tmp_path, "s,dz", name="scan_35.5kPa.csv")) == pytest.approx(35.5)
    head = "# test 1 p_bar=0.528; x axis\ns,dz"
    assert pressure_of(table(tmp_path, head, name="scan1.csv")) == pytest.approx(52.8)
    assert pressure_of(table(tmp_path, "s,dz", name="scan2.csv")) is None
