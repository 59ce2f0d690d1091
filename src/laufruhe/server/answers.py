"""What a page is answered, worked out in a process of its own: an optimum that follows, then the proven one."""

from __future__ import annotations

import json
import math
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from functools import lru_cache, wraps
from itertools import islice
from pathlib import Path
from typing import Any, Concatenate, ParamSpec

from laufruhe.errors import Complaint, InputError, LaufruheError, ModelError, SolverError, refused
from laufruhe.files import edits
from laufruhe.files.complaints import in_file
from laufruhe.files.reader import load_tables
from laufruhe.files.toml_text import toml_text
from laufruhe.live import decided
from laufruhe.present.numbers import figure
from laufruhe.present.pictures import PICTURES
from laufruhe.problem.dependence import depends
from laufruhe.problem.evaluation import evaluate, objective_value
from laufruhe.problem.measure import Limit
from laufruhe.problem.problem import Problem
from laufruhe.prove.certificate import Proof
from laufruhe.report.web_page import inlined
from laufruhe.server import told
from laufruhe.server.asked import CRANK, LATER, Asked, Edit
from laufruhe.server.controls import as_json, as_typed, controls_of, offered_by
from laufruhe.server.front import Front, partners, places
from laufruhe.server.held import held_by, ranking_of
from laufruhe.server.scenes import Scene, key_of, scene_of
from laufruhe.solvers import kinds_of, solve
from laufruhe.solvers.conclusion import decision_values, limit_values
from laufruhe.solvers.following import Followed
from laufruhe.solvers.result import Result
from laufruhe.solvers.values import LimitValue
from laufruhe.units import readable

P = ParamSpec("P")

ROUNDING = 1e-5
"""Share of the objective that a program at few angles does not tell from nothing."""


@dataclass(frozen=True)
class Source:
    """The problem's file as it was last read."""

    tables: Mapping[str, Any]
    path: Path


_fronts: dict[str, object] = {}
_solved: dict[str, Result] = {}


@lru_cache(maxsize=4)
def _offered(text: str, path: Path) -> tuple[str, ...]:
    tables = json.loads(text)
    return tuple(offered_by(tables, load_tables(tables, path)))


def _asked_about(source: Source, asked: Asked, with_held: bool) -> tuple[dict[str, Any], Problem]:
    """Tables and problem of a request, through the same reading as files (`InputError`)."""
    with in_file(source.path.name):
        asked.check(_offered(json.dumps(source.tables, default=str), source.path))
        tables = asked.tables(source.tables, with_held)
    return tables, load_tables(tables, Path(source.path))


def _said(work: Callable[Concatenate[Source, P], dict[str, Any]]) -> Callable[Concatenate[Source, P], str]:
    """An answer as JSON, or the line that says why there is none."""

    @wraps(work)
    def said(source: Source, /, *args: P.args, **kwargs: P.kwargs) -> str:
        try:
            found = work(source, *args, **kwargs)
        except InputError as error:
            found = {"error": str(error)}
        except ModelError as error:
            found = {"error": str(InputError(source.path.name, (Complaint.of(error, error.where or "problem"),)))}
        except (SolverError, LaufruheError) as error:
            found = {"error": f"{source.path.name}: {error}"}
        except MemoryError:
            found = {"error": f"{source.path.name}: needs more memory than there is"}
        return told.as_text(found)

    return said


@_said
def begin(source: Source) -> dict[str, Any]:
    """What the page may change, and what the problem is."""
    problem = load_tables(source.tables, source.path)
    ranks = [rank.terms[0].measure.name for rank in problem.ranks]
    return {
        "title": problem.title,
        "file": source.path.name,
        "summary": problem.summary,
        "controls": as_json(controls_of(source.tables, problem)),
        "objectives": ranks,
        "crank": _opens(source),
        "openCrank": problem.phasing is not None,
        "doubts": [str(doubt) for doubt in problem.doubts],
    }


def _opens(source: Source) -> bool:
    """Whether the crank may be left open."""
    try:
        load_tables(Edit("open crank", CRANK, 1)(source.tables), source.path)
    except LaufruheError:
        return False
    return True


@_said
def follow(source: Source, asked: Asked) -> dict[str, Any]:
    """The optimum of what loads are affine in, all else as it stands, in milliseconds."""
    began, spent = time.perf_counter(), time.process_time()
    tables, problem = _asked_about(source, asked, with_held=True)
    scene = scene_of(problem, tables)
    follows = scene.follower.at(problem.limits) if scene.follower else None
    own: dict[str, Any] = {"key": scene.key, "stage": "following" if follows else "given"}
    own["but"] = list(scene.simplified(bool(asked.held)))
    if asked.has not in (scene.key, LATER):
        own |= scene.drawn(follows)
    if follows is None or follows.conflict:
        standing = () if scene.given.resonance else limit_values(problem, scene.given)
        own |= {"optimum": None, "limits": told.limits(standing, problem)}
    if follows is None and scene.value is not None:
        own["given"] = told.figures(scene.value, problem)
    elif follows is not None and follows.conflict:
        own["conflict"] = list(follows.conflict)
    elif follows is not None:
        own |= _followed(follows, problem, scene)
    took = {"wall": time.perf_counter() - began, "processor": time.process_time() - spent}
    return {**own, "seconds": took}


def _followed(found: Followed, problem: Problem, scene: Scene) -> dict[str, Any]:
    limits = [
        _standing(x, value, price, found, scene)
        for x, value, price in zip(problem.limits, found.standing, found.prices, strict=True)
    ]
    # at few angles nothing is proven but the bound
    own = told.optimum(scene.problem, found.values, found.value, found.bound, found.gap, str(Proof.WITHIN_GAP))
    return {"optimum": own, "limits": told.limits(limits, problem)}


def _standing(limit: Limit, value: float, price: float, found: Followed, scene: Scene) -> LimitValue:
    """How a design that follows stands to a limit; no number where only the whole solve tells."""
    if math.isfinite(value) and limit.maximum < math.inf:
        # a price that would not move the objective by its rounding is none
        active = price * limit.maximum > ROUNDING * found.value
        return LimitValue(limit.name, value, limit.maximum, limit.measure.unit, active, price if active else 0.0)
    (given,) = limit_values(scene.problem.changed(limits=(limit,)), scene.given)
    moves = depends(limit.measure.channel, kinds_of(scene.problem), scene.problem)
    return replace(given, value=math.nan, active=False, shadow_price=math.nan) if moves else given


@_said
def measure(source: Source, asked: Asked) -> dict[str, Any]:
    """The design that is shown by the exact model: objective and limits, those too that do not follow sliders."""
    tables, whole = _asked_about(source, asked, with_held=True)
    problem = replace(scene_of(whole, tables).problem, limits=whole.limits)
    values = decided(problem, asked.design)
    evaluation = evaluate(problem.held([values[decision.name] for decision in problem.decisions]))
    limits = {limit.name: limit.value for limit in limit_values(problem, evaluation)}
    return {"objective": objective_value(problem, evaluation) if problem.objective else None, "limits": limits}


@_said
def settle(source: Source, asked: Asked, seconds: float) -> dict[str, Any]:
    """The whole problem, solved and proven as `laufruhe solve` does."""
    began = time.perf_counter()
    tables, problem = _asked_about(source, asked, with_held=False)
    try:
        result = solve(replace(problem, sharply=True), time_limit=seconds)
    except SolverError as error:
        return {"error": f"{source.path.name}: {error}"}
    _solved.clear()
    _solved[_state(asked)] = result
    return {**_settled(result, tables), "seconds": time.perf_counter() - began}


def _state(asked: Asked) -> str:
    return repr(asked.edits)


@_said
def picture(_: Source, asked: Asked, k: int) -> dict[str, Any]:
    """A picture of what was solved last, as its report has it; nothing where there is none any more."""
    from laufruhe import plots
    from laufruhe.plots.style import as_svg

    result = _solved.get(_state(asked))
    names = [] if result is None else plots.names(result)
    if result is None or k >= len(names):
        return {"done": True}
    image = inlined(as_svg(plots.figure(result, names[k])))
    return {"name": names[k], "caption": PICTURES[names[k]], "image": image, "of": len(names)}


def _settled(result: Result, tables: Mapping[str, Any]) -> dict[str, Any]:
    problem, own = result.problem, result.certificate
    found: dict[str, Any] = {
        "stage": "settled",
        "status": str(result.status),
        "message": result.message,
        "conflict": list(result.conflict),
        "limits": told.limits(result.limits, problem),
        "optimum": None,
        "ranking": ranking_of(result),
        "holds": held_by(result, tables),
    }
    designed = result.status.has_design
    if designed and result.objective is not None and own is not None:
        found["optimum"] = {
            **told.optimum(problem, (), result.objective.value, own.lower_bound, own.gap, str(own.kind)),
            "design": {entry.name: entry.value for entry in result.decisions},
            "method": own.method,
        }
    return found


def _front(source: Source, asked: Asked, across: str) -> Front:
    tables, whole = _asked_about(source, asked, with_held=True)
    problem = replace(scene_of(whole, tables).problem, limits=whole.limits)
    limits = tuple((limit.name, limit.maximum) for limit in problem.limits)
    key = f"{key_of(tables)} {across} {limits}"
    if _fronts.get("key") != key:
        own = partners(problem)
        if across not in own:
            raise refused("front", across, "is no measure of this problem", "", source.path.name)
        _fronts.clear()
        _fronts.update(key=key, front=Front(problem, own[across]))
    found = _fronts["front"]
    assert isinstance(found, Front)
    return found


@_said
def front(source: Source, asked: Asked, across: str, k: int) -> dict[str, Any]:
    """A point of the front against another measure; nothing where there is none any more."""
    own = _front(source, asked, across)
    most = next(islice(places(*own.ends()), k, None), None)
    if most is None:
        return {"done": True}
    point = own.at(most)
    if point.conflict:
        return {"skipped": True}
    problem, unit = own.problem, own.across.unit
    (shown_unit, factor), (of_unit, of_factor) = readable(unit), readable(problem.objective_unit or "")
    axes = {"across": [shown_unit, factor], "value": [of_unit, of_factor]}
    shown = told.optimum(problem, point.values, point.value, point.bound, point.gap, "")
    return {**shown, "across": point.standing[-1], "axes": axes, "acrossText": figure(point.standing[-1], unit)}


@_said
def save(source: Source, asked: Asked) -> dict[str, Any]:
    """The whole state as a problem file: what was changed and is held, and the design where what is open starts."""
    tables, problem = _asked_about(source, asked, with_held=True)
    units = {e.name: e.unit for d in problem.decisions for e in decision_values(d, d.start)}
    with in_file(source.path.name):
        for name, value in asked.design.items():
            if name in units:
                tables = edits.with_value(tables, name, as_typed(value, units[name]))
    load_tables(tables, source.path)
    return {"toml": toml_text(tables), "file": f"{source.path.stem}-page.toml"}
