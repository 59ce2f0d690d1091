"""The files of a study: netCDF, CSV and a Markdown table for every part, and the page that lists them."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING

from laufruhe.problem.study_models import StudyFile
from laufruhe.report import files
from laufruhe.report.tractor_study import figure_files, write_figures

if TYPE_CHECKING:
    import xarray as xr


def file_names(study: StudyFile) -> list[str]:
    """Everything that `write_study` makes."""
    own = figure_files() if study.study.figures else []
    return ["report.md", *own, *(f"{part.name}.{end}" for part in study.study.parts for end in ("nc", "csv", "png"))]


def write_study(
    study: StudyFile, datasets: dict[str, xr.Dataset], folder: Path, command: str, say: Callable[[str], None]
) -> None:
    """Datasets, figures and the report into a folder that exists."""
    lines = [f"# {study.title}", "", f"Source: {study.source}", "", f"Made by `{command}`.", ""]
    if study.assumptions:
        lines += ["Assumptions:", "", *(f"- {text}" for text in study.assumptions), ""]
    if study.study.figures:
        lines += write_figures(folder, say)
    for part in study.study.parts:
        data = datasets[part.name]
        data.to_netcdf(folder / f"{part.name}.nc")
        data.to_dataframe().to_csv(folder / f"{part.name}.csv")
        lines += [
            f"## {part.title}",
            "",
            f"{part.kind.capitalize()}. Source: {part.source}",
            "",
            *_table(data),
            "",
            f"![{part.title}]({part.name}.png)",
            "",
        ]
    files.write(folder / "report.md", "\n".join(lines))


def _table(data: xr.Dataset) -> list[str]:
    swept = [str(name) for name in data.coords if name not in ("mount", "case", "status")]
    head = ["case", *swept, "as given [N]", "at the optimum [N]", "proven bound [N]", "change", "largest, optimum [N]"]
    rows = ["| " + " | ".join(head) + " |", "|" + " --- |" * len(head)]
    for k in range(data.sizes["point"]):
        row = data.isel(point=k)
        given, best = float(row["objective_given"]), float(row["objective"])
        change = f"{100.0 * (best / given - 1.0):+.1f} %" if given else "-"
        cells = [
            str(row["case"].item()), *(str(row[name].item()) for name in swept),
            f"{given:.1f}", f"{best:.1f}", f"{float(row['lower_bound']):.1f}", change,
            f"{float(row['maximum'].max()):.1f}",
        ]  # fmt: skip
        rows.append("| " + " | ".join(cells) + " |")
    return rows
