"""Common parts of the sections that describe tests in a project: place, units, listed files."""

from __future__ import annotations

import filecmp
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from itertools import combinations
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

import numpy as np
from pydantic import Field

from ..errors import InputError
from ..light_dataclasses import dataclass
from ..meshes.cylinder_model import ForceTable, axial_table
from ..readers.machine_tables import Channel
from ..readers.registry import Content, format_named
from ..readers.sections import (
    ModulusUnit,
    Number,
    Positive,
    Section,
    path_beside,
    unit_doubts,
    values_that_were_set,
)
from ..storage.reading import is_file, missing_file_reason

if TYPE_CHECKING:
    from ..materials.law import ThicknessChange


@dataclass(frozen=True)
class Fabric:
    """The one fabric that all tests of a project are made of.

    Attributes
    ----------
    name : str
    thickness : float, mm
        Thickness before the test.
    thickness_change : str
        How the law lets the thickness change with strain.
    lab : str
        Who tested the fabric, for the page of a report.
    """

    name: str
    thickness: float
    thickness_change: ThicknessChange = "constant"
    lab: str = ""


@dataclass(frozen=True)
class Scales:
    """The units of a project file: their names, and their sizes in MPa, MPa and mm."""

    modulus: float = 1000.0
    pressure: float = 1e-3
    length: float = 1.0
    modulus_unit: ModulusUnit = "GPa"
    pressure_unit: str = "kPa"
    length_unit: str = "mm"


@dataclass(frozen=True)
class Place:
    """The place of a test's section in a project: file and key, with units, fabric and data.

    Attributes
    ----------
    path : Path
        File of the project.
    at : str
        Dotted key of the section, such as "bubble[0]".
    fabric : Fabric
    scales : Scales
        Units of the project file.
    data_folder : Path or None
        Folder of the measured files, instead of the one that the section names.
    need_data : bool
        Whether measured data must be there; a forward analysis does not need them.
    measured : sequence or None
        Data in memory instead of files, such as a `Frame` for each pressure.
    """

    path: Path
    at: str
    fabric: Fabric
    scales: Scales = Scales()
    data_folder: Path | None = None
    need_data: bool = True
    measured: Sequence[Any] | None = None

    def error(self, field: str, problem: str) -> InputError:
        """Return an error in the section; `field` is the dotted key below it, "" for itself."""
        return InputError(self.path, f"{self.at}.{field}" if field else self.at, problem)

    def check_units(self, section: Section) -> None:
        """Raise InputError if a pressure or a size of a section seems to be in another unit."""
        values = values_that_were_set(section)
        for key, problem in unit_doubts(type(section), values, self.scales):
            raise self.error(key, problem)

    @contextmanager
    def errors_name(
        self, prefix: str = "", field: str | None = None, keys: Mapping[str, str] | None = None
    ) -> Iterator[None]:
        """Add file and key of the section to errors, raised within, that name no file.

        Parameters
        ----------
        prefix : str
            Dotted key below which the fields of errors lie.
        field : str, optional
            The key itself, instead of an error's field.
        keys : mapping of str to str, optional
            Keys of the section by fields that have another name.
        """
        try:
            yield
        except InputError as error:
            if error.path is not None:
                raise
            key = (keys or {}).get(error.field, error.field) if field is None else field
            raise self.error(f"{prefix}.{key}".strip("."), error.problem) from None

    def folder(self, name: str) -> Path:
        """Return `data_folder` where it is given, else the folder `name` that the section names."""
        return self.data_folder or path_beside(self.path.parent, name)

    def has(self, file: Path, field: str) -> bool:
        """Return whether a measured file is there; raise InputError where it is needed but missing.

        Parameters
        ----------
        field : str
            Dotted key of the file below the section.
        """
        exists = is_file(file)
        if not exists and self.need_data:
            raise self.error(field, f"{missing_file_reason(file)}; --data DIR names another folder")
        return exists


@dataclass(frozen=True)
class ObjectPlace(Place):
    """The place of a test that is an object of Python; errors name the test and its argument.

    Attributes
    ----------
    at : str
        Name of the test.
    data_table : str
        Dotted key of the table of its data, whose keys are arguments too.
    """

    data_table: str = ""

    def error(self, field: str, problem: str) -> InputError:
        """Return an error of the argument that a dotted key of the section stands for."""
        return InputError(self.at, argument_of(field, self.data_table), problem)


def argument_of(field: str, data_table: str) -> str:
    """Return the argument of a test's class in Python that a dotted key of its section stands for.

    Parameters
    ----------
    data_table : str
        Dotted key of the table of the data, whose keys are arguments, too.
    """
    return field.removeprefix(f"{data_table}.").removeprefix("data.").rstrip(".")


class MemberSection(Section):
    """The tension law of a cord: its axial stiffness EA (N), or its force (N) by strain (not %)."""

    stiffness: Positive | None = None
    strain: Annotated[list[Number], Field(min_length=2)] | None = None
    force: Annotated[list[Number], Field(min_length=2)] | None = None
    tension_only: bool = True
    prestrain: Number = 0.0

    def table(self, place: Place, at: str) -> ForceTable:
        """Return the cord's force by strain.

        Parameters
        ----------
        at : str
            Dotted key of this section below the test's, which an InputError names.
        """
        if self.strain and self.force and self.stiffness is None:
            with place.errors_name(at):
                return ForceTable(np.array(self.strain), np.array(self.force))
        if self.stiffness is None or self.strain or self.force:
            raise place.error(at, "give stiffness (EA, N), or strain and force, both lists")
        return axial_table(self.stiffness)


#: Names of files, one at least.
FileNames = Annotated[list[str], Field(min_length=1)]


class FormatSection(Section):
    """Say how files of tables are read: format and decimal mark, found if not given, comments."""

    format: str | None = None
    comment: str = "#"
    decimal: Literal[".", ","] | None = None


class TableFilesSection(FormatSection):
    """Say where files of tables are, and how they are read; `sheet` is of a workbook."""

    folder: str = ""
    sheet: str | None = None


class ChannelSection(Section):
    """A column of a measured file: its name, its unit or scale, and the offset of its values."""

    column: str | None = None
    unit: str | None = None
    scale: Number | None = None
    offset: Number = 0.0

    @property
    def channel(self) -> Channel:
        """Return the channel by which a reader finds and scales the column."""
        return Channel(**self.model_dump())


def listed_files(
    place: Place,
    folder: Path,
    names_by_heading: Mapping[Any, Sequence[str]],
    at: str,
) -> list[tuple[Path, str, Any]]:
    """Return the files that a section lists: path, dotted key, and heading of each.

    Parameters
    ----------
    place : Place
    folder : Path
        Folder of the files.
    names_by_heading : mapping
        Names of files by the heading that they are listed under, None for a plain list.
    at : str
        Dotted key of the list below the section.

    Raises
    ------
    InputError
        A name is listed twice, or two files of one list have the same content.
    """
    files: list[tuple[Path, str, Any]] = []
    for heading, names in names_by_heading.items():
        key = at if heading is None else f"{at}.{heading}"
        for i, name in enumerate(names):
            if Path(name) in map(Path, names[:i]):
                problem = f"{name!r} is listed twice; its values would count double"
                raise place.error(f"{key}[{i}]", problem)
            files.append((folder / name, f"{key}[{i}]", heading))
    for (path, _, heading), (copy, key, heading_of_copy) in combinations(files, 2):
        if heading == heading_of_copy and have_same_content(path, copy):
            problem = f"has the content of {path.name}; a specimen is listed once"
            raise place.error(key, problem)
    return files


def have_same_content(path: Path, copy: Path) -> bool:
    """Return whether two existing, different files are the same byte for byte."""
    if path == copy or not (path.is_file() and copy.is_file()):
        return False
    return 0 < path.stat().st_size == copy.stat().st_size and filecmp.cmp(path, copy, shallow=False)


def named_format(
    place: Place,
    field: str,
    content: Content,
    name: str | None,
) -> str | None:
    """Return the name of a file format after checking that there is such a format.

    Parameters
    ----------
    place : Place
    field : str
        Dotted key of the name below the section.
    content : Content
        What files of the format hold.
    name : str, optional
        Name of the format; None is returned as it is.

    Raises
    ------
    InputError
        There is no such format; names file and key.
    PlugInFailure
        It is read by a plug-in that does not work.
    """
    if name is not None:
        with place.errors_name(field=field):
            format_named(content, name)
    return name
