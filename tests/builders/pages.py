"""A page with every part: facts, tables, charts, maps and a surface."""

import numpy as np
from bubblefit.reports import content
from bubblefit.reports.charts import Chart, Charts, dots, line
from bubblefit.reports.content import PageSection, Picture, Report, Table
from bubblefit.reports.maps import Panel, Solid, maps_of, pack
from PIL import Image

PLACES = np.array([(x, y) for y in (-1.0, 0.0, 1.0) for x in (-1.0, 0.0, 1.0)])


QUADS = np.array([[0, 1, 4, 3], [1, 2, 5, 4], [3, 4, 7, 6], [4, 5, 8, 7]])


HEIGHTS = [k * (2.0 - (PLACES**2).sum(axis=1)) for k in (1.0, 2.0)]


LOADS = ["22 kPa", "59 kPa"]


def full_report():
    x = np.linspace(0.0, 0.1, 5)
    best = line("best <1>", x, 300 - 1000 * x, band=(250 - 1000 * x, 350 - 1000 * x), ends=True)
    measured = dots("measured", x, 290 - 900 * x, colour=1)
    chart = Chart("E1", "strain", "MPa", [best, measured], "it falls")
    rows = [("dz", "mm", [h + 0.1 for h in HEIGHTS], HEIGHTS, [-0.1 * h for h in HEIGHTS])]
    maps = maps_of("bubble", "pressure", LOADS, [PLACES] * 2, rows, ("x", "y"), "Maps", "a dome")
    points = np.array([np.column_stack([PLACES, h]) for h in HEIGHTS])
    shade = Panel("height", "mm", pack([h[QUADS].mean(axis=1) for h in HEIGHTS]))
    solid = Solid("dome", LOADS, "pressure", pack(points), pack(QUADS), [shade], "Dome", "a dome")
    return Report(
        "Test <1> & more", "Good.", [("objective e", 3.1234567e-12), ("method", "lm")],
        ["beta_0 <is> on its bound"],
        [
            PageSection("Curves", [
                Charts("moduli", [chart], "Tangent moduli"),
                Picture("figures/sorted optima.png", "Optima"),
            ]),
            PageSection("Fields", [maps, solid]),
            PageSection("Nothing", []),
            PageSection("Tables", [Table("Surfaces", ["kPa", "R²"], [[22, 0.99971]], "Table 4.1")]),
            PageSection("More", [
                content.Words(["said <so>"]), content.Words(["mind"], bulleted=True, warning=True),
                content.Facts([("mass", 1.0)], "Weights"), content.Listing("a < b"),
                content.Download("card.toml", "a = 'é'\n", "Save it"),
            ]),
        ],
        [("result.json", "everything")], {"bubblefit": "0.1.0"},
    )  # fmt: skip


def drawn(folder):
    path = folder / "figures" / "sorted optima.png"
    path.parent.mkdir()
    Image.new("RGB", (60, 60), "white").save(path)
    return path
