"""Answers to a page's requests, computed in worker processes: fast optimum, then proven optimum."""

from __future__ import annotations

import json
import time
from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass, replace
from functools import lru_cache, wraps
from itertools import islice
from pathlib import Path
from typing import Any, Concatenate, ParamSpec

from laufruhe.errors import Complaint, InputError, LaufruheError, ModelError, refused
from laufruhe.extensions.served_page import serialise
from laufruhe.extensions.served_page.claims import (
    Simplification,
    breaks_words,
    conflict_claim,
    initial_claim,
    preview_claim,
    settled_claim,
)
from laufruhe.extensions.served_page.controls import as_typed, controls_of, offered_by
from laufruhe.extensions.served_page.live import decided
from laufruhe.extensions.served_page.page_problem import page_problem_of
from laufruhe.extensions.served_page.page_state import CRANK, LATER, STAR, Edit, PageState
from laufruhe.extensions.served_page.pareto import ParetoFront, partners, places
from laufruhe.files import edits
from laufruhe.files.complaints import errors_in_file
from laufruhe.files.reader import load_tables
from laufruhe.files.toml_text import toml_text
from laufruhe.present.numbers import figure
from laufruhe.present.pictures import PICTURES
from laufruhe.problem.decision import Kind
from laufruhe.problem.evaluation import evaluate, objective_value
from laufruhe.problem.problem import Problem
from laufruhe.report.web_page import data_address
from laufruhe.solvers import solve
from laufruhe.solvers.conclusion import decision_values, limit_values
from laufruhe.solvers.result import Result
from laufruhe.units import readable

P = ParamSpec("P")


@dataclass(frozen=True)
class Source:
    """Tables of the problem file as last read, and a hash of the content of the files that it names."""

    tables: Mapping[str, Any]
    path: Path
    content: str = ""


_fronts: dict[str, ParetoFront] = {}
_solved: dict[str, Result] = {}


@lru_cache(maxsize=4)
def _as_filed(text: str, path: Path) -> tuple[tuple[str, ...], dict[str, Kind]]:
    tables = json.loads(text)
    problem = load_tables(tables, path)
    return tuple(offered_by(tables, problem)), {decision.name: decision.kind for decision in problem.decisions}


def _names_and_kinds(source: Source) -> tuple[tuple[str, ...], dict[str, Kind]]:
    return _as_filed(json.dumps(source.tables, default=str), source.path)


def _held_kinds(source: Source, state: PageState) -> set[Kind]:
    _, kinds = _names_and_kinds(source)
    return {Kind.STAR if edit.name == STAR else kinds[edit.name] for edit in state.fixed}


def _requested(source: Source, state: PageState, with_fixed: bool) -> tuple[dict[str, Any], Problem]:
    with errors_in_file(source.path.name):
        state.check(_names_and_kinds(source)[0])
        tables = state.tables(source.tables, with_fixed)
    return tables, load_tables(tables, Path(source.path))


def _answered(work: Callable[Concatenate[Source, P], dict[str, Any]]) -> Callable[Concatenate[Source, P], str]:
    """Return `work` as a function that gives its result, or its error, as JSON."""

    @wraps(work)
    def answered(source: Source, /, *args: P.args, **kwargs: P.kwargs) -> str:
        try:
            answer = work(source, *args, **kwargs)
        except InputError as error:
            answer = {"error": str(error)}
        except ModelError as error:
            complaint = Complaint.from_error(error, error.where or "problem")
            answer = {"error": str(InputError(source.path.name, (complaint,)))}
        except LaufruheError as error:
            answer = {"error": f"{source.path.name}: {error}"}
        except MemoryError:
            answer = {"error": f"{source.path.name}: needs more memory than there is"}
        return serialise.as_text(answer)

    return answered


@_answered
def begin(source: Source) -> dict[str, Any]:
    """Return the problem and the controls of its page."""
    problem = load_tables(source.tables, source.path)
    try:
        load_tables(Edit("open crank", CRANK, 1)(source.tables), source.path)
        can_open_crank = True
    except LaufruheError:
        can_open_crank = False
    return {
        "title": problem.title,
        "file": source.path.name,
        "summary": problem.summary,
        "controls": [{**asdict(control), "step": control.step} for control in controls_of(source.tables, problem)],
        "objectives": [rank.terms[0].measure.name for rank in problem.ranks],
        "crank": can_open_crank,
        "openCrank": problem.phasing is not None,
        "doubts": [str(warning) for warning in problem.plausibility_warnings],
    }


@_answered
def follow(source: Source, state: PageState) -> dict[str, Any]:
    """Return the optimum of the unbalances and other affine decisions, all others fixed, within milliseconds."""
    began, spent = time.perf_counter(), time.process_time()
    tables, problem = _requested(source, state, with_fixed=True)
    page_problem = page_problem_of(problem, tables, source.content)
    followed = page_problem.follower.at(problem.limits) if page_problem.follower else None
    design, simpler = page_problem.evaluated(followed), page_problem.simpler(_held_kinds(source, state))
    limits = page_problem.standing(problem.limits, design, followed)
    value = objective_value(page_problem.problem, design) if page_problem.problem.objective else None
    if followed is None:
        claim = initial_claim(state.position, page_problem.problem, value, limits)
    elif followed.conflict:
        claim = conflict_claim(state.position, followed.conflict, simpler)
    else:
        assert value is not None
        claim = preview_claim(state.position, page_problem.problem, value, simpler, limits)
    answer: dict[str, Any] = {
        **serialise.answer(claim, limits, problem, followed.conflict if followed else ()),
        "key": page_problem.key,
        "design": serialise.design(page_problem.problem, followed.values)
        if followed and not followed.conflict
        else None,
    }
    if state.has not in (page_problem.key, LATER):
        answer |= page_problem.drawn(problem.limits, design, followed)
    took = {"wall": time.perf_counter() - began, "processor": time.process_time() - spent}
    return {**answer, "seconds": took}


@_answered
def measure(source: Source, state: PageState) -> dict[str, Any]:
    """Return the exact evaluation of the design that the page displays."""
    tables, whole_problem = _requested(source, state, with_fixed=True)
    problem = replace(page_problem_of(whole_problem, tables, source.content).problem, limits=whole_problem.limits)
    values = decided(problem, state.design)
    evaluation = evaluate(problem.fixed_at([values[decision.name] for decision in problem.decisions]))
    limits = {limit.name: limit.value for limit in limit_values(problem, evaluation)}
    return {"objective": objective_value(problem, evaluation) if problem.objective else None, "limits": limits}


@_answered
def settle(source: Source, state: PageState, seconds: float) -> dict[str, Any]:
    """Return the proven optimum of the whole problem, as `laufruhe solve` computes it."""
    began = time.perf_counter()
    tables, problem = _requested(source, state, with_fixed=False)
    result = solve(problem, time_limit=seconds)
    _solved.clear()
    _solved[_solution_key(source, state)] = result
    claim = settled_claim(state.position, result)
    return {
        **serialise.answer(claim, result.limits, result.problem, result.conflict),
        "design": {entry.name: entry.value for entry in result.decisions} if result.status.has_design else None,
        "ranking": serialise.ranking_of(result),
        "holds": serialise.fixing_edits(result, tables),
        "seconds": time.perf_counter() - began,
    }


def _solution_key(source: Source, state: PageState) -> str:
    return repr((source.content, source.tables, state.edits))


@_answered
def picture(source: Source, state: PageState, k: int) -> dict[str, Any]:
    """Return picture k of the last solution; {"done": True} if there is none."""
    from laufruhe import plots
    from laufruhe.plots.style import as_svg

    result = _solved.get(_solution_key(source, state))
    names = [] if result is None else plots.names(result)
    if result is None or k >= len(names):
        return {"done": True}
    image = data_address(as_svg(plots.figure(result, names[k])))
    return {"name": names[k], "caption": PICTURES[names[k]].caption, "image": image, "of": len(names)}


def _front(source: Source, state: PageState, across: str) -> tuple[ParetoFront, Simplification]:
    tables, whole_problem = _requested(source, state, with_fixed=True)
    page_problem = page_problem_of(whole_problem, tables, source.content)
    problem = replace(page_problem.problem, limits=whole_problem.limits)
    edges = [(limit.name, limit.minimum, limit.maximum, limit.outside) for limit in problem.limits]
    key = f"{page_problem.key} {across} {edges}"
    if key not in _fronts:
        measures = partners(problem)
        if across not in measures:
            raise refused("front", across, "is not the name of a measure of this problem", "", source.path.name)
        _fronts.clear()
        _fronts[key] = ParetoFront(problem, measures[across])
    return _fronts[key], page_problem.simpler(_held_kinds(source, state))


@_answered
def front(source: Source, state: PageState, across: str, k: int) -> dict[str, Any]:
    """Return point k of the Pareto front against the measure `across`; {"done": True} after the last."""
    pareto, simpler = _front(source, state, across)
    maximum = next(islice(places(*pareto.ends()), k, None), None)
    if maximum is None:
        return {"done": True}
    point = pareto.at(maximum)
    if point.conflict:
        return {"skipped": True}
    problem, unit = pareto.problem, pareto.across.unit
    design = evaluate(problem.fixed_at(point.values))
    (shown_unit, factor), (of_unit, of_factor) = readable(unit), readable(problem.objective_unit or "")
    # a bound of a simplified problem does not hold for the whole problem
    bound = None if simpler else {"at": maximum, "value": point.bound}
    place, value = design.value(pareto.across), objective_value(problem, design)
    text = f"{figure(place, unit)}: {figure(value, problem.objective_unit or '')}"
    minimum = f"; no design has less than {figure(point.bound, problem.objective_unit or '')}" if bound else ""
    # limits on numbers are not part of a front
    breaks = breaks_words(limit_values(replace(problem, limits=pareto.others), design))
    return {
        "across": place,
        "value": value,
        "bound": bound,
        "design": serialise.design(problem, point.values),
        "axes": {"across": [shown_unit, factor], "value": [of_unit, of_factor]},
        "name": problem.objective_name,
        "words": "; ".join(part for part in (f"{text}{minimum}", breaks) if part),
        "simpler": simpler.phrase,
    }


@_answered
def save(source: Source, state: PageState) -> dict[str, Any]:
    """Return the present design and edits of the page as the text of a problem file."""
    tables, problem = _requested(source, state, with_fixed=True)
    units = {e.name: e.unit for d in problem.decisions for e in decision_values(d, d.start)}
    with errors_in_file(source.path.name):
        for name, value in state.design.items():
            if name in units:
                tables = edits.with_value(tables, name, as_typed(value, units[name]))
    load_tables(tables, source.path)
    return {"toml": toml_text(tables), "file": f"{source.path.stem}-page.toml"}
