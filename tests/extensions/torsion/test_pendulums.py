"""Critical speeds of crankshafts with pendulums, compared with zeros of an independent determinant."""

from __future__ import annotations

import math
from dataclasses import replace
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest

import laufruhe
from lanes import first_fast
from laufruhe.extensions.torsion.boxes import TwistBoxes
from laufruhe.extensions.torsion.coordinates import TwistCoordinates
from laufruhe.extensions.torsion.machine import Absorber, Disc, ShaftSection, Torsion
from laufruhe.extensions.torsion.physics import InOrder, critical_modes, natural_modes
from laufruhe.problem.evaluation import evaluate

INPUTS = Path(__file__).parent / "inputs"
RPM = 30.0 / math.pi


def dynamic(chain: Torsion, order: float, speed: float) -> np.ndarray:
    """Return K - (h w)^2 J of discs and rings, a pendulum on the spring J (n w)^2, by hand."""
    names = [disc.name for disc in chain.discs] + [absorber.name for absorber in chain.absorbers]
    result = np.diag([-part.inertia * (order * speed) ** 2 for part in (*chain.discs, *chain.absorbers)])
    links = [(names[k], names[k + 1], section.stiffness) for k, section in enumerate(chain.sections)]
    links += [(a.on, a.name, a.stiffness + a.inertia * (a.order * speed) ** 2) for a in chain.absorbers]
    for one, other, stiffness in links:
        a, b = names.index(one), names.index(other)
        result[np.ix_([a, b], [a, b])] += stiffness * np.array([[1.0, -1.0], [-1.0, 1.0]])
    return result


def zeros(chain: Torsion, order: float, maximum: float) -> list[float]:
    """Return the speeds at which the determinant changes its sign, by halving [rad/s]."""

    def sign(speed: float) -> float:
        return float(np.linalg.slogdet(dynamic(chain, order, speed))[0])

    speeds = np.geomspace(maximum / 2000.0, maximum, 6000)
    found = []
    for low, high in pairwise(speeds):
        a, b = float(low), float(high)
        start = sign(a)
        if start == sign(b):
            continue
        while b - a > 1e-11 * b:
            middle = 0.5 * (a + b)
            a, b = (middle, b) if sign(middle) == start else (a, middle)
        found.append(0.5 * (a + b))
    return found


def crankshaft(rng: np.random.Generator) -> Torsion:
    """Return discs with rubber rings and pendulums of several orders on them."""
    count = int(rng.integers(2, 5))
    discs = tuple(Disc(f"d{k}", float(rng.uniform(0.05, 0.5))) for k in range(count))
    sections = tuple(ShaftSection(f"s{k}", float(rng.uniform(2e5, 2e6))) for k in range(count - 1))
    hung = []
    for k in range(int(rng.integers(1, 4))):
        on, inertia = f"d{rng.integers(count)}", float(rng.uniform(0.002, 0.02))
        if rng.random() < 0.3:
            hung.append(Absorber(f"a{k}", on, inertia, stiffness=inertia * float(rng.uniform(800.0, 3000.0)) ** 2))
        else:
            hung.append(Absorber(f"a{k}", on, inertia, order=float(rng.choice([1.5, 2.5, 3.0, 4.5, 6.0]))))
    return Torsion(discs, sections, tuple(hung))


@pytest.mark.parametrize("seed", first_fast(range(6), 0, 2))
def test_an_order_meets_modes_where_the_determinant_vanishes(seed: int) -> None:
    """Check orders below, above and far from those that the pendulums are tuned to."""
    chain = crankshaft(np.random.default_rng(seed))
    for order in (0.5, 2.0, 4.0, 5.5):
        found = math.tau * critical_modes(chain, order).frequencies / order
        assert found == pytest.approx(zeros(chain, order, 1.1 * found[-1]), rel=1e-8)


def test_a_pendulum_stands_its_disc_still_in_its_order() -> None:
    """Check that the rest of the crankshaft swings against the disc as against a wall."""
    own = Torsion(
        (Disc("a", 0.1), Disc("b", 0.2)), (ShaftSection("s", 4e5),), (Absorber("pendulum", "a", 0.004, order=2.5),)
    )  # fmt: skip
    met = critical_modes(own, 2.5)
    assert math.tau * met.frequencies == pytest.approx([math.sqrt(4e5 / 0.2)])
    assert abs(met.shapes[0, 0]) < 1e-12


def test_modes_without_pendulums_are_the_same_in_every_order() -> None:
    own = Torsion(
        (Disc("a", 0.1), Disc("b", 0.2), Disc("c", 0.9)), (ShaftSection("s", 4e5), ShaftSection("t", 7e5)),
        (Absorber("ring", "a", 0.01, stiffness=2e4), Absorber("fluid", "b", 0.01, damping=3.0)),
    )  # fmt: skip
    assert critical_modes(own, 3.0).frequencies == pytest.approx(natural_modes(own, 70.0).frequencies, rel=1e-12)


def test_the_critical_speed_of_a_two_disc_crank_with_a_pendulum() -> None:
    """Check order 4 with the inertia of throw 1 by hand: 0.14 + 0.0080277 / (1 - 16 / 20.25) kg m2."""
    throw, wheel = 0.14 + 0.0080277 / (1.0 - 4.0**2 / 4.5**2), 0.9
    by_hand = math.sqrt(8e5 * (1.0 / throw + 1.0 / wheel)) / 4.0
    result = laufruhe.evaluate(INPUTS / "pendulum.toml")
    (limit,) = result.limits
    assert limit.value == pytest.approx(by_hand, rel=1e-9)
    assert by_hand * RPM == pytest.approx(5535.8, abs=0.05)
    assert limit.active
    assert result.final.violation(result.problem.limits) > 1e-3


def test_no_flywheel_of_the_bounds_leaves_the_forbidden_band() -> None:
    """Check that a band around the critical speeds of all designs, 5489 to 5593 rpm, is named as a conflict."""
    result = laufruhe.solve(INPUTS / "pendulum-open.toml")
    assert result.status == "infeasible"
    assert result.conflict == ("critical speeds of order 4",)


@pytest.mark.slow
@pytest.mark.parametrize("order", [3.0, 5.0, 4.5])
def test_boxes_exclude_no_pendulum_that_keeps_its_limit(order: float) -> None:
    """Check boxes of open pendulum and flywheel against random designs below, above and in the pendulum's order."""
    text = (INPUTS / "pendulum-open.toml").read_text()
    text = text.replace('inertia = "0.0080277 kg m^2"', 'inertia = { between = ["0.004 kg m^2", "0.02 kg m^2"] }')
    problem = laufruhe.load(text.replace("orders = [4]", f"orders = [{order:g}]"))
    (limit,) = problem.limits
    rng, counts = np.random.default_rng(5), {True: 0, False: 0}
    initial = evaluate(problem)
    for _ in range(45):
        own = replace(limit, outside=tuple(sorted(rng.uniform(1000.0, 9000.0, 2) / RPM)))
        boxes = TwistBoxes(problem.changed(limits=(own,)), initial)
        ends = np.sort(rng.uniform(boxes.coordinates.lower, boxes.coordinates.upper, (2, 2)), axis=0)
        (bound,), _ = boxes.bounds(ends[:1], ends[1:])
        inside = [evaluate(problem, problem.design(rng.uniform(*ends).tolist())) for _ in range(12)]
        keeps = [each.violation((own,)) <= 0.0 for each in inside]
        counts[math.isinf(bound)] += 1
        assert not (math.isinf(bound) and any(keeps))
        # a narrow enough box of designs that all break it is excluded
        point = rng.uniform(*ends)
        (thin,), _ = boxes.bounds(point[None] * (1.0 - 1e-7), point[None] * (1.0 + 1e-7))
        at = evaluate(problem, problem.design(point.tolist())).violation((own,))
        assert math.isinf(thin) == (at > 0.0) or abs(at) < 1e-5
    assert min(counts.values()) > 3


def test_ends_of_a_box_hold_the_critical_speeds_of_all_pendulums_in_it() -> None:
    """Check that the ends enclose the critical speeds of random designs, counted from the highest."""
    text = (INPUTS / "pendulum-open.toml").read_text()
    text = text.replace('inertia = "0.0080277 kg m^2"', 'inertia = { between = ["0.004 kg m^2", "0.06 kg m^2"] }')
    resonance, rng, counts = InOrder(5.0), np.random.default_rng(3), {True: 0, False: 0}
    coordinates = TwistCoordinates(laufruhe.load(text.replace("orders = [4]", "orders = [5]")))
    for _ in range(30):
        lower, upper = np.sort(rng.uniform(coordinates.lower, coordinates.upper, (2, 2)), axis=0)
        ends = coordinates.ends(lower, upper, resonance)
        counts[ends is None] += 1
        for chain in [coordinates.chain(x) for x in rng.uniform(lower, upper, (6, 2))] if ends else ():
            low, own, high = (resonance.numbers(each)[::-1] for each in (ends[0], chain, ends[1]))
            assert len(low) == len(own) == len(high)
            assert np.all(low <= own * (1.0 + 1e-9))
            assert np.all(own <= high * (1.0 + 1e-9))
    assert min(counts.values()) > 3
