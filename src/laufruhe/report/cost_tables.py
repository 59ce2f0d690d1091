"""Markdown tables of study parts on what balancing costs: economics, tolerances, and free forces by layout."""

from __future__ import annotations

from collections.abc import Sequence

import xarray as xr

from laufruhe.physics.modes import GRAVITY
from laufruhe.present.numbers import percent
from laufruhe.report.study_tables import NOTHING, number, table
from laufruhe.studies.economics import Standing
from laufruhe.studies.free_forces import printed_agree
from laufruhe.studies.tolerance import CAUSES
from laufruhe.studies.tolerance_study import rise_of
from laufruhe.studies.tolerance_study import verdicts as tolerance_verdicts
from laufruhe.studies.tractor.verdict import Verdict
from laufruhe.studies.worth import verdicts, worths


def economics(data: xr.Dataset) -> list[str]:
    """Every engine at its optimum, what is worth building, what was said, and the front."""
    judged = {worth.build: worth for worth in worths(data)}
    unit = data["optimum"].attrs["units"]
    plain = float(data["optimum"].isel(build=0))
    head = ["engine", "shafts", "mass on them [kg]", f"{data.attrs['objective']} [{unit}]", f"lower bound [{unit}]",
            "beside plain", "worth building"]  # fmt: skip
    rows = []
    for name in data["build"].values:
        row = data.sel(build=name)
        force, worth = float(row["optimum"]), judged.get(str(name))
        more = str(row["standing"].item()) == Standing.NEXT
        change = NOTHING if force == plain else percent(force / plain - 1.0)
        told = f"{'**yes**' if worth.worth else 'no'}: {worth.why}" if worth else NOTHING
        label = f"{name}, no shafts, equal power" if more else str(name)
        cells = [label, str(int(row["shafts"])), f"{float(row['optimum_mass']):.2f}", number(force)]
        rows.append([*cells, number(float(row["optimum_bound"]), 6), change, told])
    said = [verdict for own in verdicts(data).values() for verdict in own]
    return [*table(head, rows, len(rows)), "", *_said(said), *_front(data)]


def _front(data: xr.Dataset) -> list[str]:
    """Least force by mass allowed, efficient points in bold."""
    unit = data["force"].attrs["units"]
    built = [str(b) for b in data["build"].values[data["shafts"].values > 0]]
    rows = []
    for limit in data["mass_limit"].values:
        here = data.sel(mass_limit=limit)
        cells = [f"{float(here['force'].sel(build=b)):.1f}" for b in built]
        best = [bool(here["efficient"].sel(build=b)) for b in built]
        marked = [f"**{c}**" if b else c for c, b in zip(cells, best, strict=True)]
        rows.append([f"{limit:g}", *marked])
    words = f"Least {data.attrs['objective']} [{unit}] by mass allowed on the shafts, every number proven to "
    words += f"{100.0 * float(data['gap'].max()):.1g} %; bold: nothing else has less force, mass and shafts."
    return [words, "", *table(["mass [kg]", *built], rows, len(rows))]


def tolerance(data: xr.Dataset) -> list[str]:
    """Nominal, worst and random free forces of every engine [kp], cause by cause, and what was said."""
    head = ["engine", "drawing [kp]", "worst sum [kp]", *(f"of it {cause} [kp]" for cause in CAUSES)]
    head += ["random: mean [kp]", "95 % below [kp]", "drawing over worst sum"]
    head += ["mean mount force, drawing [kp]", "95 % of built engines: at most"]
    rows = []
    for name in data["case"].values:
        row = data.sel(case=name)
        nominal, worst = float(row["nominal"]) / GRAVITY, float(row["worst"]) / GRAVITY
        parts = [f"{float(row['worst_' + cause.replace(' ', '_')]) / GRAVITY:.1f}" for cause in CAUSES]
        often = float(row["random"].sel(share=0.95, method="nearest")) / GRAVITY
        cells = [str(name), f"{nominal:.3g}", f"{worst:.1f}", *parts, f"{float(row['mean']) / GRAVITY:.1f}"]
        cells += [f"{often:.1f}", f"{nominal / worst:.2g}", number(float(row["mount"]) / GRAVITY, 3)]
        rows.append([*cells, percent(rise_of(row))])
    return [*table(head, rows, len(rows)), "", *_said(tolerance_verdicts(data))]


def free_forces(data: xr.Dataset) -> list[str]:
    """Free forces and couples by layout, printed values behind them where there are some."""
    head = ["layout", "firing intervals [deg]"]
    columns = [(what, int(order)) for order in data["order"].values for what in ("force", "couple")]
    head += [f"{what} {order}" for what, order in columns]
    head += ["crank weights leave of force 1", "of couple 1"]
    rows = []
    for name in data["case"].values:
        row = data.sel(case=name)
        least, most = float(row["least_interval"]), float(row["largest_interval"])
        even = most - least < 1e-6
        cells = [str(name), f"{most:.4g}" if even else f"{least:.4g} to {most:.4g}"]
        cells += [_beside(row.sel(order=order), what) for what, order in columns]
        first = row.sel(order=1)
        rows.append([*cells, *(_plain(float(first[f"{what}_against"])) for what in ("force", "couple"))])
    agreed, of = printed_agree(data)
    words = f"{agreed} of {of} printed values agree to half of the last of {data.attrs['digits']} digits."
    legend = "Forces over one cylinder's of the same order, couples over that times the spacing; printed values "
    legend += "in brackets."
    return [legend, "", *table(head, rows, len(rows)), "", words]


def _beside(row: xr.Dataset, what: str) -> str:
    ours, printed = float(row[what]), float(row[f"{what}_printed"])
    return _plain(ours) if printed != printed else f"{_plain(ours)} ({printed:g})"


def _plain(value: float) -> str:
    return "0" if abs(value) < 1e-9 else f"{value:.4f}"


def _said(found: Sequence[Verdict]) -> list[str]:
    if not found:
        return []
    rows = [[v.statement, v.paper, _ours(v), "yes" if v.agrees else "**no**", v.why] for v in found]
    return [*table(["what was said of", "said", "here", "confirmed", "why"], rows, len(rows)), ""]


def _ours(verdict: Verdict) -> str:
    signed = "+" if "%" in verdict.unit else ""
    return f"{verdict.ours:{signed}.3g} {verdict.unit}"
