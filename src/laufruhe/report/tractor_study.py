"""The tractor study as a registry: what each figure says, how it is computed, drawn and judged."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path

import xarray as xr

from laufruhe.studies.tractor import COMPUTE, VERDICTS, Verdict
from laufruhe.studies.verdict import UNSTATED

__all__ = ["FIGURES", "Figure", "Verdict", "figure_files", "verdict_table", "write_figures"]


@dataclass(frozen=True)
class Figure:
    """One figure of the study.

    Attributes
    ----------
    name
        Of files and tables.
    title
        One line.
    paper
        What the study says, in other words.
    compute
        The dataset behind it, units in its attributes.
    verdicts
        The study's statements, read off the dataset.
    """

    name: str
    title: str
    paper: str
    compute: Callable[[], xr.Dataset]
    verdicts: Callable[[xr.Dataset], tuple[Verdict, ...]]

    def draw(self, data: xr.Dataset, path: Path) -> None:
        """Write the picture as a PNG file."""
        # late: a study may be computed without drawing it
        from laufruhe.plots.style import save
        from laufruhe.plots.tractor import DRAW

        save(DRAW[self.name](data), path)


_WORDS: dict[str, tuple[str, str]] = {
    "fig-02-05-07": (
        "Mount force of the single, part by part",
        "Gas loads a mount of the single with up to 300 kp (Fig. 2), the reciprocating mass with twice as much "
        "(Fig. 5); what the two point masses of the rod miss of its inertia hardly matters, and is of first order "
        "(Fig. 7).",
    ),
    "fig-08-09": (
        "Polar diagrams of the single",
        "Little balancing leaves chiefly vertical forces, much of it chiefly lateral ones (Figs. 8 and 9).",
    ),
    "fig-10": (
        "Mean mount force over the balance fraction",
        "About half of the reciprocating mass should be balanced if both directions count alike, and forces grow with "
        "piston speed (Fig. 10).",
    ),
    "fig-12": (
        "Two, three, four and six equal cylinders",
        "Six cylinders are best and do not mind the length of the mounting; four come off badly, their front mounts "
        "worse when it is long; three do well; two suffer from second order on the front mounts (Fig. 12).",
    ),
    "fig-13": (
        "The same at equal total power",
        "Three cylinders beat four, and two by more (Fig. 13).",
    ),
    "fig-15": (
        "Two cylinders with a first-order shaft",
        "Negligible on rigid mounts, because the force of second order prevails (Fig. 15).",
    ),
    "fig-17": (
        "Three cylinders with a first-order shaft",
        "Noticeable, if not very large (Fig. 17).",
    ),
    "fig-22": (
        "Four cylinders with force pair and moment pair",
        "The force pair takes off 70 %, half of the full moment pair another 53 % (Fig. 22).",
    ),
    "fig-25": (
        "Four cylinders with one pair at the front end",
        "A pair at the front end alone helps markedly; turned for force and moment, with 72 % of the force, not as "
        "much as two pairs but still considerably (Fig. 25).",
    ),
    "fig-28": (
        "Two-stroke four-cylinder on two cranks",
        "Without a shaft the common crank is better; with one, the other crank, of which no first or second order is "
        "left (Fig. 28).",
    ),
    "fig-29": (
        "V-twin by bank angle",
        "At 90 degrees nothing of first order turns against the crank; at 180 the second order vanishes (Fig. 29).",
    ),
    "fig-30": (
        "Boxer against inline",
        "Both are free of first order; the second is a force in line and a couple in the boxer (Fig. 30).",
    ),
    "fig-31": (
        "Isolation of an elastic mounting",
        "A mounting isolates from sqrt 2 times its natural frequency on (Fig. 31).",
    ),
    "fig-32": (
        "Sag of an elastic mounting",
        "A critical speed of 400 rpm takes 5.6 mm with first-order excitation, 1.4 mm with second order only "
        "(Fig. 32).",
    ),
    "free-force": (
        "Free force against tolerances",
        "A four-cylinder vehicle diesel has about 1000 kp of free second-order force, all tolerances together make "
        "100 kp at worst.",
    ),
    "gas-trace": (
        "The gas trace behind the figures",
        "No trace is printed; 300 kp, 7 m/s, Φ = 50 %, 70 % and 53 % bear on it.",
    ),
}

FIGURES: dict[str, Figure] = {
    name: Figure(name, *words, COMPUTE[name], VERDICTS[name]) for name, words in _WORDS.items()
}
"""Every figure of the study, by its name."""


def verdict_table(verdicts: Mapping[str, tuple[Verdict, ...]]) -> str:
    """All statements as a Markdown table, figure by figure."""
    lines = ["| statement | the study | here | confirmed | why |", "| --- | --- | --- | --- | --- |"]
    for name in verdicts:
        for v in verdicts[name]:
            ours = "0" if abs(v.ours) < 1e-9 else f"{v.ours:.4g}"
            cells = (v.statement, v.paper, f"{ours} {v.unit}".strip(), _confirmed(v), v.why)
            lines.append("| " + " | ".join(cells) + " |")
    return "\n".join(lines) + "\n"


def _confirmed(verdict: Verdict) -> str:
    if verdict.paper == UNSTATED:
        return "–"
    return "yes" if verdict.agrees else "**no**"


def write_figures(folder: Path, say: Callable[[str], None]) -> list[str]:
    """Dataset and picture of every figure into a folder that exists; the page about them.

    Parameters
    ----------
    folder
        Where the files go.
    say
        Told which figure is being made.

    Returns
    -------
    Lines of Markdown: what the study says and shows, figure by figure, its statements
    beside ours, and where the time went.
    """
    found: dict[str, tuple[Verdict, ...]] = {}
    seconds: dict[str, float] = {}
    pages: list[str] = []
    for k, (name, figure) in enumerate(FIGURES.items()):
        say(f"{name}, {k + 1} of {len(FIGURES)} figures")
        started = time.perf_counter()
        data = figure.compute()
        data.to_netcdf(folder / f"{name}.nc")
        figure.draw(data, folder / f"{name}.png")
        found[name] = figure.verdicts(data)
        seconds[name] = time.perf_counter() - started
        pages += [f"## {figure.title}", "", f"The study: {figure.paper}", "", f"![{figure.title}]({name}.png)", ""]
    stated = [v for verdicts in found.values() for v in verdicts if v.paper != UNSTATED]
    count = f"{sum(v.agrees for v in stated)} of {len(stated)} statements of the study are confirmed."
    spent = [f"| {name} | {duration:.1f} |" for name, duration in seconds.items()]
    return [
        *pages, "## Statements", "", count, "", verdict_table(found), "## Where the time went", "",
        "| figure | s |", "| --- | ---: |", *spent, f"| all | {sum(seconds.values()):.1f} |", "",
    ]  # fmt: skip


def figure_files() -> list[str]:
    """Everything that `write_figures` makes."""
    return [f"{name}.{end}" for name in FIGURES for end in ("nc", "png")]
