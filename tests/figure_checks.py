"""What holds for every figure: all of it is seen, little of it is empty, its legend tells true."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.collections import Collection, LineCollection
from matplotlib.colors import to_hex
from matplotlib.figure import Figure
from matplotlib.legend import Legend
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from matplotlib.transforms import Bbox

#: Share of an axis that may be empty on one side of what it shows; decades of a logarithmic one.
EMPTY, DECADES = 0.15, 2.0
#: Decades of an axis below which nothing need be seen: dips where two curves cross.
DIPS = 6.0
#: Axes that count have room for what is not there; a close view shows a part.
COUNTS = ("start, sorted from worst to best", "order of the polynomial", "form of the moduli")
CLOSE_VIEW = "at the collar"
#: Pixels by which letters may touch the edge of a panel.
TOUCH = 3.0
#: Stands for lines of any colour.
ANY = "#222222"


def check_figure(figure: Figure) -> None:
    """Of a figure that has been drawn; AssertionError with the place and what is wrong."""
    for place, axes in enumerate(figure.axes):
        if not (axes.axison and axes.get_visible()):
            continue
        where = f"panel {place} ({axes.get_title('left')})"
        _check_words(figure, axes, where)
        if hasattr(axes, "_colorbar"):
            continue
        assert not (axes.spines["top"].get_visible() or axes.spines["right"].get_visible()), where
        assert axes.get_axisbelow(), where
        for name in "" if axes.get_title("left") == CLOSE_VIEW else "xy":
            _check_limits(axes, name, where)
    for legend in _legends(figure):
        _check_legend(figure, legend)


def _check_words(figure: Figure, axes: Axes, where: str) -> None:
    """Texts stand in their panel, labels and titles in the figure."""
    panel, whole = _grown(axes.get_window_extent()), _grown(figure.bbox)
    for text in (t for t in axes.texts if t.get_text()):
        at = text.get_window_extent()
        assert _holds(panel, at), f"{where}: {text.get_text()!r} stands outside"
    labels = (axes.xaxis.label, axes.yaxis.label, axes.title, axes._left_title)
    for text in (t for t in labels if t.get_text() and t.get_visible()):
        assert _holds(whole, text.get_window_extent()), f"{where}: {text.get_text()!r} is cut off"


def _check_limits(axes: Axes, name: str, where: str) -> None:
    """No point of a line lies beyond the axis, which is not much longer than what it shows."""
    axis = getattr(axes, f"{name}axis")
    low, high = sorted(axis.get_view_interval())
    log = axis.get_scale() == "log"
    assert np.isfinite([low, high]).all() and low < high and (low > 0 or not log), where
    of = "xy".index(name)
    points = [p for line in axes.lines for p in _line(axes, line, of)]
    if log:
        points = [p for p in points if p > 0]
    edge = 1e-9 * (high - low)
    least = 0.0 if log and high > 10**DIPS * low else low - edge
    for point in points:
        assert least <= point <= high + edge, f"{where}: {name} = {point:g} is not seen"
    shared = getattr(axes, f"get_shared_{name}_axes")().get_siblings(axes)
    ends = [e for other in shared for e in _ends(other, of)]
    ends = [e for e in ends if np.isfinite(e) and (e > 0 or not log)]
    if not ends or min(ends) == max(ends) or axis.get_label_text().startswith(COUNTS):
        return
    first, last = max(min(ends), low), min(max(ends), high)
    if log:
        low, first, last, high = np.log10([low, first, last, high])
    room = max(EMPTY * (high - low), DECADES if log else 0.0)
    said = f"{where}: {name} from {low:.4g} to {high:.4g} shows {first:.4g} to {last:.4g}"
    assert high - last <= room, said
    assert first - low <= room or low == 0.0, said


def _line(axes: Axes, line: Line2D, of: int) -> Iterator[float]:
    """Finite values of a line that stand on the axis; a rule across the panel stands on one."""
    if line.get_transform().contains_branch_seperately(axes.transData)[of]:
        values = np.array(line.get_xydata(), dtype=float)
        if len(values):
            yield from values[np.isfinite(values).all(axis=1), of].tolist()


def _ends(axes: Axes, of: int) -> Iterator[float]:
    """Least and largest of everything drawn."""
    for line in axes.lines:
        values = list(_line(axes, line, of))
        yield from (min(values), max(values)) if values else ()
    for artist in (*axes.collections, *axes.patches):
        if isinstance(artist, Collection):
            box: Any = artist.get_datalim(axes.transData)
        elif artist.get_transform().contains_branch_seperately(axes.transData)[of]:
            path = artist.get_transform() - axes.transData
            box = artist.get_path().get_extents(path)
        else:
            continue
        yield from (box.min[of], box.max[of])


def _legends(figure: Figure) -> list[Legend]:
    inside = [axes.get_legend() for axes in figure.axes if axes.axison]
    return [*figure.legends, *(legend for legend in inside if legend is not None)]


def _check_legend(figure: Figure, legend: Legend) -> None:
    """Every entry has words and looks as something that is drawn; it hangs over nothing."""
    words = [text.get_text() for text in legend.get_texts()]
    assert (words and all(words) and len(words) == len(set(words))) or legend.axes, words
    box = legend.get_window_extent()
    assert _holds(_grown(figure.bbox), box), f"legend {words} is cut off"
    if legend.axes is None:
        for axes in figure.axes:
            panel = axes.get_window_extent()
            assert not (axes.axison and _grown(panel, -TOUCH).overlaps(box)), f"{words} on a panel"
    shown = [look for axes in figure.axes for look in map(_look, _artists(axes)) if look]
    named: dict[str, list[Any]] = {}
    for artist in (artist for axes in figure.axes for artist in _artists(axes)):
        named.setdefault(str(artist.get_label()), []).append(_look(artist))
    for word, handle in zip(words, legend.legend_handles, strict=True):
        look = _look(handle)
        assert look in named.get(word, [look]), f"{word} is drawn as {named[word]}"
        assert look is None or any(_alike(look, other) for other in shown), f"{word}: {look}"


def _artists(axes: Axes) -> list[Artist]:
    return [*axes.lines, *axes.patches, *axes.collections]


def _look(artist: Artist) -> tuple[Any, ...] | None:
    if isinstance(artist, Line2D):
        marker = artist.get_marker()
        dashes = artist.get_linestyle() if artist.get_linestyle() == "None" else "line"
        pattern = artist._unscaled_dash_pattern if dashes == "line" else None
        bare = marker in ("None", None, "")
        fill = None if bare else _colour(artist.get_markerfacecolor())
        return "line", _colour(artist.get_color()), str(pattern), bare or marker, fill
    if isinstance(artist, LineCollection):
        return "line", _colour(artist.get_edgecolor()[0]), str(artist._us_linestyles[0]), True, None
    if isinstance(artist, Patch | Collection):
        colour = np.atleast_2d(artist.get_facecolor())
        return ("fill", _colour(colour[0])) if len(colour) and colour.size else None
    return None


def _colour(colour: Any) -> str:
    return "none" if isinstance(colour, str) and colour == "none" else to_hex(colour)


def _alike(entry: tuple[Any, ...], other: tuple[Any, ...]) -> bool:
    if entry[0] == "line" and entry[1] == ANY:
        return entry[2:4] == other[2:4] and (entry[4] == ANY or entry[4] == other[4])
    return entry == other


def _grown(box: Any, by: float = TOUCH) -> Bbox:
    return Bbox.from_extents(box.x0 - by, box.y0 - by, box.x1 + by, box.y1 + by)


def _holds(outer: Bbox, inner: Any) -> bool:
    return bool(
        outer.x0 <= inner.x0 and inner.x1 <= outer.x1
        and outer.y0 <= inner.y0 and inner.y1 <= outer.y1
    )  # fmt: skip
