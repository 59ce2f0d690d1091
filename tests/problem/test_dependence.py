"""Entries of the table of dependences, sampled on random engines. Samples refute an entry and never prove it.

Engines are the ready ones with random masses, unbalances and speeds; open numbers stand at random places within their
bounds. SMOOTH claims nothing that three samples could refute, and MASSES and SWING follow from AFFINE and SHIFT of
their parts. Stars are drawn from the open throws and firing orders.
"""

from __future__ import annotations

import tomllib
from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import laufruhe
from lanes import first_fast
from laufruhe.errors import LaufruheError, ModelError
from laufruhe.extension import Extension
from laufruhe.problem import dependence as module
from laufruhe.problem.channels import CHANNELS, Channel, LoadChannel, NumberChannel
from laufruhe.problem.decision import KINDS, Decision, Kind, domains_of
from laufruhe.problem.dependence import Dependence, dependence
from laufruhe.problem.evaluation import Evaluation, evaluate
from laufruhe.problem.measure import Measure, mass_rows
from laufruhe.problem.problem import Problem
from laufruhe.solvers.stars.phasing_solver import even_stars
from problem_files import PROBLEMS

ALL_OPEN = Path(__file__).parent / "inputs" / "geared-pair-all-open.toml"
STRONGER = {
    Dependence.AFFINE: [Dependence.NONE],
    Dependence.BIAFFINE: [Dependence.NONE],
    Dependence.KINKED: [Dependence.NONE, Dependence.BIAFFINE],
    Dependence.SHIFT: [Dependence.NONE, Dependence.AFFINE],
    Dependence.SWING: [Dependence.NONE, Dependence.AFFINE],
    Dependence.CONVEX: [Dependence.NONE, Dependence.AFFINE],
    Dependence.MONOTONE_UP: [Dependence.NONE, Dependence.MONOTONE_DOWN],
    Dependence.MONOTONE_DOWN: [Dependence.NONE, Dependence.MONOTONE_UP],
    Dependence.SMOOTH: [Dependence.NONE, Dependence.AFFINE],
}
"""Claims that would prove more than an entry does."""
CONSTANT_HERE = (
    # no weight follows a piston, and cylinders stand upright
    ("none", "piston", "added mass, balancer mass, counterweight mass, hammer blow, surging force, swaying couple"),
    # geared inertia turns, and moves nothing to a side
    (
        "none",
        "share",
        "friction power, hammer blow, main-bearing force, main-bearing pressure, rocking couple, shaking force",
    ),
    ("none", "share", "main-bearing pressure times speed, surging force, swaying couple"),
    ("none", "place", "shaking force, surging force"),
    # pistons share no chamber, so a lead turns all loads of a cylinder alike
    ("none", "lead", "side-force reversal rate"),
    ("affine", "lead", "side-force reversal rate"),
    # the file gives the time of the run-up
    ("none", "flywheel", "run-up force, run-up travel, run-up twist"),
    ("affine", "flywheel", "run-up force, run-up travel, run-up twist"),
    # no static load
    ("none", "stiffness", "static mount force, static travel"),
    ("affine", "stiffness", "static mount force, static travel"),
)
"""Channels of the engine of `ALL_OPEN` that depend on a kind less than others do."""
ROUNDING = 1e-9
STEPS = 60
FEW = (
    "tractor-four-shaft-heights", "powertrain-torque-roll", "single-rod-length", "opposed-pistons-masses",
    "geared-three-leads", "diesel-70-hp-flywheel", "inline-five-generator", "geared-inertia", "tractor-four-elastic",
    "worked-diesel-counterweight",
)  # fmt: skip
"""Ready problems that have nearly every entry that any of them has."""


def _random(problem: Problem, rng: np.random.Generator) -> Problem:
    """Return the problem of an engine of other masses and unbalances, at other speeds."""
    engine = problem.engine
    rotors = tuple(replace(r, unbalance=r.unbalance * complex(*rng.uniform(0.5, 1.5, 2))) for r in engine.rotors)
    points = tuple(replace(point, speed=point.speed * float(rng.uniform(0.7, 1.1))) for point in problem.points)
    fidelity = replace(problem.fidelity, samples=360)
    result = replace(problem, engine=replace(engine, rotors=rotors), points=points, fidelity=fidelity)
    return replace(result, ranks=(), extras=())


def _values(decision: Decision, shares: np.ndarray) -> complex | float:
    """Return the value at these shares of the bounds of a decision."""
    (domain,) = domains_of([decision])
    low, high = domain.ends
    # a sector may be left: brought back into it, a line would bend
    value = domain.complex_value(low + shares[: domain.width] * (high - low))
    return value if decision.is_affine else value.real


def _numbers(channel: Channel, evaluation: Evaluation) -> np.ndarray | None:
    """Return what a channel has of a design, of a load its signals at equal steps; None where it means nothing."""
    try:
        if isinstance(channel, LoadChannel):
            base = evaluation.engine.cycle.base_order
            signals = [signal.with_base(base) for signal in evaluation.signals(channel)]
            return np.concatenate([signal.series.sample(STEPS).ravel() for signal in signals])
        if isinstance(channel, NumberChannel):
            return np.array(channel.values(Measure(channel, frequency=(5.0, 15.0)), evaluation), dtype=float)
        return mass_rows(Measure(channel), evaluation.engine.rotors, evaluation.engine.slider_cranks).vectors.ravel()
    except (LaufruheError, ValueError, TypeError, AttributeError, IndexError):
        return None


def _sampled(problem: Problem, kind: Kind, rng: np.random.Generator) -> tuple[Problem, list[Evaluation]]:
    """Return three designs at equal steps along a random line of the decisions of one kind, all others held."""
    own = tuple(decision for decision in problem.decisions if decision.kind is kind)
    held = [d for d in problem.decisions if d.kind is not kind]
    middle = [_values(d, rng.uniform(0.2, 0.8, 2)) for d in held]
    result = replace(problem, engine=problem.design(middle, held), decisions=own)
    # along one number: two of a kind may be multiplied by each other
    chosen = int(rng.integers(len(own))) if kind not in (Kind.UNBALANCE, Kind.SHARE, Kind.PISTON) else None
    base, step = rng.uniform(0.15, 0.4, (len(own), 2)), rng.uniform(0.1, 0.2, (len(own), 2))
    step = step if chosen is None else np.where(np.arange(len(own))[:, None] == chosen, step, 0.0)
    designs = [[_values(d, b + k * s) for d, b, s in zip(own, base, step, strict=True)] for k in range(3)]
    return result, [evaluate(result, result.design(design)) for design in designs]


def refuted(claim: Dependence, at: Sequence[np.ndarray]) -> bool:
    """Return whether three samples at equal steps refute what is claimed."""
    a, b, c = at
    size = max(float(np.abs(each).max(initial=0.0)) for each in at)
    room = ROUNDING * max(size, 1e-9)
    if claim is Dependence.NONE:
        return bool(np.abs(b - a).max(initial=0.0) > room or np.abs(c - a).max(initial=0.0) > room)
    if claim in (Dependence.AFFINE, Dependence.BIAFFINE):
        return bool(np.abs(a - 2.0 * b + c).max(initial=0.0) > room)
    if claim is Dependence.CONVEX:
        return bool((2.0 * b - a - c).max(initial=0.0) > room)
    if claim is Dependence.MONOTONE_UP:
        return bool(min((b - a).min(initial=0.0), (c - b).min(initial=0.0)) < -room)
    if claim is Dependence.MONOTONE_DOWN:
        return bool(max((b - a).max(initial=0.0), (c - b).max(initial=0.0)) > room)
    return False


def _entries(paths: Sequence[Path], rounds: int) -> Iterator[tuple[str, Channel, Kind, Dependence, list[np.ndarray]]]:
    """Yield samples of every entry that a ready engine has something of."""
    for number, path in enumerate(paths):
        problem = laufruhe.load(path)
        rng = np.random.default_rng(number)
        # the table claims nothing of other numbers of the file
        for kind in sorted({d.kind for d in problem.decisions} - {Kind.NUMBER}):
            for _ in range(rounds):
                try:
                    own, evaluations = _sampled(_random(problem, rng), kind, rng)
                except LaufruheError:
                    continue
                for channel in CHANNELS.values():
                    at = [_numbers(channel, evaluation) for evaluation in evaluations]
                    if all(each is not None and np.all(np.isfinite(each)) for each in at):
                        values = [each for each in at if each is not None]
                        if len({len(each) for each in values}) == 1:
                            yield path.stem, channel, kind, dependence(channel, kind, own), values


def _check(paths: Sequence[Path], rounds: int) -> set[tuple[str, Kind]]:
    """Return the entries that were sampled; fail where one is refuted."""
    seen: set[tuple[str, Kind]] = set()
    wrong = []
    for name, channel, kind, claim, at in _entries(paths, rounds):
        seen.add((channel.name, kind))
        if refuted(claim, at):
            wrong.append(f"{channel} by {kind.name} of {name} is not {claim}")
    assert not wrong, "\n".join(dict.fromkeys(wrong))
    return seen


def _ready() -> list[Path]:
    """Return the ready problems that leave numbers open."""
    texts = {path: path.read_text() for path in sorted(PROBLEMS.glob("*.toml"))}
    return [path for path, text in texts.items() if "study" not in tomllib.loads(text) and "between" in text]


def test_few_engines_refute_no_entry() -> None:
    assert len(_check([PROBLEMS / f"{name}.toml" for name in FEW], 1)) > 380


@pytest.mark.parametrize("rounds", first_fast((1, 2), 0, 0))
@pytest.mark.filterwarnings("ignore:.*encountered in:RuntimeWarning")
def test_no_engine_refutes_an_entry(rounds: int) -> None:
    seen = _check([*_ready(), ALL_OPEN], rounds)
    assert len(seen) > 370
    sampled = {kind for _, kind in seen}
    assert sampled == set(KINDS.values()) - {Kind.STAR, Kind.NUMBER}


@pytest.mark.slow
def test_samples_of_one_engine_refute_most_stronger_claims() -> None:
    """Sample one engine: each stronger claim is refuted but of channels that are constant on it, and no entry is."""
    samples: dict[tuple[str, Kind, Dependence], list[list[np.ndarray]]] = {}
    for _, channel, kind, claim, at in _entries([ALL_OPEN], 6):
        assert not refuted(claim, at), (channel, kind)
        samples.setdefault((channel.name, kind, claim), []).append(at)
    survivors = {
        (name, kind.name, str(stronger))
        for (name, kind, claim), rows in samples.items() for stronger in STRONGER.get(claim, ())
        if not any(refuted(stronger, at) for at in rows)
    }  # fmt: skip
    assert survivors == {(name, kind, str(claim)) for claim, kind, names in CONSTANT_HERE for name in names.split(", ")}


@pytest.mark.parametrize(
    ("claim", "at"),
    [
        (Dependence.NONE, (1.0, 1.0, 1.001)),
        (Dependence.AFFINE, (1.0, 2.0, 3.001)),
        (Dependence.BIAFFINE, (1.0, 2.0, 4.0)),
        (Dependence.CONVEX, (1.0, 2.001, 3.0)),
        (Dependence.MONOTONE_UP, (1.0, 2.0, 1.999)),
        (Dependence.MONOTONE_DOWN, (2.0, 1.0, 1.001)),
    ],
)
def test_samples_refute_what_is_wrong(claim: Dependence, at: tuple[float, float, float]) -> None:
    assert refuted(claim, [np.array([each]) for each in at])
    assert not refuted(claim, [np.ones(1)] * 3)


@pytest.mark.slow
def test_leads_shift_what_each_shaft_carries() -> None:
    """Check that equal steps of a lead move a coefficient of one order by equal distances."""
    seen = 0
    for number, path in enumerate(path for path in _ready() if "lead" in path.read_text()):
        problem = laufruhe.load(path)
        leads = [decision for decision in problem.decisions if decision.kind is Kind.LEAD]
        rng = np.random.default_rng(number)
        for decision in leads:
            own = replace(_random(problem, rng), decisions=(decision,))
            a, step = rng.uniform(0.1, 0.3), rng.uniform(0.05, 0.2)
            at = [evaluate(own, own.design([_values(decision, np.full(2, a + k * step))])) for k in range(3)]
            for channel in CHANNELS.values():
                if dependence(channel, Kind.LEAD, own) is not Dependence.SHIFT or not isinstance(channel, LoadChannel):
                    continue
                try:
                    series = [evaluation.signals(channel) for evaluation in at]
                except (TypeError, ValueError):
                    # the engine has no such places
                    continue
                for signals in zip(*series, strict=True):
                    base = min(signal.base for signal in signals)
                    first, second, third = (signal.with_base(base).series.coefficients for signal in signals)
                    size = float(np.abs(first).max(initial=0.0))
                    np.testing.assert_allclose(np.abs(third - second), np.abs(second - first), rtol=0, atol=1e-8 * size)
                    seen += 1
    assert seen > 20


@pytest.mark.slow
def test_no_star_moves_what_is_constant() -> None:
    seen = set()
    for name in ("inline-five", "tractor-four-open", "two-stroke-four-open", "inline-seven-uneven"):
        path = PROBLEMS / f"{name}.toml"
        problem = laufruhe.load(path) if path.exists() else None
        if problem is None or problem.phasing is None or problem.phasing.throws is not None:
            continue
        stars = [star for star, _ in even_stars(problem.phasing)][:2]
        at = [evaluate(whole := problem.phasing.problem_of(star), whole.engine) for star in stars]
        for channel in CHANNELS.values():
            values = [_numbers(channel, evaluation) for evaluation in at]
            if len(values) > 1 and dependence(channel, Kind.STAR, problem) is Dependence.NONE:
                for each in values:
                    if each is not None and values[0] is not None:
                        np.testing.assert_allclose(each, values[0], rtol=1e-9)
                        seen.add(channel.name)
    assert seen


@pytest.mark.parametrize(
    ("line", "said"),
    [
        ("mount force   a a a  b m >  >  a a", "'mount force' has dependences already"),
        ("mount force   flywheel=a", "'mount force' has dependences already"),
        ("no such force   a a a  b m >  >  s s", "'no such force' has dependences already, or is no channel"),
        ("mount force", "is no line of dependences"),
        ("own force   a a a", "is no line of dependences"),
        ("own force   a a a  b m >  >  s !", "is no line of dependences"),
    ],
)
def test_an_extension_speaks_of_its_own_channels_alone(line: str, said: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """Check that an extension cannot add a line about a channel of the package."""
    monkeypatch.setattr(module, "extensions", lambda: [Extension("own", dependences=(line,))])
    with pytest.raises(ModelError, match=said):
        module._with_extensions(module.TABLE)


def test_a_line_of_an_extension_is_one_of_the_table(monkeypatch: pytest.MonkeyPatch) -> None:
    own = replace(CHANNELS["mount force"], name="own force")
    monkeypatch.setattr(module, "CHANNELS", {**CHANNELS, own.name: own})
    line = "own force   a a a  b m >  >  s s"
    monkeypatch.setattr(module, "extensions", lambda: [Extension("own", dependences=(line,))])
    row = module._with_extensions(module.TABLE)["own force"]
    assert row == {kind: module.TABLE["mount force"][kind] for kind in module._COLUMNS}
