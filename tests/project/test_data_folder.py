"""Recognition of measured files by the readers that take them, and the tests proposed for them."""

import shutil

import pytest
from bubblefit.errors import InputError
from bubblefit.project.data_folder import (
    BENDING,
    BIAXIAL,
    FRAMES,
    LOG,
    NUMBERS,
    STRIPS,
    TIMES,
    pressure_of,
    proposed_tests,
    read_apex,
    read_heights,
    read_profiles,
    recognised_groups,
)
from bubblefit.readers.curves import read_load_curves

from ..support.paths import EXAMPLES

DATA = EXAMPLES / "own-data" / "data"


def test_roles_of_files(tmp_path):
    data = tmp_path / "data"
    data.mkdir()
    for name in ("bubble/Bubble-0058_0.csv", "camera.csv", "pressure.csv", "strips/fill_1.csv"):
        shutil.copy(DATA / name, data)
    shutil.copy(EXAMPLES / "biaxial-computed" / "test.csv", data / "cruciform.csv")
    (data / "beam.csv").write_text("deflection (mm),load (N)\n0,0\n1,20\n2,41\n")
    roles = {group.files[0].name: group.role for group in recognised_groups(data)}
    assert roles == {
        "Bubble-0058_0.csv": FRAMES,
        "camera.csv": TIMES,
        "pressure.csv": LOG,
        "fill_1.csv": STRIPS,
        "cruciform.csv": BIAXIAL,
        "beam.csv": BENDING,
    }
    tests = proposed_tests(recognised_groups(data))
    assert [test["kind"] for test in tests] == ["bubble", "strips", "biaxial", "cylinder"]
    assert tests[0]["sizes"] == ["radius"] and tests[0]["in_camera_axes"]
    assert tests[1]["in_heads"] == {"width": 50.0, "grip_distance": 200.0, "gauge_length": 100.0}


def test_frames_without_heights_and_with_a_pressure_in_each(tmp_path):
    for number, bar in enumerate((0.1, 0.2, 0.3)):
        rows = [f"{x},{y},0.1,0.2,{5 * bar}" for x in (-50, 0, 50) for y in (-50, 0, 50)]
        text = "\n".join([f"# p_bar={bar}", "x,y,dx,dy,dz", *rows])
        (tmp_path / f"test1_{number:02d}.csv").write_text(text)
    (test,) = proposed_tests(recognised_groups(tmp_path))
    assert test["columns"] == {name: name for name in ("x", "y", "dx", "dy", "dz")}
    assert (test["column"], test["in_camera_axes"], test["sizes"]) == ("p", False, ["radius"])


@pytest.mark.parametrize(
    ("names", "counts"),
    [
        ("Bild1_500mbar Bild2_1000mbar Bild10_1500mbar", [3]),
        # Of one pressure they are tests of their own.
        ("test1_500mbar test2_500mbar", [1, 1]), ("bubble1 bubble1_20kPa", [1, 1]),
    ],
)  # fmt: skip
def test_frames_that_stand_alone_by_their_counter_are_one_test(tmp_path, names, counts):
    rows = "\n".join(f"{x},{y},0.1,0.2,5" for x in (-50, 0, 50) for y in (-50, 0, 50))
    for name in names.split():
        (tmp_path / f"{name}.csv").write_text(f"x,y,dx,dy,dz\n{rows}\n")
    tests = proposed_tests(recognised_groups(tmp_path))
    assert [test["count_of_files"] for test in tests] == counts
    if len(counts) == 1:
        assert tests[0]["is_named"] and tests[0]["files"] == ["Bild*_*mbar.csv"]


@pytest.mark.parametrize(("off", "in_camera_axes"), [(4.9, False), (5.9, True), (-5.9, True)])
def test_points_a_twentieth_off_centre_are_in_camera_axes(tmp_path, off, in_camera_axes):
    rows = [f"{x},{y + off},0,0,0,{x * y}" for x in (-50, 0, 50) for y in (-50, 0, 50)]
    for number in range(2):
        text = "\n".join(["x,y,z,dx,dy,dz", *rows])
        (tmp_path / f"test1_{number:02d}.csv").write_text(text)
    (test,) = proposed_tests(recognised_groups(tmp_path))
    assert test["in_camera_axes"] is in_camera_axes


@pytest.mark.parametrize(
    ("stems", "group"),
    [
        ("test1_00 test1_19", "test1_*"),
        ("Bubble-0003_0 Bubble-0058_0", "Bubble-*_*"),
        ("step_2_60.5kPa step_12_100kPa", "step_*_*kPa"),
        ("warp1 warp2", "warp*"),
        ("strip_45deg_1 strip_45deg_2", "strip_45deg_*"),
        ("strip_0deg strip_0deg", "strip_0deg"),
        ("img000120_0 img000121_0", "img*_*"),
    ],
)
def test_files_of_one_test_differ_in_numbers(stems, group):
    assert {NUMBERS.sub("*", stem) for stem in stems.split()} == {group}


def test_angles_of_strips_stand_in_names(tmp_path):
    for angle in ("0", "22.5", "75"):
        text = (DATA / "strips" / "warp_1.csv").read_text().replace("Kette", "20 °C")
        (tmp_path / f"nylon {angle} deg.csv").write_text(text)
    (strips,) = proposed_tests(recognised_groups(tmp_path))
    assert strips["angles"] == {angle: [f"nylon {angle} deg.csv"] for angle in ("0", "22.5", "75")}
    assert strips["cuts"] == ["warp", "bias"] and strips["by_angle"]


def strips_with_heads(folder, heads):
    """Write load curves with these lines above them by name; return the test proposed for all."""
    folder.mkdir(exist_ok=True)
    for name, head in heads.items():
        curve = ["Extensometer [mm];Kraft [N]", *(f"{u / 4};{30 * u}" for u in range(20))]
        (folder / name).write_text("\n".join([head, *curve]) + "\n", encoding="utf-8")
    (test,) = proposed_tests(recognised_groups(folder))
    return test


def test_number_that_all_names_have_is_no_angle(tmp_path):
    for name in ("nylon 15 1.csv", "nylon 15 2.csv"):
        text = (DATA / "strips" / "warp_1.csv").read_text().replace("Kette", "20 °C")
        (tmp_path / name).write_text(text)
    assert proposed_tests(recognised_groups(tmp_path)) == []


def test_direction_is_that_of_each_file_of_a_numbered_group(tmp_path):
    words = ("Kette", "Kette", "Schuss", "Schuss")
    heads = {f"Specimen_{k}.csv": f"Richtung;{word}" for k, word in enumerate(words, 1)}
    test = strips_with_heads(tmp_path / "four", heads)
    assert test["files"] == {
        "warp": ["Specimen_1.csv", "Specimen_2.csv"],
        "fill": ["Specimen_3.csv", "Specimen_4.csv"],
    }
    assert not test["unknown"] and not test["by_angle"]
    heads["Specimen_3.csv"], heads["Specimen_4.csv"] = "Richtung;90 deg", "Nr;4"
    test = strips_with_heads(tmp_path / "mixed", heads)
    assert test["files"]["fill"] == ["Specimen_3.csv"] and test["unknown"] == ["Specimen_4.csv"]
    assert test["by_angle"]


def test_specimens_in_one_file_have_the_direction_of_its_head(tmp_path):
    rows = [f"{specimen};{u / 4};{30 * u}" for specimen in (1, 2) for u in range(20)]
    lines = ["Direction;weft", "Specimen;Extensometer [mm];Load [N]", *rows]
    (tmp_path / "table.csv").write_text("\n".join(lines))
    (test,) = proposed_tests(recognised_groups(tmp_path))
    assert test["files"] == {"fill": ["table.csv"]}


@pytest.mark.parametrize("encoding", ["utf-8", "latin-1", "utf-16"])
def test_french_files_are_read(tmp_path, encoding):
    rows = [f"{t};{t / 4:.2f};{3 * t:.1f};1,5".replace(".", ",") for t in range(20)]
    names = "Temps [s];Déplacement [mm];Force [daN];Vitesse de déplacement [mm/s]"
    for number, word in enumerate(("chaîne", "trame"), 1):
        sizes = "Largeur: 50 mm", "\u00c9paisseur : 0,8 mm", "Longueur de référence: 100 mm"
        speed = "Vitesse entre mors: 20 mm par minute"
        lines = ["Essai de traction", f"Sens: {word}", *sizes, speed, names, *rows]
        (tmp_path / f"essai_{number}.csv").write_text("\n".join(lines), encoding)
    (test,) = proposed_tests(recognised_groups(tmp_path))
    assert test["files"] == {"warp": ["essai_1.csv"], "fill": ["essai_2.csv"]}
    assert test["in_heads"] == {"width": 50.0, "thickness": 0.8, "gauge_length": 100.0}
    (curve,) = read_load_curves(tmp_path / "essai_1.csv", direction="chaîne", width=50.0)
    assert (curve.direction, curve.elongation[-1], curve.load[-1]) == ("warp", 4.75, 570.0)


def test_speeds_are_no_sizes(tmp_path):
    head = "Grip separation: 50 mm/min\nGrip distance: 200 mm"
    test = strips_with_heads(tmp_path / "both", {"bias1.csv": head})
    assert test["in_heads"] == {"grip_distance": 200.0}
    rate = {"bias1.csv": "Grip separation rate: 100 mm/min"}
    assert strips_with_heads(tmp_path / "rate", rate)["in_heads"] == {}


@pytest.mark.parametrize(
    "head",
    [
        "Grip width: 60 mm\nCoating thickness: 0.2 mm",
        "Klemmbackenbreite;60 mm\nBeschichtungsdicke;0,2 mm",
        "Largeur des mors: 60 mm\nÉpaisseur de l'enduction: 0,2 mm",
        "Width of the jaws: 60 mm\nSchichtdicke: 0,2 mm",
    ],
)
def test_sizes_of_grips_and_coatings_are_none_of_the_specimen(tmp_path, head):
    assert strips_with_heads(tmp_path / "none", {"warp1.csv": head})["in_heads"] == {}
    head += "\nSpecimen width: 50 mm\nDicke: 0,8 mm"
    test = strips_with_heads(tmp_path / "both", {"warp1.csv": head})
    assert test["in_heads"] == {"width": 50.0, "thickness": 0.8}


def test_size_that_differs_within_a_group_stays_open(tmp_path):
    heads = {f"warp_{w}.csv": f"Width: {w} mm\nGauge length: 100 mm" for w in (25, 30)}
    test = strips_with_heads(tmp_path, heads)
    assert test["files"] == {"warp": ["warp_*.csv"]}
    assert test["in_heads"] == {"gauge_length": 100.0}


@pytest.mark.parametrize(
    "head",
    [
        "Temperature: 23 deg C",
        "Temperature: 23 deg",
        "Raumtemperatur;23 Grad",
        "Climate: 23 degC, 50 % RH",
        "Climate: 73 deg F",
        "Material: warp knitted PVC",
        "Material: fill coated, 45 deg",
    ],
)
def test_direction_is_that_of_its_line_in_the_head(tmp_path, head):
    words = {"probe_a.csv": "warp", "probe_b.csv": "weft"}
    heads = {name: f"{head}\nDirection: {word}" for name, word in words.items()}
    test = strips_with_heads(tmp_path / "named", heads)
    assert test["files"] == {"warp": ["probe_a.csv"], "fill": ["probe_b.csv"]}
    if "23" in head or "73" in head:  # without a line of the direction, too
        heads = {"probe_a.csv": f"{head}\nseries of the warp", "probe_b.csv": head}
        test = strips_with_heads(tmp_path / "unnamed", heads)
        assert test["files"] == {"warp": ["probe_a.csv"]} and test["unknown"] == ["probe_b.csv"]


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
        ("p (kPa),Gauge 1 warp 50 (mm),Gauge 2 fill 50 (mm)", [[50.0, 0.0], [0.0, 50.0]]),
    ],
)
def test_places_of_gauges_stand_in_their_headings(tmp_path, heading, places):
    gauges = read_heights(table(tmp_path, heading.replace(";", " ")))
    assert gauges.keys.get("places") == places and gauges.is_central == (places is None)
    assert not gauges.remarks


@pytest.mark.parametrize("headings", ["Laser 1 at 30 mm,Laser 2 at 60 mm", "z1 30,z2 60"])
def test_number_of_a_gauge_is_no_coordinate(tmp_path, headings):
    gauges = read_heights(table(tmp_path, f"p (kPa),{headings}"))
    assert gauges.keys["places"] == [[0.0, 0.0]] * 2 and "places" in gauges.remarks
    both = read_heights(table(tmp_path, "p (kPa),h x=30 y=-20 (mm),h x=0 y=0 (mm)"))
    assert both.keys["places"] == [[30.0, -20.0], [0.0, 0.0]]


def test_what_headings_do_not_tell_is_a_remark(tmp_path):
    gauges = read_heights(table(tmp_path, "gauge pressure,height left,height right"))
    assert gauges.keys["pressure_unit"] == "kPa" and gauges.keys["length_unit"] == "mm"
    assert {*gauges.remarks} == {"pressure_unit", "length_unit", "places"}
    assert gauges.keys["columns"] == {"height": ["height left", "height right"]}


def test_commas_before_three_digits_are_taken_for_decimal_ones(tmp_path):
    path = tmp_path / "h.csv"
    path.write_text("Druck [kPa];Scheitel [mm];Kette 50 [mm]\n20;11;8,381\n40;14;10,617\n")
    gauges = read_heights(path)
    assert gauges.keys["decimal"] == "," and "thousands" in gauges.remarks["decimal"]
    path.write_text("Druck [kPa];Scheitel [mm];Kette 50 [mm]\n20,000;11,2;8,381\n")
    assert "decimal" not in read_heights(path).keys
    path.write_text("Druck [kPa];Scheitel [mm];Kette 50 [mm]\n20,000;11,102;8,381\n")
    assert read_heights(path).keys["decimal"] == ","
    path.write_text("x [mm];z [mm];Druck [kPa]\n10,500;9,250;20,000\n-5,500;9,750;20,000\n")
    assert read_profiles(path).keys["decimal"] == ","
    heading = "Druck [kPa];Radius Kette [mm];Dehnung Kette [%]"
    path.write_text(f"{heading}\n20;491,5;0,77\n40;391,2;1,2\n")
    apex = read_apex(path)
    assert apex.keys["columns"]["strain_warp"] == "Dehnung Kette [%]"
    assert "decimal" not in apex.keys


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


@pytest.mark.parametrize("heading", ["curvature warp (mm)", "Krümmungsradius Kette (m)"])
def test_curvatures_in_a_length_are_radii(tmp_path, heading):
    apex = read_apex(table(tmp_path, f"p (kPa),{heading}", [(1, 900.0), (2, 600.0)]))
    assert apex.keys == {"columns": {"curvature_warp": heading}, "curvature_is": "radius"}
    assert not apex.remarks


@pytest.mark.parametrize(("largest", "unit"), [(900.0, "mm"), (0.9, "m")])
def test_unit_of_a_radius_is_by_its_size(tmp_path, largest, unit):
    apex = read_apex(table(tmp_path, "p (kPa),curvature radius fill", [(1, largest), (2, 0.5)]))
    assert (apex.keys["curvature_is"], apex.keys["curvature_unit"]) == ("radius", unit)


def test_pressures_of_profiles_stand_in_names_or_heads(tmp_path):
    assert pressure_of(table(tmp_path, "s,dz", name="scan_35.5kPa.csv")) == pytest.approx(35.5)
    head = "# test 1 p_bar=0.528; x axis\ns,dz"
    assert pressure_of(table(tmp_path, head, name="scan1.csv")) == pytest.approx(52.8)
    assert pressure_of(table(tmp_path, "s,dz", name="scan2.csv")) is None
