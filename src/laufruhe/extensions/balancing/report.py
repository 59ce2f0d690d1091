"""Report of a balancing job: holes as read at the machine, residuals, proof, picture and card."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from laufruhe.cli.screen import Output, typed
from laufruhe.errors import counted
from laufruhe.extensions.balancing.bob_weights import CARD, card, record
from laufruhe.extensions.balancing.file import Correction, Job, load_job
from laufruhe.extensions.balancing.physics import Drilling, Hole, Plane
from laufruhe.extensions.balancing.search import WASTE, PlaneResult, correct
from laufruhe.files.reader import display_path
from laufruhe.numerics.arrays import Array
from laufruhe.plots.picture import save_picture
from laufruhe.present.numbers import DASH, fixed, number, trimmed
from laufruhe.present.picture import Area, Axis, Line, Mark, Panel, Picture, Words
from laufruhe.present.tables import Table
from laufruhe.report import files
from laufruhe.report.document import Block, Document, Heading, Illustration, Paragraph, reproduction, sources
from laufruhe.report.screen import show_document
from laufruhe.report.strict_json import strict, versions
from laufruhe.report.table_files import write_csv
from laufruhe.report.web_page import write_pages
from laufruhe.units import readable, readable_unbalance, shown_in

HOLES, PICTURE = "holes", "planes"
NAMES = (
    files.REPORT,
    files.PAGE,
    files.RESULT,
    f"{HOLES}.csv",
    f"{CARD}.csv",
    *(f"{PICTURE}.{kind}" for kind in files.KINDS),
)
CAPTION = "The two planes to scale, seen from the front, with the holes."
_COLOURS = {"hole": "sky", "slug": "orange"}
_THRIFT = (
    f" Of the designs with the fewest holes and a permitted residual, exchanges of holes looked for the least sum of "
    f"residual and {trimmed(100.0 * WASTE)} % of the unbalance of all holes, so no hole is opposite to another for a "
    "residual far below the permitted one (not proven)."
)
GRAM_MM = 1e6
"""Factor from kg m to g mm."""


@dataclass(frozen=True, eq=False)
class Balanced:
    """Correction with the holes of both planes."""

    correction: Correction
    planes: tuple[PlaneResult, ...]

    @property
    def is_met(self) -> bool:
        """True if both residuals are permitted."""
        return all(plane.is_met for plane in self.planes)

    @property
    def holes(self) -> Iterator[tuple[Plane, float, Hole]]:
        """Plane, angle on the crank [rad] and hole, in the order of planes and readings."""
        for result in self.planes:
            entries = [(result.plane.angles[place], result.plane.holes[place][k]) for place, k in result.design]
            for angle, hole in sorted(entries, key=lambda entry: self.correction.dial.reading(entry[0])):
                yield result.plane, angle, hole


def balanced(
    path: Path, out: Path | None, kinds: Sequence[str], say: Callable[[str], None]
) -> tuple[Output, Callable[[], str], bool]:
    """Decide the holes of a file and write its results; `say` reports steps.

    Return a function that shows the report, one that returns JSON, and True if both residuals are permitted.
    """
    say("reading the file")
    job = load_job(path)
    folder = out or Path("results") / f"{display_path(path).stem}-balance"
    option = "results" if out is None else "--out"
    with files.staged(files.FileSet(folder, option, "balance", NAMES)) as stage:
        answer = None if job.correction is None else decide(job.correction, say)
        pictures = {}
        if answer is not None:
            write_csv(_numbers(answer), stage / f"{HOLES}.csv")
            say("drawing")
            with shown_in(job.units):
                pictures[PICTURE] = save_picture(picture(job, answer), stage / PICTURE, kinds)
        if (sheet := _card(job)) is not None:
            write_csv(sheet, stage / f"{CARD}.csv")
        with shown_in(job.units):
            document = report(job, answer, typed("laufruhe", "balance", str(path)))
        text = as_json(job, answer)
        files.write(stage / files.RESULT, text)
        write_pages(stage, document, pictures, f".{kinds[0]}")
    is_met = answer is None or answer.is_met
    return lambda stream: show_document(document, stream, folder, files.PAGE), lambda: text, is_met


def decide(correction: Correction, say: Callable[[str], None] = lambda _: None) -> Balanced:
    """Return the holes of both planes; each plane is decided alone, because its holes change no other plane."""
    results = []
    for plane, gap in zip(correction.planes, correction.gaps, strict=True):
        say(f"deciding the holes of '{plane.name}'")
        results.append(correct(plane, correction.max_holes, correction.is_fewest, gap))
    return Balanced(correction, tuple(results))


def report(job: Job, answer: Balanced | None, command: str) -> Document:
    """Return the page of a balancing job."""
    return Document(job.title, tuple(_blocks(job, answer, command)))


def _blocks(job: Job, answer: Balanced | None, command: str) -> Iterator[Block]:
    yield from sources(job.source, job.assumptions)
    if answer is not None:
        yield Heading("Correction")
        yield Paragraph(headline(answer))
        yield _hole_table(answer)
        yield Illustration(PICTURE, CAPTION)
        yield _plane_table(answer)
        yield _count_table(answer)
        yield Paragraph(_proof(answer))
    if (sheet := _card(job)) is not None:
        yield sheet
    yield from reproduction(command)


def headline(answer: Balanced) -> str:
    """Return the result in a sentence."""
    holes, is_fewest = sum(len(result.design) for result in answer.planes), answer.correction.is_fewest
    if answer.is_met and is_fewest and not holes:
        return "No hole is needed: the unbalance of both planes is permitted."
    if answer.is_met:
        verb = "corrects" if holes == 1 else "correct"
        goal = "the fewest" if is_fewest else "the least residual"
        is_proven = all(result.is_fewest if is_fewest else result.is_least for result in answer.planes)
        proof = "(proven)" if is_proven else "that was found (not proven)"
        return f"{counted(holes, 'hole')} {verb} both planes: {goal} {proof}."
    names = " and ".join(f"'{r.plane.name}'" for r in answer.planes if not r.is_met)
    is_proven = all(r.is_fewest for r in answer.planes if not r.is_met)
    what = "is proven to correct" if is_proven else "was found that corrects"
    maximum = counted(answer.correction.max_holes, "hole")
    return (
        f"No design with at most {maximum} in a plane {what} {names} to a permitted residual; "
        "the design with the least residual follows."
    )


def _proof(answer: Balanced) -> str:
    correction = answer.correction
    scales = [plane.permitted or abs(plane.initial) or 1.0 for plane in correction.planes]
    gap = trimmed(100.0 * max(gap / scale for gap, scale in zip(correction.gaps, scales, strict=True)))
    what = "permitted residual" if correction.rule else "initial unbalance or permitted residual"
    return (
        "Every set of places has a lower bound of its residual; sets that may hold a better design are enumerated. "
        f"A residual counts as least if no other is better by {gap} % of the {what}."
        f"{_THRIFT * correction.is_fewest}"
    )


def _hole_table(answer: Balanced) -> Table:
    drilling, dial = answer.correction.drilling, answer.correction.dial
    (length, millimetres), (mass, grams), (unbalance, size) = _units(answer.planes)
    rows = [
        (f"{k}", plane.name, _kind(hole), *(trimmed(millimetres * size) for size in (hole.diameter, hole.depth)),
         number(millimetres * drilling.tip(hole.diameter, hole.depth)), trimmed(millimetres * plane.radius),
         fixed(math.degrees(dial.reading(angle)), 1), fixed(math.degrees(angle) % 360.0, 1),
         _signed(grams * drilling.mass(hole.diameter, hole.depth, hole.filled)), _signed(size * hole.change))
        for k, (plane, angle, hole) in enumerate(answer.holes, 1)
    ]  # fmt: skip
    head = ("hole", "plane", "kind", f"diameter [{length}]", f"depth [{length}]",
            f"depth to the tip [{length}]", f"radius [{length}]", "angle at the machine [deg]",
            "angle on the crank [deg]", f"mass [{mass}]", f"unbalance [{unbalance}]")  # fmt: skip
    way = "towards the axis, from the surface at the radius" if drilling.is_radial else "along the axis, at the radius"
    sense = "with" if dial.sense > 0.0 else "against"
    zero = fixed(math.degrees(dial.zero) % 360.0, 1)
    point = f" The drill's point has {fixed(math.degrees(drilling.point_angle), 0)} deg." * (
        drilling.point_angle < math.pi
    )
    note = (
        f"Holes {way}. Depth, like max_depth, to the end of the full diameter.{point} "
        f"The machine counts {sense} the rotation from the zero mark, at {zero} deg on the crank. {_wall(answer)}"
    )
    return Table(head, rows, title="Holes", left=(1, 2), note=note)


def _wall(answer: Balanced) -> str:
    (length, factor), wall = _units(answer.planes)[0], max(plane.wall for plane in answer.correction.planes)
    if not wall:
        return "The file gives no wall: a drill may break through into the next hole, or at the edge of a sector."
    return f"At least {trimmed(factor * wall)} {length} of material is left between holes, and at the edge of a sector."


def _units(planes: Sequence[PlaneResult]) -> tuple[tuple[str, float], ...]:
    # units of lengths, masses and unbalances in the report, with factors on SI values
    largest = max(abs(result.plane.initial) for result in planes)
    return readable("m"), readable("kg", "g"), readable_unbalance(largest)


def _signed(value: float) -> str:
    return f"{'+' if value > 0.0 else '-'}{number(abs(value))}"


def _kind(hole: Hole) -> str:
    return "slug" if hole.filled else "hole"


def _numbers(answer: Balanced) -> Table:
    head = ("hole", "plane", "kind", "diameter [mm]", "depth [mm]", "angle at the machine [deg]",
            "angle on the crank [deg]", "radius [mm]", "mass [g]", "unbalance [g mm]",
            "depth to the tip [mm]")  # fmt: skip
    rows = [
        [k, entry["plane"], entry["kind"], _decimal(1e3 * entry["diameter"]), _decimal(1e3 * entry["depth"]),
         *(_decimal(math.degrees(entry[key])) for key in ("machine_angle", "crank_angle")),
         _decimal(1e3 * entry["radius"]), 1e3 * entry["mass"], GRAM_MM * entry["unbalance"],
         _decimal(1e3 * entry["tip_depth"])]
        for k, entry in enumerate(_hole_records(answer), 1)
    ]  # fmt: skip
    return Table(head, rows)


def _decimal(value: float) -> float:
    # a depth of 12 mm is not 12.000000000000002
    return round(value, 9)


def _hole_records(answer: Balanced) -> list[dict[str, Any]]:
    drilling, dial = answer.correction.drilling, answer.correction.dial
    return [
        {"plane": plane.name, "kind": _kind(hole), "diameter": hole.diameter, "depth": hole.depth,
         "tip_depth": drilling.tip(hole.diameter, hole.depth), "machine_angle": dial.reading(angle),
         "crank_angle": angle % math.tau, "radius": plane.radius,
         "mass": drilling.mass(hole.diameter, hole.depth, hole.filled), "unbalance": hole.change}
        for plane, angle, hole in answer.holes
    ]  # fmt: skip


def _plane_table(answer: Balanced) -> Table:
    dial, (unit, size) = answer.correction.dial, _units(answer.planes)[2]
    rows = [
        (result.plane.name, number(size * abs(result.plane.initial)), _angle(result.plane.initial, dial.reading),
         f"{len(result.design)}", number(size * abs(result.residual), 3), _angle(result.residual, dial.reading),
         DASH if result.plane.permitted is None else number(size * result.plane.permitted),
         DASH if result.plane.permitted is None else "yes" if result.is_met else "no")
        for result in answer.planes
    ]  # fmt: skip
    head = ("plane", f"before [{unit}]", "at [deg]", "holes", f"residual [{unit}]", "at [deg]", f"permitted [{unit}]",
            "met")  # fmt: skip
    note = "Angles as read at the machine."
    rule = f" Permitted: {answer.correction.rule}." if answer.correction.rule else ""
    return Table(head, rows, title="Unbalance of the planes", note=note + rule)


def _angle(unbalance: complex, reading: Callable[[float], float]) -> str:
    return fixed(math.degrees(reading(float(np.angle(unbalance)))), 1) if unbalance else DASH


def _count_table(answer: Balanced) -> Table:
    numbers, (unit, size) = max(len(result.counts) for result in answer.planes), _units(answer.planes)[2]
    rows = [
        (f"{holes}", *(cell for result in answer.planes for cell in _count_cells(result, holes, size)))
        for holes in range(numbers)
    ]
    head = ["holes", *(f"{result.plane.name}: {text}" for result in answer.planes
                       for text in (f"least residual [{unit}]", f"lower bound [{unit}]"))]  # fmt: skip
    note = "Least residual with exactly so many holes. A dash: not needed, or no such design."
    return Table(head, rows, title="Holes against residual", note=note, left=0)


def _count_cells(result: PlaneResult, holes: int, size: float) -> tuple[str, str]:
    if holes >= len(result.counts):
        return DASH, DASH
    return number(size * result.counts[holes].value), number(size * result.counts[holes].bound)


def _card(job: Job) -> Table | None:
    return None if job.weights is None else card(job.engine, job.weights)


def as_json(job: Job, answer: Balanced | None) -> str:
    """Return the result as JSON in SI units; angles in rad."""
    content: dict[str, Any] = {"title": job.title, "versions": versions()}
    if answer is not None:
        content["correction"] = {
            "goal": "fewest holes" if answer.correction.is_fewest else "least residual",
            "permitted": answer.correction.rule or None,
            "met": answer.is_met,
            "planes": [_plane_record(result, gap) for result, gap in
                       zip(answer.planes, answer.correction.gaps, strict=True)],
            "holes": _hole_records(answer),
        }  # fmt: skip
    if job.weights is not None:
        content["bob_weights"] = record(job.engine, job.weights)
    return strict(content)


def _plane_record(result: PlaneResult, gap: float) -> dict[str, Any]:
    plane = result.plane
    before, after = (
        {"unbalance": abs(one), "crank_angle": float(np.angle(one)) % math.tau}
        for one in (plane.initial, result.residual)
    )
    return {
        "name": plane.name, "before": before, "after": after, "permitted": plane.permitted, "met": result.is_met,
        "fewest_proven": result.is_fewest, "least_proven": result.is_least, "gap": gap,
        "counts": [
            {"holes": k, "residual": count.value, "bound": count.bound, "proven": count.proven}
            for k, count in enumerate(result.counts)
        ],
    }  # fmt: skip


def picture(job: Job, answer: Balanced) -> Picture:
    """Return the picture of both planes, to one scale."""
    reach = 1.75 * max(plane.radius for plane in answer.correction.planes)
    panels, first = [], 1
    for result in answer.planes:
        holes = [(angle, hole) for plane, angle, hole in answer.holes if plane is result.plane]
        panels.append(_panel(result, holes, first, answer.correction, 1e3 * reach))
        first += len(holes)
    legend: list[Mark] = [Line(colour="vermilion", label="unbalance before, at its angle", width=2.0),
                          Line(colour="grey", label="place without a hole", width=0.0, marker="+")]  # fmt: skip
    if any(plane.solid for plane in answer.correction.planes):
        legend.append(Line(colour="ink", label="sector without holes", width=3.0))
    kinds = {_kind(hole) for _, _, hole in answer.holes}
    legend += [Area(colour=_COLOURS[kind], label=kind) for kind in _COLOURS if kind in kinds]
    view = "Both planes as seen from the front, where the crank turns clockwise; from the rear they are mirrored. "
    view += "The list has diameter, depth, and angle at the machine."
    words = f"{headline(answer)} {view}"
    source = f"{job.source}. " if job.source else ""
    return Picture(job.title, words, panels, f"{source}Computed with Laufruhe.", (4.0, 4.0), 2, 0.8, legend)


def _panel(
    result: PlaneResult, holes: Sequence[tuple[float, Hole]], first: int, correction: Correction, reach: float
) -> Panel:
    plane, radius = result.plane, 1e3 * result.plane.radius
    turn = np.linspace(0.0, math.tau, 181)
    marks: list[Mark] = [_line(radius * _unit(turn), "faint", 0.8)]
    for low, high in plane.solid:
        marks.append(_line(radius * _unit(np.linspace(low, high, 91)), "ink", 3.0))
    occupied = {angle for angle, _ in holes}
    idle = [angle for angle in plane.angles if angle not in occupied]
    marks.append(replace(_line(radius * _unit(np.array(idle)), "grey", 0.0), marker="+", size=5.0))
    for k, (angle, hole) in enumerate(holes, first):
        marks += _hole_marks(angle, hole, radius, correction.drilling)
        place = (radius + 0.5e3 * hole.diameter + 0.05 * reach) * _unit(np.array([angle]))[0]
        marks.append(Words(place[0], place[1], f"{k}", across="center"))
    (length, millimetres), _, (unbalance, size) = _units([result])
    texts = [
        f"{k}: ⌀{trimmed(millimetres * hole.diameter)} × {trimmed(millimetres * hole.depth)} {length} at "
        f"{fixed(math.degrees(correction.dial.reading(angle)), 1)}°"
        for k, (angle, hole) in enumerate(holes, first)
    ]
    for side, column, across in ((-0.95, texts[:4], "left"), (0.95, texts[4:], "right")):
        marks.append(Words(side * reach, -0.95 * reach, "\n".join(column), across=across, along="bottom"))
    if plane.initial:
        spot = _unit(np.array([float(np.angle(plane.initial))]))[0]
        marks.append(_line(np.array([0.0 * spot, 0.8 * radius * spot]), "vermilion", 2.0))
    zero = correction.dial.zero
    is_one = math.isclose(math.cos(zero), 1.0, abs_tol=1e-9)
    for angle, text in ((0.0, "0° crank and machine"),) if is_one else ((0.0, "0° crank"), (zero, "0° machine")):
        ends = reach * np.array([[0.76], [0.81], [0.83]]) * _unit(np.array([angle]))
        marks.append(_line(ends[:2], "faint", 1.2))
        across = "center" if abs(ends[2, 0]) < 0.05 * reach else "left" if ends[2, 0] > 0.0 else "right"
        marks.append(Words(ends[2, 0], ends[2, 1], text, "faint", across, "bottom" if ends[2, 1] > 0.0 else "top"))
    residual, before = (number(size * abs(one), 3) for one in (result.residual, plane.initial))
    title = f"{plane.name}, seen from the front\n{before} {unbalance} before, {residual} {unbalance} after"
    axis = Axis("mm", (-reach, reach))
    return Panel(marks, axis, axis, title)


def _unit(angles: Array) -> Array:
    # across and up, seen from the front: angles count clockwise from the top (C3)
    return np.column_stack([np.sin(angles), np.cos(angles)])


def _line(points: Array, colour: str, width: float) -> Line:
    return Line(points[:, 0], points[:, 1], colour, width=width)


def _hole_marks(angle: float, hole: Hole, radius: float, drilling: Drilling) -> list[Mark]:
    colour, half = _COLOURS[_kind(hole)], 0.5e3 * hole.diameter
    out, across = _unit(np.array([angle, angle + 0.5 * math.pi]))
    if drilling.is_radial:
        floor, tip = radius - 1e3 * hole.depth, radius - 1e3 * (hole.depth + drilling.point_height(hole.diameter))
        corners = [(radius, half), (floor, half), (tip, 0.0), (floor, -half), (radius, -half), (radius, half)]
        return [_line(np.array([along * out + side * across for along, side in corners]), colour, 2.0)]
    steps = np.linspace(-half, half, 61)
    heights = np.sqrt(np.maximum(half**2 - steps**2, 0.0))
    middle = radius * out
    return [Area(middle[0] + steps, middle[1] - heights, middle[1] + heights, colour)]
