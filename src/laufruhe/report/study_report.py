"""The files of a study: netCDF, CSV, picture and a Markdown table for every part, and the page that lists them."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import xarray as xr

from laufruhe.report import files
from laufruhe.report.strict_json import strict
from laufruhe.studies.part import Part
from laufruhe.studies.picture import Picture
from laufruhe.studies.reader import StudyFile
from laufruhe.studies.replication.judging import counted
from laufruhe.studies.text import Rows, Text


def file_names(study: StudyFile) -> list[str]:
    """Everything that `write_study` makes."""
    return [files.REPORT, *(f"{part.name}.{end}" for part in study.study.parts for end in part.ends)]


def write_study(
    study: StudyFile,
    datasets: Mapping[str, xr.Dataset],
    seconds: Mapping[str, float],
    folder: Path,
    command: str,
    say: Callable[[str], None],
    draw: Callable[[Picture, Path], None],
) -> None:
    """Datasets, pictures and the report into a folder that exists.

    Parameters
    ----------
    seconds
        What each part took.
    draw
        Makes a PNG file of a picture.
    """
    lines = [f"# {study.title}", ""]
    lines += [f"Source: {study.source}", ""] if study.source else []
    lines += [f"Made by `{command}`.", ""]
    if study.assumptions:
        lines += ["Assumptions:", "", *(f"- {text}" for text in study.assumptions), ""]
    found = counted(datasets.values())
    lines += [found, ""] if found else []
    for part in study.study.parts:
        say(f"writing {part.name}")
        lines += _part(part, datasets[part.name], folder, draw)
    if datasets:
        spent = [f"| {name} | {duration:.1f} |" for name, duration in seconds.items()]
        lines += ["## Where the time went", "", "Seconds on one core.", "", "| part | s |", "| --- | ---: |", *spent,
                  f"| all | {sum(seconds.values()):.1f} |", ""]  # fmt: skip
    files.write(folder / files.REPORT, "\n".join(lines))


def _part(part: Part, data: xr.Dataset, folder: Path, draw: Callable[[Picture, Path], None]) -> list[str]:
    name, title, source = part.name, data.attrs["title"], data.attrs["source"]
    # a name with a space cannot be marked as a coordinate there
    spaced = {str(coord): str(coord).replace(" ", "_") for coord in data.coords if " " in str(coord)}
    data.rename(spaced).to_netcdf(folder / f"{name}.nc")
    if "csv" in part.ends:
        _flat(data).to_csv(folder / f"{name}.csv")
    if "png" in part.ends:
        draw(part.picture(data), folder / f"{name}.png")
    words = data.attrs["kind"].capitalize() + "." + (f" Source: {source}" if source else "")
    told = [line for text in part.table(data) for line in (*markdown(text), "")]
    return [f"## {title}", "", words, "", *told, *([f"![{title}]({name}.png)", ""] if "png" in part.ends else [])]


def markdown(text: Text) -> list[str]:
    """Lines of a paragraph or a table; how many rows stand in the CSV file only."""
    if not isinstance(text, Rows):
        return [text]
    head, rows = text.head, text.rows
    lines = ["| " + " | ".join(cells) + " |" for cells in (head, ["---"] * len(head), *rows)]
    rest = text.whole - len(rows)
    return [*lines, "", f"{rest} more rows are in the CSV file."] if rest > 0 else lines


def _flat(data: xr.Dataset) -> Any:
    """A row a point: what stands for every mount, decision, measure ... of a point becomes a column each."""
    across = {name: values for name, values in data.data_vars.items() if values.dims[:1] == ("point",) != values.dims}
    narrow = data.drop_dims({str(values.dims[1]) for values in across.values()})
    units = {str(name): values.attrs.get("units", "") for name, values in narrow.variables.items()}
    rows = narrow.to_dataframe().rename(columns={name: _headed(name, unit) for name, unit in units.items()})
    for name, values in across.items():
        along = values.dims[1]
        own = [values.attrs.get("units", "")] * data.sizes[along]
        named = data[f"{along}_unit"].values.tolist() if f"{along}_unit" in data.coords else own
        for k, (of, unit) in enumerate(zip(data[along].values, named, strict=True)):
            rows[_headed(f"{name}: {of}", unit)] = values.values[:, k]
    return rows


def _headed(name: str, unit: str) -> str:
    return f"{name} [{unit}]" if unit not in ("", "1") else name


def as_json(study: StudyFile, datasets: Mapping[str, xr.Dataset], seconds: Mapping[str, float]) -> str:
    """All parts as strict JSON: what xarray says of a dataset, with null for what is no number."""
    parts = {
        name: {"seconds": seconds[name], **data.to_dict(data="list", encoding=False)} for name, data in datasets.items()
    }
    content = {"title": study.title, "source": study.source, "assumptions": study.assumptions, "parts": parts}
    return strict(content, indent=1)
