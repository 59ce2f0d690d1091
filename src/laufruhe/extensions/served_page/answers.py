"""What a page is answered, worked out in a process of its own: an optimum that follows, then the proven one."""

from __future__ import annotations

import json
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from functools import lru_cache, wraps
from itertools import islice
from pathlib import Path
from typing import Any, Concatenate, ParamSpec

from laufruhe.errors import Complaint, InputError, LaufruheError, ModelError, SolverError, refused
from laufruhe.extensions.served_page import told
from laufruhe.extensions.served_page.asked import CRANK, LATER, STAR, Asked, Edit
from laufruhe.extensions.served_page.claims import (
    Simpler,
    breaks_words,
    conflict_claim,
    given_claim,
    preview_claim,
    settled_claim,
)
from laufruhe.extensions.served_page.controls import as_json, as_typed, controls_of, offered_by
from laufruhe.extensions.served_page.front import Front, partners, places
from laufruhe.extensions.served_page.held import held_by, ranking_of
from laufruhe.extensions.served_page.scenes import scene_of
from laufruhe.files import edits
from laufruhe.files.complaints import in_file
from laufruhe.files.reader import load_tables
from laufruhe.files.toml_text import toml_text
from laufruhe.live import decided
from laufruhe.present.numbers import figure
from laufruhe.present.pictures import PICTURES
from laufruhe.problem.decision import Kind
from laufruhe.problem.evaluation import evaluate, objective_value
from laufruhe.problem.problem import Problem
from laufruhe.report.web_page import inlined
from laufruhe.solvers import solve
from laufruhe.solvers.conclusion import decision_values, limit_values
from laufruhe.solvers.result import Result
from laufruhe.units import readable

P = ParamSpec("P")


@dataclass(frozen=True)
class Source:
    """The problem's file as it was last read.

    Attributes
    ----------
    content
        Hash of the files that it names.
    """

    tables: Mapping[str, Any]
    path: Path
    content: str = ""


_fronts: dict[str, object] = {}
_solved: dict[str, Result] = {}


@lru_cache(maxsize=4)
def _as_filed(text: str, path: Path) -> tuple[tuple[str, ...], dict[str, Kind]]:
    """Return the names that a page is offered, and the kinds of the open numbers, as the file has them."""
    tables = json.loads(text)
    problem = load_tables(tables, path)
    return tuple(offered_by(tables, problem)), {decision.name: decision.kind for decision in problem.decisions}


def _of_file(source: Source) -> tuple[tuple[str, ...], dict[str, Kind]]:
    return _as_filed(json.dumps(source.tables, default=str), source.path)


def _held_kinds(source: Source, asked: Asked) -> set[Kind]:
    """Return the kinds of open numbers that the page holds as they were decided."""
    _, kinds = _of_file(source)
    return {Kind.STAR if edit.name == STAR else kinds[edit.name] for edit in asked.held}


def _asked_about(source: Source, asked: Asked, with_held: bool) -> tuple[dict[str, Any], Problem]:
    """Tables and problem of a request, through the same reading as files (`InputError`)."""
    with in_file(source.path.name):
        asked.check(_of_file(source)[0])
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
            found = {
                "error": str(InputError(source.path.name, (Complaint.from_error(error, error.where or "problem"),)))
            }
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
        "doubts": [str(doubt) for doubt in problem.plausibility_warnings],
    }


def _opens(source: Source) -> bool:
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
    scene = scene_of(problem, tables, source.content)
    found = scene.follower.at(problem.limits) if scene.follower else None
    design, simpler = scene.evaluated(found), scene.simpler(_held_kinds(source, asked))
    limits = scene.standing(problem.limits, design, found)
    value = objective_value(scene.problem, design) if scene.problem.objective else None
    if found is None:
        claim = given_claim(asked.position, scene.problem, value, limits)
    elif found.conflict:
        claim = conflict_claim(asked.position, found.conflict, simpler)
    else:
        assert value is not None
        claim = preview_claim(asked.position, scene.problem, value, simpler, limits)
    decided = found is not None and not found.conflict
    own: dict[str, Any] = {
        **told.answer(claim, limits, problem, found.conflict if found else ()),
        "key": scene.key,
        "design": told.design(scene.problem, found.values) if found is not None and decided else None,
    }
    if asked.has not in (scene.key, LATER):
        own |= scene.drawn(problem.limits, design, found)
    took = {"wall": time.perf_counter() - began, "processor": time.process_time() - spent}
    return {**own, "seconds": took}


@_said
def measure(source: Source, asked: Asked) -> dict[str, Any]:
    """The design that is shown by the exact model: objective and limits, those too that do not follow sliders."""
    tables, whole = _asked_about(source, asked, with_held=True)
    problem = replace(scene_of(whole, tables, source.content).problem, limits=whole.limits)
    values = decided(problem, asked.design)
    evaluation = evaluate(problem.fixed_at([values[decision.name] for decision in problem.decisions]))
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
    _solved[_state(source, asked)] = result
    return {**_settled(result, tables, asked.position), "seconds": time.perf_counter() - began}


def _state(source: Source, asked: Asked) -> str:
    return repr((source.content, source.tables, asked.edits))


@_said
def picture(source: Source, asked: Asked, k: int) -> dict[str, Any]:
    """A picture of what was solved last, as its report has it; nothing where there is none any more."""
    from laufruhe import plots
    from laufruhe.plots.style import as_svg

    result = _solved.get(_state(source, asked))
    names = [] if result is None else plots.names(result)
    if result is None or k >= len(names):
        return {"done": True}
    image = inlined(as_svg(plots.figure(result, names[k])))
    return {"name": names[k], "caption": PICTURES[names[k]].caption, "image": image, "of": len(names)}


def _settled(result: Result, tables: Mapping[str, Any], position: int) -> dict[str, Any]:
    has_design = result.status.has_design
    claim = settled_claim(position, result)
    return {
        **told.answer(claim, result.limits, result.problem, result.conflict),
        "design": {entry.name: entry.value for entry in result.decisions} if has_design else None,
        "ranking": ranking_of(result),
        "holds": held_by(result, tables),
    }


def _front(source: Source, asked: Asked, across: str) -> tuple[Front, Simpler]:
    tables, whole = _asked_about(source, asked, with_held=True)
    scene = scene_of(whole, tables, source.content)
    problem = replace(scene.problem, limits=whole.limits)
    edges = [(limit.name, limit.minimum, limit.maximum, limit.outside) for limit in problem.limits]
    key = f"{scene.key} {across} {edges}"
    if _fronts.get("key") != key:
        own = partners(problem)
        if across not in own:
            raise refused("front", across, "is no measure of this problem", "", source.path.name)
        _fronts.clear()
        _fronts.update(key=key, front=Front(problem, own[across]))
    found = _fronts["front"]
    assert isinstance(found, Front)
    return found, scene.simpler(_held_kinds(source, asked))


@_said
def front(source: Source, asked: Asked, across: str, k: int) -> dict[str, Any]:
    """A point of the front against another measure; nothing where there is none any more."""
    own, simpler = _front(source, asked, across)
    most = next(islice(places(*own.ends()), k, None), None)
    if most is None:
        return {"done": True}
    point = own.at(most)
    if point.conflict:
        return {"skipped": True}
    problem, unit = own.problem, own.across.unit
    design = evaluate(problem.fixed_at(point.values))
    (shown_unit, factor), (of_unit, of_factor) = readable(unit), readable(problem.objective_unit or "")
    # a bound of a simpler problem is none of the whole one
    bound = None if simpler else {"at": most, "value": point.bound}
    place, value = design.value(own.across), objective_value(problem, design)
    text = f"{figure(place, unit)}: {figure(value, problem.objective_unit or '')}"
    least = f"; no design has less than {figure(point.bound, problem.objective_unit or '')}" if bound else ""
    # limits on numbers are not asked of a front
    breaks = breaks_words(limit_values(replace(problem, limits=own.others), design))
    return {
        "across": place,
        "value": value,
        "bound": bound,
        "design": told.design(problem, point.values),
        "axes": {"across": [shown_unit, factor], "value": [of_unit, of_factor]},
        "name": problem.objective_name,
        "words": "; ".join(part for part in (f"{text}{least}", breaks) if part),
        "simpler": simpler.phrase,
    }


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
