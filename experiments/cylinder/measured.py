"""The measured loads of a bent cylinder."""

from __future__ import annotations

from pathlib import Path

from ...data.bending import BendingCurve, read_bending_curves
from ...reading import is_file
from ..base import Place
from ..channels import channel_of
from ..formats import named_format
from .section import MeasuredSection


def read_measured(section: MeasuredSection, place: Place) -> tuple[BendingCurve, ...]:
    """Every repetition in the files of a section; none where it lists none.

    Raises
    ------
    InputError : a file that is listed twice or is not there; of a file, naming it and the line.
    """
    names = section.files or []
    folder = place.data_folder
    if folder is None:
        folder = place.path.parent / section.folder
    format = named_format(place, "measured.format", "machine table", section.format)
    curves: list[BendingCurve] = []
    for k, name in enumerate(names):
        file, key = folder / name, f"measured.files[{k}]"
        if Path(name) in map(Path, names[:k]):
            raise place.error(key, f"{name!r} is listed twice; it would count double")
        if not is_file(file):
            if not place.need_data:
                continue
            raise place.error(key, f"there is no file {file}; --data DIR names another folder")
        curves += read_bending_curves(
            file,
            deflection=channel_of(section.deflection),
            load=channel_of(section.load),
            repetition=section.repetition,
            preload=section.preload,
            zero=section.zero,
            comment=section.comment,
            decimal=section.decimal,
            format=format,
        )
    return tuple(curves)
