"""Claims of a result, compared with the plain model and with the best rival."""

from __future__ import annotations

import contextlib
import io
import os
import time
import traceback
import warnings
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from attack import newer_families, own_judge, ranged_families
from attack.crossings import OWN_CROSSINGS, PLAIN_CROSSINGS, best_of_choices, judge_ranks, judge_robust
from attack.driven_families import FAMILIES as DRIVEN
from attack.families import moving_mass, toml
from attack.openings import Openings
from attack.own_families import OWN_FAMILIES
from attack.plain_loads import number
from attack.plain_scene import Table, terms_of
from attack.rivals import Rival, best_star, convex_rival, least_broken, local_rival
from laufruhe.errors import InputError, ModelError

REFUSABLE = {*PLAIN_CROSSINGS, *DRIVEN, *ranged_families.FAMILIES, *newer_families.FAMILIES}
"""Families of which the package may refuse a problem in one line."""
NEWER = {"speed_ranges", "electric_machines", "receivers"}
"""Tables that the own model does not know."""
SAMPLED = 1e-5
"""Relative accuracy of values read from samples of the plain model, beyond the stated error."""
KINKED = 1e-4
"""The same where gas acts: its kinks lie between the samples of the plain model."""
STEEP = 2.0
"""Times as much of a rotor, whose gas is most of what its bearings feel."""
EXCESS = 3e-5
"""Share of a limit by which a design may pass it."""
GAP = 1e-4
SPARE = 2e-5
"""Share of its limits that a design must have to spare before it counts against 'infeasible'."""


@dataclass
class Verdict:
    """Outcome of one problem.

    Attributes
    ----------
    wrong
        What is claimed and not true, in words with figures.
    bound
        Lower bound; zero where nothing is known.
    beaten
        Share by which a rival is better than a design that claims no optimum.
    """

    family: str
    seed: int
    status: str = ""
    kind: str = ""
    gap: float = 0.0
    bound: float = 0.0
    seconds: float = 0.0
    own_seconds: float = 0.0
    beaten: float = 0.0
    rivals: int = 0
    wrong: list[str] = field(default_factory=list)
    notes: list[str] = field(default_factory=list)

    @property
    def line(self) -> dict[str, Any]:
        return dict(self.__dict__)


def solved(table: Table, folder: Path, name: str = "problem") -> Any:
    """Return the result of a problem, or the error that ended it."""
    import laufruhe

    path = folder / f"{name}.toml"
    path.write_text(toml(table), encoding="utf-8")
    return laufruhe.solve(laufruhe.load(path))


@contextlib.contextmanager
def collected_complaints(wrong: list[str]):
    """Count as a defect what is printed or warned of meanwhile."""
    messages = io.StringIO()
    with (
        warnings.catch_warnings(record=True) as caught,
        contextlib.redirect_stdout(messages),
        contextlib.redirect_stderr(messages),
    ):
        warnings.simplefilter("always")
        yield
    wrong += [f"warns: {w.category.__name__}: {str(w.message)[:150]}" for w in caught[:2]]
    if messages.getvalue().strip():
        wrong.append(f"prints: {messages.getvalue().strip()[:150]}")


def tried(verdict: Verdict, work: Callable[[], list[str]]) -> Verdict:
    """Return the complaints of a piece of work that solves; an error is one."""
    started = time.perf_counter()
    try:
        with collected_complaints(verdict.wrong):
            answer = work()
        verdict.wrong += [line for line in answer if not line.startswith("note: ")]
        verdict.notes += [line for line in answer if line.startswith("note: ")]
        verdict.status = "done"
    except Exception as error:
        verdict.status = "error"
        verdict.wrong.append(message_of(error))
    verdict.seconds = time.perf_counter() - started
    return verdict


def message_of(error: Exception) -> str:
    """Return an error with the line that raised it."""
    last = traceback.extract_tb(error.__traceback__)[-1]
    return f"{type(error).__name__} at {Path(last.filename).name}:{last.lineno}: {str(error)[:200]}"


def try_problem(family: str, seed: int, table: Table, rng: np.random.Generator, folder: Path, maximum: int) -> Verdict:
    """Solve a problem and attack what is claimed of it.

    Parameters
    ----------
    maximum
        Stars that are solved each by itself, and a hundredth of the calls of a local search.
    """
    verdict, started = Verdict(family, seed), time.perf_counter()
    try:
        with collected_complaints(verdict.wrong):
            result = solved(table, folder, f"{family}-{seed}-{os.getpid()}")
    except Exception as error:
        verdict.status = "error"
        if family in REFUSABLE and isinstance(error, InputError | ModelError) and "\n" not in str(error).strip():
            verdict.status = "refused"
            verdict.notes.append(f"note: {str(error)[:150]}")
            return verdict
        verdict.wrong.append(message_of(error))
        return verdict
    finally:
        (folder / f"{family}-{seed}-{os.getpid()}.toml").unlink(missing_ok=True)
        verdict.seconds = time.perf_counter() - started
    started = time.perf_counter()
    if result.certificate is not None:
        verdict.bound = float(result.certificate.lower_bound)
    if family not in OWN_FAMILIES and family not in OWN_CROSSINGS:
        judge(verdict, table, result, rng, maximum)
    if family not in REFUSABLE and not NEWER & table.keys() and own_judge.knows(table):
        judge_by_own(verdict, table, result, rng, maximum)
    verdict.own_seconds = time.perf_counter() - started
    return verdict


def judge_by_own(verdict: Verdict, table: Table, result: Any, rng: np.random.Generator, maximum: int) -> None:
    """Add complaints about a result by the own model."""
    verdict.status = result.status.value
    if result.certificate is not None:
        verdict.kind, verdict.gap = result.certificate.kind.value, result.certificate.gap
    own_judge.judge(verdict, table, result, rng, 300 * maximum)


def judge(verdict: Verdict, table: Table, result: Any, rng: np.random.Generator, maximum: int) -> None:
    """Add complaints about a result."""
    if "speed_ranges" in table:
        ranged_families.judge(verdict, table, result, rng, maximum, KINKED if "gas" in table else SAMPLED)
        return
    if result.certificate is not None and (isinstance(table["objective"], list) or "robust" in table):
        verdict.status, verdict.kind = result.status.value, result.certificate.kind.value
        verdict.gap = result.certificate.gap
        judge_ranks(verdict, table, result) if "robust" not in table else judge_robust(verdict, table, result, maximum)
        return
    openings = Openings(table)
    verdict.status = result.status.value
    if verdict.status == "failed":
        verdict.wrong.append(f"failed: {result.message[:150]}")
    if verdict.status in ("infeasible", "failed"):
        if result.objective is not None or result.certificate is not None:
            verdict.wrong.append(f"{verdict.status}, yet a value and a certificate are told")
        _judge_infeasible(verdict, openings, rng, maximum)
        return
    certificate = result.certificate
    verdict.kind, verdict.gap = certificate.kind.value, certificate.gap
    vector, star = openings.read(result.final.engine, {d.name: d.value for d in result.decisions})
    scene = openings.scene(vector, star)
    value, initial = result.objective.value, result.objective.initial
    floor = 1e-9 * max(initial if np.isfinite(initial) else 0.0, _size(table))
    reading = KINKED if "gas" in table else SAMPLED
    reading *= STEEP if "gas" in table and table["engine"]["layout"] == "rotary" else 1.0
    _judge_value(verdict, result, scene, value, reading, floor)
    rival = _rival(openings, vector, star, value, rng, maximum)
    verdict.rivals = rival.looked_at if rival else 0
    bound, reading = certificate.lower_bound, reading + result.error_estimate
    if bound > scene.objective * (1.0 + reading) + floor and scene.worst <= 0.0:
        verdict.wrong.append(f"own design {scene.objective:.9g} lies under its bound {bound:.9g}")
    if scene.worst > EXCESS:
        verdict.wrong.append(f"a limit is passed by {scene.worst:.2e} of itself")
    initial_scene = openings.scene(*openings.read(result.initial.engine, {d.name: d.initial for d in result.decisions}))
    if initial_scene.worst <= 0.0 and value > initial_scene.objective * (1.0 + reading) + floor:
        verdict.wrong.append(f"value {value:.9g} is worse than {initial_scene.objective:.9g} as given")
    if rival is None or rival.violation > 1e-6:
        return
    # the excess of a rival over a limit costs the limit's price
    prices = (abs(float(np.nan_to_num(limit.shadow_price)) * limit.limit) for limit in result.limits)
    passed = (max(rival.violation, 0.0) + _read_low(result, scene)) * sum(prices)
    if bound > rival.value * (1.0 + reading) + floor + passed:
        verdict.wrong.append(f"bound {bound:.9g}, a rival has {rival.value:.9g} {rival.star or ''}")
    over = (value - rival.value) / max(rival.value, floor)
    allowed = (GAP + reading) * max(rival.value, floor) + floor + passed
    if verdict.kind == "global" and value - rival.value > allowed:
        verdict.wrong.append(f"global {value:.9g}, a rival has {rival.value:.9g} {rival.star or ''}")
    elif verdict.kind != "global":
        verdict.beaten = max(over, 0.0)
        if verdict.gap and rival.value < value * (1.0 - verdict.gap) * (1.0 - reading) - floor:
            verdict.wrong.append(f"gap {verdict.gap:.3g}, but a rival is better by {over:.3g}")


def _size(table: Table) -> float:
    """Return the size of the loads of one piston at the highest speed [N, N m]; 1e-9 without loads."""
    if not any(word in term["quantity"] for term in terms_of(table) for word in ("force", "couple", "moment")):
        return 1e-9
    speed = max(number(point["speed"]) for point in table["operating_points"])
    return 0.1 * moving_mass(table["engine"]) * speed**2


def _limits_read(result: Any, scene: Any) -> Iterator[tuple[Table, Any, float]]:
    """Yield the limits, and what the plain model says of the final design."""
    limits = {limit.name: limit for limit in result.limits}
    for entry in scene.table.get("constraints", []):
        if entry["limit"] != "natural frequencies" and entry.get("name") in limits:
            limit = limits[entry["name"]]
            yield entry, limit, scene.measure({**entry, "quantity": entry["limit"]})


def _read_low(result: Any, scene: Any) -> float:
    """Share of its limit by which the plain model misses a peak of the final design, as it misses those of rivals."""
    shares = (
        (limit.value - value) / limit.limit for entry, limit, value in _limits_read(result, scene) if "max" in entry
    )
    return min(max([0.0, *shares]), KINKED) if "gas" in scene.table else 0.0


def _judge_value(verdict: Verdict, result: Any, scene: Any, value: float, reading: float, floor: float) -> None:
    """Check objective and limits of the final design."""
    away = abs(scene.objective - value)
    if away > (reading + 1.5 * result.error_estimate) * max(value, scene.objective) + floor:
        verdict.wrong.append(
            f"value {value:.9g} is {scene.objective:.9g}, {away / max(value, floor):.2e} off, "
            f"error estimate {result.error_estimate:.1e}"
        )
    for entry, limit, recomputed in _limits_read(result, scene):
        allowed = (10 * reading + 1.5 * limit.error_estimate) * max(
            recomputed, 1e-6 * number(entry.get("max", entry.get("min")))
        )
        if abs(recomputed - limit.value) > allowed:
            verdict.wrong.append(
                f"limit {limit.name} is said to be {limit.value:.9g} and is {recomputed:.9g}, "
                f"error estimate {limit.error_estimate:.1e}"
            )


def _rival(
    openings: Openings, vector: np.ndarray, star: Table, value: float, rng: np.random.Generator, maximum: int
) -> Rival | None:
    target = value * (1.0 - 0.2 * GAP)
    optional = any(shaft.get("optional") for shaft in openings.table.get("balancer_shafts", []))
    if optional or (openings.numbers and openings.table["engine"].get("throws") == "open"):
        return best_of_choices(openings.table, rng, (vector, star), 100 * maximum, target)
    if openings.numbers:
        return local_rival(openings, rng, [vector], 100 * maximum, star)
    if openings.table["engine"].get("throws") == "open":
        return best_star(openings, 10 * maximum, target)
    return convex_rival(openings, vector, star, target)


def _judge_infeasible(verdict: Verdict, openings: Openings, rng: np.random.Generator, maximum: int) -> None:
    """Check that no design keeps every limit of an infeasible result."""
    if openings.numbers:
        rival = local_rival(openings, rng, [openings.nearest(np.zeros(openings.size))], 100 * maximum)
    else:
        rival = least_broken(openings, 10 * maximum)
    if rival is None:
        return
    verdict.rivals = rival.looked_at
    spare = -openings.scene(rival.vector, rival.star).worst
    if spare > SPARE:
        verdict.wrong.append(f"{verdict.status}, but a rival keeps every limit with {spare:.2e} to spare")
