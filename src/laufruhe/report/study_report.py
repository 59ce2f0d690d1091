"""The files of a study: netCDF, CSV, picture and a Markdown table for every part, and the page that lists them."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

from laufruhe.present.picture import Picture
from laufruhe.present.tables import Table
from laufruhe.report import files
from laufruhe.report.document import Block, Bullets, Document, Heading, Illustration, Paragraph
from laufruhe.report.strict_json import strict
from laufruhe.report.table_files import MAX_PAGE_ROWS, write_book, write_csv
from laufruhe.report.web_page import write_pages
from laufruhe.studies.part import Part
from laufruhe.studies.reader import StudyFile
from laufruhe.studies.text import Text

if TYPE_CHECKING:
    import xarray as xr


def file_names(study: StudyFile) -> list[str]:
    """Return the names of all files of `write_study`."""
    common = (files.REPORT, files.PAGE, files.BOOK)
    pictures = [f"{part.name}.svg" for part in study.study.parts if "png" in part.ends]
    return [*common, *pictures, *(f"{part.name}.{end}" for part in study.study.parts for end in part.ends)]


def write_study(
    study: StudyFile,
    datasets: Mapping[str, xr.Dataset],
    seconds: Mapping[str, float],
    folder: Path,
    command: str,
    say: Callable[[str], None],
    draw: Callable[[Picture, Path], Callable[[], str]],
    ending: str,
) -> None:
    """Write datasets, tables, pictures and the report into an existing folder.

    Parameters
    ----------
    seconds
        Seconds of each part.
    draw
        Function that starts writing a picture at a path without ending, and returns a function that waits for its SVG.
    ending
        Ending of the picture files of the Markdown page.
    """
    pending, tables = {}, {}
    for part in study.study.parts:
        say(f"writing {part.name}")
        name, data = part.name, datasets[part.name]
        # netCDF cannot mark a name with a space as a coordinate
        spaced = {str(coord): str(coord).replace(" ", "_") for coord in data.coords if " " in str(coord)}
        stored = data.rename(spaced).drop_dims([dim for dim, size in data.sizes.items() if not size])
        stored.attrs = {key: _plain(value) for key, value in data.attrs.items()}
        stored.to_netcdf(folder / f"{name}.nc", engine="scipy")
        if "csv" in part.ends:
            rows = _flat(data)
            tables[name] = Table([*rows.index.names, *rows.columns], rows.reset_index().to_numpy(dtype=object).tolist())
            write_csv(tables[name], folder / f"{name}.csv")
            if len(rows) > MAX_PAGE_ROWS:
                del tables[name]
        if "png" in part.ends:
            pending[name] = draw(part.picture(data), folder / name)
    if tables:
        write_book(tables, folder / files.BOOK)
    document = study_document(study, datasets, seconds, command)
    pictures = {name: picture() for name, picture in pending.items()}
    write_pages(folder, document, pictures, ending)


def _plain(value: Any) -> Any:
    # netCDF-3 has numbers of 32 bits and no lists of texts
    if isinstance(value, list) and any(isinstance(text, str) for text in value):
        return ", ".join(map(str, value))
    return str(value) if isinstance(value, int) and abs(value) >= 2**31 else value


def study_document(
    study: StudyFile, datasets: Mapping[str, xr.Dataset], seconds: Mapping[str, float], command: str
) -> Document:
    """Return the report of a study."""
    blocks: list[Block] = [Paragraph(f"Source: {study.source}", marked=True)] if study.source else []
    blocks.append(Paragraph(f"Made by `{command}`.", marked=True))
    if study.assumptions:
        blocks.append(Bullets("Assumptions:", study.assumptions))
    summaries = [kind.summary(datasets.values()) for kind in dict.fromkeys(type(part) for part in study.study.parts)]
    blocks += [Paragraph(text, marked=True) for text in summaries if text]
    for part in study.study.parts:
        data = datasets[part.name]
        source = f" Source: {data.attrs['source']}" if data.attrs["source"] else ""
        blocks += [Heading(data.attrs["title"]), Paragraph(f"{data.attrs['kind'].capitalize()}.{source}", marked=True)]
        blocks += [block for text in part.table(data) for block in blocks_of(text)]
        blocks += [Paragraph(text, marked=True) for text in _left_out(part, data)]
        if "png" in part.ends:
            blocks.append(Illustration(part.name, data.attrs["title"], is_captioned=False))
    if datasets:
        spent = [(name, f"{duration:.1f}") for name, duration in seconds.items()]
        rows = [*spent, ("all", f"{sum(seconds.values()):.1f}")]
        blocks += [Heading("Where the time went"), Paragraph("Seconds on one core."), Table(("part", "s"), rows)]
    return Document(study.title, tuple(blocks))


def blocks_of(text: Text) -> Iterator[Block]:
    """Yield a paragraph or a table, and the number of rows that only the CSV file has."""
    if not isinstance(text, Table):
        yield Paragraph(text, marked=True)
        return
    yield text
    if text.omitted:
        yield Paragraph(f"{text.omitted} more rows are in the CSV file.")


def _left_out(part: Part, data: xr.Dataset) -> Iterator[str]:
    # a sentence if the table of a part is too long for a page of the workbook, or for a CSV file
    count = math.prod(data.drop_dims(_dims_across(data)).sizes.values())
    if "csv" not in part.ends:
        yield f"All {count:,} rows are in `{part.name}.nc`; a CSV file and the workbook hold fewer."
    elif count > MAX_PAGE_ROWS:
        files_of_part = f"`{part.name}.csv` and `{part.name}.nc`"
        yield f"All {count:,} rows are in {files_of_part}; a page of the workbook holds at most {MAX_PAGE_ROWS:,}."


def _dims_across(data: xr.Dataset) -> set[str]:
    # dimensions that become columns of a row per point
    return {str(values.dims[1]) for values in data.data_vars.values() if values.dims[:1] == ("point",) != values.dims}


def _flat(data: xr.Dataset) -> Any:
    """Return a row per point; values per mount, decision or measure become a column each."""
    across = {name: values for name, values in data.data_vars.items() if values.dims[:1] == ("point",) != values.dims}
    narrow = data.drop_dims(_dims_across(data))
    units = {str(name): values.attrs.get("units", "") for name, values in narrow.variables.items()}
    rows = narrow.to_dataframe().rename(columns={name: _headed(name, unit) for name, unit in units.items()})
    rows.index.names = [_headed(str(name), units.get(str(name), "")) for name in rows.index.names]
    columns: dict[str, Any] = {}
    for name, values in across.items():
        along = values.dims[1]
        units_all = [values.attrs.get("units", "")] * data.sizes[along]
        units_of = values.attrs.get("unit_of", f"{along}_unit")
        named = data[units_of].values.tolist() if units_of in data.coords else units_all
        for k, (of, unit) in enumerate(zip(data[along].values, named, strict=True)):
            # a reason has no unit
            columns[_headed(f"{name}: {of}", unit if values.dtype.kind in "fiu" else "")] = values.values[:, k]
    # columns are added all at once, because pandas is slow at adding many one by one
    return rows.join(type(rows)(columns, index=rows.index))


def _headed(name: str, unit: str) -> str:
    return f"{name} [{unit}]" if unit not in ("", "1") else name


def as_json(study: StudyFile, datasets: Mapping[str, xr.Dataset], seconds: Mapping[str, float]) -> str:
    """Return all parts as strict JSON in xarray's form, null for numbers that are not finite."""
    parts = {
        name: {"seconds": seconds[name], **data.to_dict(data="list", encoding=False)} for name, data in datasets.items()
    }
    content = {"title": study.title, "source": study.source, "assumptions": study.assumptions, "parts": parts}
    return strict(content, indent=1)
