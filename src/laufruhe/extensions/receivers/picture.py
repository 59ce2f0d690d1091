"""Response of receivers over frequency with their weighting, and over crank speed."""

from __future__ import annotations

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter, LogLocator

from laufruhe.extensions.receivers.facts import (
    OrderAmplitudes,
    amplitudes_of,
    has_receivers,
    over_speed,
    unit_and_factor,
    weighting_words,
)
from laufruhe.extensions.receivers.machine import FrequencyFunction, Receiver, receivers_of
from laufruhe.extensions.receivers.weightings import Weighting
from laufruhe.machine import OperatingPoint
from laufruhe.plots.speed_axis import STYLES, mark_points
from laufruhe.plots.style import ORANGE, Series, axis_end, entry, finish_page, page, series_of, styled
from laufruhe.plots.words import FAINT, INK
from laufruhe.present.numbers import RPM
from laufruhe.solvers.result import Result

applies = has_receivers
MAX_RECEIVERS = 2
SHARE = 0.002
"""Least amplitude that is drawn, over the largest."""


@styled()
def figure(result: Result) -> Figure:
    """Draw amplitudes of receivers by frequency at one operating point, and weighted rms over crank speed."""
    receivers = _drawn_receivers(result)
    layout = page(2, len(receivers), (6.8 if len(receivers) == 1 else 4.2, 2.3), gap=0.75, across=0.8)
    series, points = series_of(result, loads=True), _points(result)
    hardest = _hardest(result, receivers[0])
    for k, receiver in enumerate(receivers):
        answers = [amplitudes_of(receiver, item.design.loads[hardest]) for item in series]
        _draw_spectrum(layout.panels[k], receiver, series, answers, _curves(receivers))
        _draw_speeds(layout.panels[len(receivers) + k], receiver, result, series, points)
    name = result.problem.points[hardest].name
    legend: list[Artist] = [item.entry(": weighted") for item in series]
    curves = _curves(receivers)
    legend += [
        entry(f"{curve.name}, times the largest amplitude", color=ORANGE, linewidth=1.2, linestyle=style)
        for curve, style in zip(curves, STYLES, strict=False)
    ]
    legend += [entry("without weighting", color=FAINT, marker="_", linestyle="none")] if curves else []
    if len(points) > 1:
        legend += [entry(f"load of {p.name}", color=INK, linestyle=s) for p, s in zip(points, STYLES, strict=False)]
    lines = f"Above: amplitude of every order at {name}. Below: root mean square over the cycle, weighted, over speed."
    return finish_page(layout, result, "What receivers feel", lines, legend)


def _drawn_receivers(result: Result) -> list[Receiver]:
    # those that objective and limits count, or the first ones
    receivers, problem = receivers_of(result.final.engine), result.problem
    counted = {
        name
        for measure in problem.measures
        if measure.is_load and "receivers" in measure.channel.keys
        for name in measure.at or measure.channel.places(problem.engine)
    }
    return [one for one in receivers if one.name in counted or not counted][:MAX_RECEIVERS]


def _points(result: Result) -> list[OperatingPoint]:
    # operating points that differ in speed alone have one curve
    return list({point.gas: point for point in result.problem.points}.values())[: len(STYLES)]


def _hardest(result: Result, receiver: Receiver) -> int:
    sizes = [amplitudes_of(receiver, loads).rms for loads in series_of(result, loads=True)[0].design.loads]
    return int(np.argmax(sizes))


def _curves(receivers: list[Receiver]) -> list[Weighting | FrequencyFunction]:
    curves = [curve for receiver in receivers for curve in receiver.weightings if curve is not None]
    return list(dict.fromkeys(curves))


def _draw_spectrum(
    axes: Axes, receiver: Receiver, series: list[Series], answers: list[OrderAmplitudes],
    curves: list[Weighting | FrequencyFunction],
) -> None:  # fmt: skip
    top = axis_end(float(answer.plain.max(initial=0.0)) for answer in answers)
    unit, factor = unit_and_factor(receiver, top)
    top *= factor
    seen = [answer.frequencies[factor * answer.plain > SHARE * top] for answer in answers]
    drawn = np.concatenate([*seen, [10.0]])
    low, high = 0.7 * float(drawn.min()), 1.4 * float(drawn.max())
    for j, (item, answer) in enumerate(zip(series, answers, strict=True)):
        visible = factor * answer.plain > SHARE * top
        # designs side by side
        places = answer.frequencies[visible] * (1.0 + 0.012 * (2 * j - len(series) + 1))
        axes.vlines(places, 0.0, factor * answer.weighted[visible], color=item.colour, linewidth=2.4)
        axes.plot(
            places, factor * answer.plain[visible], linestyle="none", marker="_", markersize=7.0, color=item.colour
        )
    inside = np.geomspace(max(low, receiver.band[0]), min(high, receiver.band[1]), 300)
    for curve, style in zip(curves, STYLES, strict=False):
        if curve in receiver.weightings:
            factors = top * np.abs(curve.at(inside)).ravel()
            axes.plot(inside, factors, color=ORANGE, linewidth=1.2, linestyle=style, zorder=1.5)
    axes.set(xscale="log", xlim=(low, high), ylim=(0.0, 1.15 * top), xlabel="frequency [Hz]")
    axes.xaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
    axes.xaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
    axes.xaxis.set_minor_formatter(FuncFormatter(lambda *_: ""))
    axes.set_ylabel(f"{receiver.name} [{unit}]")


def _draw_speeds(
    axes: Axes, receiver: Receiver, result: Result, series: list[Series], points: list[OperatingPoint]
) -> None:
    top = 0.0
    sizes = [amplitudes_of(receiver, loads).rms for item in series for loads in item.design.loads]
    unit, factor = unit_and_factor(receiver, max(sizes))
    for item in series:
        for point, style in zip(points, STYLES, strict=False):
            speeds, values = over_speed(receiver, result.problem, item.design, point)
            axes.plot(RPM * speeds, factor * values, color=item.colour, linestyle=style, linewidth=1.6)
            top = max(top, factor * float(np.nanmax(values, initial=0.0)))
        dots = [(RPM * loads.point.speed, factor * amplitudes_of(receiver, loads).rms) for loads in item.design.loads]
        axes.plot(*zip(*dots, strict=True), linestyle="none", marker="o", markersize=4.5, color=item.colour)
    axes.set(xlim=(RPM * speeds[0], RPM * speeds[-1]), ylim=(0.0, 1.15 * top or 1.0), xlabel="crank speed [rpm]")
    words = weighting_words(receiver)
    axes.set_ylabel(f"rms, {'no weighting' if words == 'none' else words} [{unit}]")
    mark_points(axes, result)
