"""What a page is answered, worked out in a process of its own: an optimum that follows, then the proven one."""

from __future__ import annotations

import base64
import hashlib
import json
import math
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from functools import lru_cache
from itertools import islice
from pathlib import Path
from typing import Any

from laufruhe.errors import Complaint, InputError, LaufruheError, ModelError, SolverError
from laufruhe.files import edits
from laufruhe.files.complaints import Refused
from laufruhe.files.reader import load_tables
from laufruhe.files.toml_text import toml_text
from laufruhe.live import live_model
from laufruhe.present.numbers import figure
from laufruhe.present.pictures import PICTURES
from laufruhe.problem.measure import Limit
from laufruhe.problem.problem import Problem
from laufruhe.problem.tolerance import NO_TOLERANCES
from laufruhe.prove.certificate import Reach
from laufruhe.server import told
from laufruhe.server.asked import CRANK, Asked, Edit
from laufruhe.server.controls import as_json, controls_of, offered_by, typed
from laufruhe.server.drawing import drawing_of
from laufruhe.server.front import Front, partners, places
from laufruhe.server.held import held_by, ranking_of
from laufruhe.solvers import solve, state
from laufruhe.solvers.conclusion import Shown, concluded, decision_values, judged, limit_values
from laufruhe.solvers.following import Followed, Follower, can_follow
from laufruhe.solvers.result import LimitValue, Result
from laufruhe.units import readable

_SIDES = ("max", "min", "outside")
_KEPT_SCENES = 6
ROUNDING = 1e-5
"""Share of the objective that a program at few angles does not tell from nothing."""


@dataclass(frozen=True)
class Source:
    """The problem's file as it was last read."""

    tables: Mapping[str, Any]
    path: Path


class Scene:
    """A problem but for its limits: what is drawn of it, and what follows a limit that slides.

    Where something is open that loads are not affine in, it stays as given.
    """

    def __init__(self, problem: Problem, key: str) -> None:
        self.key, self.whole = key, problem
        self.problem = problem if can_follow(problem) else replace(
            problem, phasing=None, over=None, assembly=None, tolerances=NO_TOLERANCES, decisions=problem.unbalances
        )  # fmt: skip
        self.given = state(self.problem, to_start_from=True)
        self.follower: Follower | None = None
        if can_follow(self.problem) and not self.given.final.resonance:
            try:
                self.follower = Follower(self.problem)
            except ModelError:
                # an engine on mounts in time has no loads that are affine in anything
                self.follower = None

    def drawn(self, found: Followed | None) -> dict[str, Any]:
        """What the page draws from, with the optimum where it is known; why there is nothing to slide else."""
        result = self.given
        if found is not None and not found.conflict:
            shown = Shown(found.bound, Reach.WHOLE, 0.0, "second-order cones at few angles")
            result = concluded(judged(self.problem, found.values), self.given.final, shown, {})
        model = live_model(self.whole, result)
        about = {"engine": drawing_of(self.problem), "partners": list(partners(self.problem))}
        return {**about, "unshown": model.why_not} if model.why_not else {**about, "model": model.as_json()}


_scenes: dict[str, Scene] = {}
_fronts: dict[str, object] = {}
_solved: dict[str, Result] = {}


def _scene(problem: Problem, key: str) -> Scene:
    if key not in _scenes:
        while len(_scenes) >= _KEPT_SCENES:
            _scenes.pop(next(iter(_scenes)))
        _scenes[key] = Scene(problem, key)
    return _scenes[key]


def _key(tables: Mapping[str, Any]) -> str:
    """Of all but where limits stand."""
    limits = [{k: v for k, v in entry.items() if k not in _SIDES} for entry in tables.get("constraints", [])]
    text = json.dumps({**tables, "constraints": limits}, sort_keys=True, default=str)
    return hashlib.sha256(text.encode()).hexdigest()[:16]


@lru_cache(maxsize=4)
def _offered(text: str, path: Path) -> tuple[str, ...]:
    tables = json.loads(text)
    return tuple(offered_by(tables, load_tables(tables, path)))


def _asked_about(source: Source, asked: Asked, with_held: bool) -> tuple[dict[str, Any], Problem]:
    """Tables and problem of a request, through the same reading as files (`InputError`)."""
    try:
        asked.check(_offered(json.dumps(source.tables, default=str), source.path))
        tables = asked.tables(source.tables, with_held)
    except Refused as refused:
        raise InputError(source.path.name, (refused.complaint,)) from None
    return tables, load_tables(tables, Path(source.path))


def _said(work: Callable[[], dict[str, Any]], source: Source) -> str:
    """An answer as JSON, or the line that says why there is none."""
    try:
        found = work()
    except InputError as error:
        found = {"error": str(error)}
    except ModelError as error:
        found = {"error": str(InputError(source.path.name, (Complaint.of(error, error.where or "problem"),)))}
    except (SolverError, LaufruheError) as error:
        found = {"error": f"{source.path.name}: {error}"}
    except MemoryError:
        found = {"error": f"{source.path.name}: needs more memory than there is"}
    return told.as_text(found)


def begin(source: Source) -> str:
    """What the page may change, and what the problem is."""

    def found() -> dict[str, Any]:
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

    return _said(found, source)


def _opens(source: Source) -> bool:
    """Whether the crank may be left open."""
    try:
        load_tables(Edit("open crank", CRANK, 1)(source.tables), source.path)
    except LaufruheError:
        return False
    return True


def follow(source: Source, asked: Asked) -> str:
    """The optimum of what loads are affine in, all else as it stands, in milliseconds."""

    def found() -> dict[str, Any]:
        began = time.perf_counter()
        tables, problem = _asked_about(source, asked, with_held=True)
        scene = _scene(problem, _key(tables))
        follows = scene.follower.at(problem.limits) if scene.follower else None
        own: dict[str, Any] = {"key": scene.key, "stage": "following" if follows else "given"}
        if asked.has != scene.key:
            own |= scene.drawn(follows)
        if follows is None:
            standing = () if scene.given.final.resonance else limit_values(problem, scene.given.final)
            own |= {"optimum": None, "limits": told.limits(standing, problem)}
            if scene.given.objective:
                own["given"] = told.figures(scene.given.objective.value, problem)
        else:
            own |= _followed(follows, problem, scene)
        return {**own, "milliseconds": 1e3 * (time.perf_counter() - began)}

    return _said(found, source)


def _followed(found: Followed, problem: Problem, scene: Scene) -> dict[str, Any]:
    given = scene.given.final
    if found.conflict:
        standing = told.limits(limit_values(problem, given), problem)
        return {"optimum": None, "conflict": list(found.conflict), "limits": standing}
    limits = [
        LimitValue(x.name, value, x.maximum, x.measure.unit, *_price(x, price, found))
        if x.maximum < math.inf and math.isfinite(value)
        else limit_values(problem.changed(limits=(x,)), given)[0]
        for x, value, price in zip(problem.limits, found.standing, found.prices, strict=True)
    ]
    proof = "global" if found.gap <= problem.tolerance else "global within gap"
    own = told.optimum(scene.problem, found.values, found.value, found.bound, found.gap, proof)
    return {"optimum": own, "limits": told.limits(limits, problem)}


def _price(limit: Limit, price: float, found: Followed) -> tuple[bool, float]:
    """Whether a limit is active, and its price: one that would not move the objective by its rounding is none."""
    active = price * limit.maximum > ROUNDING * found.value
    return active, price if active else 0.0


def settle(source: Source, asked: Asked, seconds: float) -> str:
    """The whole problem, solved and proven as `laufruhe solve` does."""

    def found() -> dict[str, Any]:
        began = time.perf_counter()
        tables, problem = _asked_about(source, asked, with_held=False)
        try:
            result = solve(replace(problem, sharply=True), time_limit=seconds)
        except SolverError as error:
            return {"error": f"{source.path.name}: {error}"}
        _solved.clear()
        _solved[_state(asked)] = result
        return {**_settled(result, tables), "seconds": time.perf_counter() - began}

    return _said(found, source)


def _state(asked: Asked) -> str:
    return repr(asked.edits)


def picture(source: Source, asked: Asked, k: int) -> str:
    """A picture of what was solved last, as its report has it; nothing where there is none any more."""

    def found() -> dict[str, Any]:
        from laufruhe import plots
        from laufruhe.plots.style import as_svg

        result = _solved.get(_state(asked))
        names = [] if result is None else plots.names(result)
        if result is None or k >= len(names):
            return {"done": True}
        svg = as_svg(plots.figure(result, names[k]))
        data = base64.b64encode(svg.encode()).decode()
        caption = PICTURES[names[k]]
        return {"name": names[k], "caption": caption, "image": f"data:image/svg+xml;base64,{data}", "of": len(names)}

    return _said(found, source)


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
        "held": held_by(result, tables),
    }
    if result.objective is not None and own is not None:
        found["optimum"] = {
            **told.optimum(problem, (), result.objective.value, own.lower_bound, own.gap, str(own.kind)),
            "design": {entry.name: entry.value for entry in result.decisions},
            "method": own.method,
        }
    return found


def _front(source: Source, asked: Asked, across: str) -> Front:
    tables, whole = _asked_about(source, asked, with_held=True)
    problem = replace(_scene(whole, _key(tables)).problem, limits=whole.limits)
    limits = tuple((limit.name, limit.maximum) for limit in problem.limits)
    key = f"{_key(tables)} {across} {limits}"
    if _fronts.get("key") != key:
        own = partners(problem)
        if across not in own:
            raise InputError(source.path.name, (Complaint("front", across, "is no measure of this problem"),))
        _fronts.clear()
        _fronts.update(key=key, front=Front(problem, own[across]))
    found = _fronts["front"]
    assert isinstance(found, Front)
    return found


def front(source: Source, asked: Asked, across: str, k: int) -> str:
    """A point of the front against another measure; nothing where there is none any more."""

    def found() -> dict[str, Any]:
        own = _front(source, asked, across)
        most = next(islice(places(*own.ends()), k, None), None)
        if most is None:
            return {"done": True}
        point = own.at(most)
        if point is None:
            return {"skipped": True}
        problem, unit = own.problem, own.across.unit
        (shown_unit, factor), (of_unit, of_factor) = readable(unit), readable(problem.objective_unit or "")
        axes = {"across": [shown_unit, factor], "value": [of_unit, of_factor]}
        shown = told.optimum(problem, point.followed.values, point.value, point.bound, point.followed.gap, "")
        return {**shown, "across": point.across, "axes": axes, "acrossText": figure(point.across, unit)}

    return _said(found, source)


def save(source: Source, asked: Asked) -> str:
    """The whole state as a problem file: what was changed and is held, and the design where what is open starts."""

    def found() -> dict[str, Any]:
        tables, problem = _asked_about(source, asked, with_held=True)
        units = {e.name: e.unit for d in problem.decisions for e in decision_values(d, d.start)}
        try:
            for name, value in asked.design.items():
                if name in units:
                    unit, factor = typed(units[name])
                    text = f"{factor * value!r} {unit}".rstrip()
                    tables = edits.with_value(tables, name, text if unit else factor * value)
        except Refused as refused:
            raise InputError(source.path.name, (refused.complaint,)) from None
        load_tables(tables, source.path)
        return {"toml": toml_text(tables), "file": f"{source.path.stem}-page.toml"}

    return _said(found, source)
