"""Bounds of a box of mounts by spring forces, compared with designs and searches (E42-E45, E52-E54)."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from extensions.mount_relaxation.test_dual import spoilt
from lanes import first_fast
from laufruhe.extensions.mount_relaxation import orders as orders_
from laufruhe.extensions.mount_relaxation.cone_program import ConeProgram
from laufruhe.extensions.mount_relaxation.constraints import moment_constraints
from laufruhe.extensions.mount_relaxation.odd_multiples import HighOrder, linear_sum, work_weight
from laufruhe.extensions.mount_relaxation.open_mounts import OpenMounts, is_lifted, open_mounts
from laufruhe.extensions.mount_relaxation.orders import Order
from laufruhe.extensions.mount_relaxation.parameter_maps import mount_axes
from laufruhe.extensions.mount_relaxation.prover import narrowed, spring_bound
from laufruhe.extensions.mount_relaxation.response import ResponseBound, response_bound
from laufruhe.extensions.mount_relaxation.search import SdpRelaxation
from laufruhe.extensions.mount_relaxation.symmetry_split import split_mounts, split_signal
from laufruhe.files.reader import load
from laufruhe.problem.channels import mounting_in
from laufruhe.problem.decision import TURNED as ANGLES
from laufruhe.problem.evaluation import evaluate, objective_value, with_mounts
from laufruhe.problem.problem import Problem
from laufruhe.prove.certificate import Proof
from laufruhe.prove.mounts.provers import Question
from laufruhe.prove.mounts.ranges import number_ranges
from laufruhe.prove.mounts.subdivision import StiffnessBoxes
from laufruhe.solvers import solve
from mounts.files import BLOCK, ENGINE, MOUNTS, changed, problem_of
from mounts.files import OPEN as OPEN_STIFFNESS
from problem_files import PROBLEMS
from prove.test_subdivision import DAMPED, divided_bound, stiffness_problem

OPEN = '{ between = ["60 N/mm", "700 N/mm"], start = "300 N/mm" }'
TURNED = changed(
    DAMPED,
    ('name = "rear left"', 'name = "rear left"\nturned = [25, 0, 10]'),
    (
        'stiffness = ["120 N/mm", "120 N/mm", { between = ["20 N/mm", "4000 N/mm"]',
        f'stiffness = [{OPEN}, {OPEN}, {{ between = ["20 N/mm", "4000 N/mm"]',
    ),
)
ANY = ResponseBound((), np.inf, False)
NARROW = '\norders = [2, 4]\noperating_points = ["idle"]'
OBJECTIVES = {
    "rms": 'minimise = "rms mount force"\norders = [2, 4]',
    "narrowed": 'minimise = "rms mount force"\nmounts = ["front left"]\ndirection_weights = [1, 0.5, 2]' + NARROW,
    "travel": 'minimise = "rms mount travel"' + NARROW,
    "mean": 'minimise = "mean mount force"' + NARROW,
    "maximum": 'minimise = "maximum mount force"' + NARROW,
}
MEANS = 'minimise = "mean mount force"\norders = [2, 6]'
LIMITS = """
[[constraints]]
limit = "natural frequencies"
min = "4 Hz"
max = "30 Hz"
[[constraints]]
limit = "static sag"
max = "10 mm"
"""
POWERTRAIN = PROBLEMS / "powertrain-least-force.toml"


def designs_of(
    problem: Problem, low: np.ndarray, high: np.ndarray, count: int, seed: int
) -> Iterator[tuple[Any, float]]:
    """Return random designs of a box that keep every limit, and their values."""
    generator, evaluation = np.random.default_rng(seed), evaluate(problem)
    for share in generator.random((count, len(low))):
        x = low + share * (high - low)
        each = with_mounts(evaluation, problem.design(x.tolist()))
        if each.violation(problem.limits) <= 0.0:
            yield x, objective_value(problem, each)


def relaxation_of(problem: Problem) -> SdpRelaxation:
    """Return the relaxation around the initial design."""
    return SdpRelaxation(problem, objective_value(problem, evaluate(problem)), 1e-3, problem.start)


def test_open_springs_add_up_to_what_the_matrices_change_by(tmp_path: Path) -> None:
    problem = stiffness_problem(tmp_path, OBJECTIVES["rms"], mounts=TURNED)
    boxes, model = relaxation_of(problem), StiffnessBoxes(problem, 1.0).model
    mounts = open_mounts(problem, model.lower, model.upper)
    half = 0.5 * (boxes.upper - boxes.lower)
    for j, follows in enumerate(mounts.decisions):
        own = model.slopes["stiffness"][follows[0]] * half[follows[0]]
        assert np.allclose(mounts.slopes[j], own, rtol=1e-9, atol=1e-9 * np.abs(own).max())


@dataclass(frozen=True)
class Truth:
    """Quantities of one order of a design, and their values in the variables of the relaxation."""

    numbers: np.ndarray
    vector: np.ndarray
    motion: np.ndarray
    forces: np.ndarray
    travel: np.ndarray
    stiffness: np.ndarray


def truth(
    problem: Problem, whole: OpenMounts, mounts: OpenMounts, order: Any, line: Any, x: np.ndarray, u: np.ndarray
) -> Truth:
    """Return the quantities of a design from a new solution for the motion, of all motions or of one half."""
    mounting = mounting_in(problem.design(x.tolist(), problem.mount_decisions))
    stiffness, loss, damping = (
        mounts.root @ mounting.total(each) @ mounts.root.T
        for each in (mounting.springs, mounting.losses, mounting.dampers)
    )
    impedance = stiffness + 1j * (loss + order.omega * damping) - order.omega**2 * np.eye(len(stiffness))
    motion = np.linalg.solve(impedance, order.loads[0] + u @ order.loads[1:])
    travel = mounting.motions @ mounts.root.T @ motion
    elastic = np.einsum("mij,mj->mi", mounting.springs, travel)
    viscous = np.einsum("mij,mj->mi", mounting.dampers, travel)
    forces = elastic + 1j * (np.einsum("mij,mj->mi", mounting.losses, travel) + order.omega * viscous)
    numbers, products = numbers_of(whole, mounting), []
    for spring in mounts.springs:
        m, times = mounts.members[spring.mount][0], mounts.symmetry_factors[spring.mount]
        given, middles = matrices_of(mounts, mounting, spring)
        added = spring.axes.T @ (given[m] - middles[spring.mount]) @ spring.axes
        products.append(times * added @ spring.axes.T @ travel[m])
    for place in mounts.places:
        s = numbers[place.number]
        products += [s * place.turn_axes @ mounts.turns @ motion]
        for forces_of_kind in (elastic, viscous)[: 1 + place.is_damped]:
            times = [(mounts.symmetry_factors[k] * h, forces_of_kind[mounts.members[k][0]]) for k, h in place.mounts]
            products += [s * sum(h * place.arms @ force for h, force in times)]
    rows = np.concatenate([added for _, added in line.springs] + [moved for _, moved in line.places])
    first, count = 1 + line.columns, len(rows)
    sizes = np.abs(rows[np.arange(count), first + np.arange(count)])
    w = np.concatenate(products) / line.unit / sizes
    first = [own[0] for own in mounts.members]
    vector = np.concatenate([[1.0], u, w.real, w.imag])
    return Truth(numbers, vector, motion, forces[first], travel[first], stiffness)


def matrices_of(mounts: OpenMounts, mounting: Any, spring: Any) -> tuple[np.ndarray, np.ndarray]:
    """Return the matrices of a design and at the middle of a spring: stiffness, or dampers alone."""
    return (mounting.springs, mounts.middles) if spring.elastic else (mounting.dampers, mounts.dampers)


def numbers_of(whole: OpenMounts, mounting: Any) -> np.ndarray:
    """Return s of a design."""
    numbers = np.full(whole.numbers, np.nan)
    for spring in whole.springs:
        given, middles = matrices_of(whole, mounting, spring)
        added = spring.axes.T @ (given[spring.mount] - middles[spring.mount]) @ spring.axes
        terms = np.array([matrix.ravel() for _, matrix in spring.terms]).T
        for (j, _), value in zip(spring.terms, np.linalg.lstsq(terms, added.ravel(), rcond=None)[0], strict=True):
            # mirrored mounts have the same numbers
            assert np.isnan(numbers[j]) or numbers[j] == pytest.approx(value, abs=1e-7)
            numbers[j] = value
    centre = np.array(mounting.block.centre_of_gravity)
    for place in whole.places:
        m, reach = place.mounts[0]
        here = np.array(mounting.mounts[m].position) - centre
        middle = (whole.motions[m] @ np.linalg.inv(whole.root).T)[:, 3:]
        given = np.array([middle[1, 2], middle[2, 0], middle[0, 1]]) @ place.axis
        numbers[place.number] = (here @ place.axis - given) / reach
    return numbers


def designs_in(generator: np.random.Generator, boxes: SdpRelaxation, about: np.ndarray, count: int) -> Any:
    """Yield boxes of every size, of planes around a design too, and a design in each."""
    own = slice(len(about))
    for _ in range(count):
        share = generator.choice([1.0, 0.3, 0.05])
        width = share * (boxes.upper - boxes.lower)[own]
        low = np.clip(about - width * generator.random(len(about)), boxes.lower[own], boxes.upper[own] - width)
        x = low + generator.random(len(about)) ** 2 * width
        columns, planes = generator.uniform(-0.7, 0.7, boxes.basis.count), in_planes(boxes, x)
        wide = share * (boxes.upper - boxes.lower)[len(about) :] * generator.random((2, len(planes)))
        given = np.append(low, planes - wide[0]), np.append(low + width, planes + wide[1])
        yield np.maximum(given[0], boxes.lower), np.minimum(given[1], boxes.upper), x, columns


def in_planes(boxes: SdpRelaxation, x: np.ndarray) -> np.ndarray:
    """Return K11, K22 and K12 of a design in the plane of the first turned mount, with its dampers (E63, E66)."""
    found, (low, high) = [np.zeros(0)], number_ranges(boxes.problem)
    own = number_ranges(boxes.problem, x, x)[0]
    for kind, *_ in boxes._planes:
        m = int(np.argmax(np.any(low[:, ANGLES] < high[:, ANGLES], axis=1)))
        frame, axes = mount_axes(boxes._frames[m, ANGLES])[1:], mount_axes(own[m, ANGLES])
        seen = frame @ axes.T @ np.diag(own[m, kind : kind + 3]) @ axes @ frame.T
        found.append(np.array([seen[0, 0], seen[1, 1], seen[0, 1]]))
    return np.concatenate(found)


SPRINGS = """stiffness = [
    { between = ["100 N/mm", "600 N/mm"], start = "200 N/mm" },
    { between = ["50 N/mm", "1500 N/mm"], start = "200 N/mm" },
    { between = ["50 N/mm", "1500 N/mm"], start = "700 N/mm" },
]"""
UNLIKE = 'damping = ["900 N s/m", "300 N s/m", "1600 N s/m"]\n'
GIVEN = 'stiffness = ["200 N/mm", "300 N/mm", "700 N/mm"]'


def tractor(name: str) -> str:
    """Return the ready tractor with dampers, one turned mount and one moved mount."""
    text = POWERTRAIN.with_name("tractor-four-elastic.toml").read_text(encoding="utf-8")
    front, rear = text.split('name = "rear left"')
    if name == "damped alike":
        front = changed(front, ("turned    = [", 'damping = ["900 N s/m", "900 N s/m", "900 N s/m"]\nturned    = ['))
    elif name != "all":
        front = changed(front, ("turned    = [", UNLIKE + "turned    = ["))
        rear = UNLIKE.join(["\n", rear])
    if name == "dampers that follow":
        front = changed(front, (SPRINGS, GIVEN))
    if name == "dampers that turn in space":
        front = changed(front, ("between = [0, 60] }, 0, 0]", "between = [0, 60] }, 0, { between = [-20, 20] }]"))
    return f'{front}name = "rear left"{rear}'


DAMPED_TRACTORS = ["dampers that follow", "dampers of their own", "dampers that turn in space"]


@pytest.mark.parametrize("name", ["stiffness", "all", "damped alike", *DAMPED_TRACTORS])
def test_every_design_is_in_the_relaxation(name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Check that motion, forces and travel of random designs break no condition (E42, E43, E52, E53, E57).

    Turned and moved mounts and unbalances are open too; all motions, and both halves if mounts mirror each other.
    """
    monkeypatch.setattr(orders_, "OMITTED_SYMMETRY", -1.0)
    plain = stiffness_problem(tmp_path, OBJECTIVES["narrowed"], mounts=TURNED) if name == "stiffness" else None
    (tmp_path / "four.toml").write_text(tractor(name), encoding="utf-8")
    problem = plain or load(tmp_path / "four.toml")
    boxes, generator = relaxation_of(problem), np.random.default_rng(4)
    about = np.array([d.real_start for d in problem.mount_decisions])
    count, halves = 0, set[int]()
    for low, high, x, u in designs_in(generator, boxes, about, 40):
        parts, orders = boxes.parts(low, high), boxes._terms[0][1].orders
        order, k = orders[int(generator.integers(len(orders)))], int(generator.integers(len(parts)))
        mounts = parts[k]
        halves.add(k)
        # the part of the load that half of the motions takes
        order = replace(order, loads=order.loads @ np.linalg.solve(parts[0].root.T, mounts.root.T))
        line = boxes.response(mounts, order, ANY, low, high)
        exact = truth(problem, parts[0], mounts, order, line, x, u)
        for function, value in (
            (line.motion, exact.motion), (line.forces, exact.forces), (line.deflections, exact.travel),
            (line.carried, exact.stiffness @ exact.motion),
        ):  # fmt: skip
            assert np.allclose(function @ exact.vector * line.unit, value, rtol=1e-7, atol=1e-8 * np.abs(value).max())
        assert np.sum(exact.vector[1:] ** 2) <= line.reach * (1.0 + 1e-9)
        assert np.abs(exact.numbers).max() <= 1.0 + 1e-9
        values = np.linalg.eigvalsh(exact.stiffness)
        if not _is_allowed(mounts, exact.stiffness):
            continue
        count += 1
        assert mounts.lowest <= values[0] * (1.0 + 1e-9)
        assert values[-1] <= mounts.highest * (1.0 + 1e-9)
        for limit in moment_constraints(mounts, line):
            moments = np.einsum("abij,i,j->ab", limit.moments, exact.vector, exact.vector)
            whole = limit.constant + np.tensordot(exact.numbers, limit.slopes, 1) + moments
            assert np.linalg.eigvalsh(whole)[0] >= -1e-9 * max(1.0, np.abs(whole).max())
    assert count > 10
    # mirrored mounts share no numbers of a matrix in space
    assert halves == ({0} if "space" in name else {0, 1, 2})


OWN = 'damping = ["900 N s/m", "900 N s/m", "500 N s/m"]\n'


@pytest.mark.parametrize(
    ("springs", "follows"),
    [(OWN, True), (OWN.replace('"500 N s/m"', '{ between = ["300 N s/m", "500 N s/m"] }'), False)],
    ids=["given", "open"],
)
def test_given_dampers_of_turned_and_moved_mounts_are_bounded(springs: str, follows: bool, tmp_path: Path) -> None:
    """Check E66 with given dampers."""
    text = POWERTRAIN.with_name("tractor-four-elastic.toml").read_text(encoding="utf-8")
    own = ("turned    = [", f"{springs}turned    = ["), ('name = "rear left"', f'name = "rear left"\n{OWN}')
    (tmp_path / "four.toml").write_text(changed(text, *own), encoding="utf-8")
    assert is_lifted(load(tmp_path / "four.toml")) is follows


ASKEW = {
    "block": (("centre_of_gravity = [\"-60 mm\", \"0 mm\"", "centre_of_gravity = [\"-60 mm\", \"1 mm\""),),
    "stiffness": (("mirror_of = \"front left\"", "position = [\"300 mm\", \"-200 mm\", \"0 mm\"]\nstiffness = "
                   "[\"200 N/mm\", \"200 N/mm\", \"700 N/mm\"]"),),
    "place": (("mirror_of = \"rear left\"", "position = [\"-350 mm\", \"-200 mm\", \"0 mm\"]\nstiffness = "
               "[\"200 N/mm\", \"200 N/mm\", \"700 N/mm\"]"),),
}  # fmt: skip


@pytest.mark.parametrize("name", ASKEW)
def test_mounts_that_do_not_mirror_each_other_are_bounded_whole(name: str, tmp_path: Path) -> None:
    text = changed(POWERTRAIN.with_name("tractor-four-elastic.toml").read_text(encoding="utf-8"), *ASKEW[name])
    path = tmp_path / "askew.toml"
    path.write_text(text, encoding="utf-8")
    problem = load(path)
    boxes = (np.array([getattr(d, side) for d in problem.mount_decisions]) for side in ("lower", "upper"))
    assert split_mounts(open_mounts(problem, *boxes)) == ()


def test_halves_in_the_mirror_add_up_and_no_norm_of_one_is_over_that_of_both() -> None:
    """Check that halves add up and no norm of a half exceeds that of the whole (E57)."""
    generator = np.random.default_rng(2)
    members = ((0, 2), (1,), (3, 4))
    for _ in range(20):
        signal = generator.normal(size=(5, 3)) + 1j * generator.normal(size=(5, 3))
        halves = split_signal(signal, members)
        assert np.allclose(halves[0] + halves[1], signal)
        angles = np.exp(1j * np.linspace(0.0, 2.0 * np.pi, 90))
        for norm in (np.sum, np.max):
            worth = [
                norm(np.linalg.norm((each[..., None] * angles).real, axis=1), axis=0) for each in (signal, *halves)
            ]
            assert max(each.mean() for each in worth[1:]) <= worth[0].mean() * (1.0 + 1e-12)
        squares = [np.sum(np.abs(each) ** 2) for each in (signal, *halves)]
        assert squares[0] == pytest.approx(squares[1] + squares[2])


def _is_allowed(mounts: OpenMounts, stiffness: np.ndarray) -> bool:
    values = np.linalg.eigvalsh(stiffness)
    inside = all(np.linalg.eigvalsh(stiffness - floor)[0] >= 0.0 for floor in mounts.floors)
    under = all(np.linalg.eigvalsh(ceiling - stiffness)[0] >= 0.0 for ceiling in mounts.ceilings)
    return inside and under and not any(np.any((values > a) & (values < b)) for a, b in mounts.bands)


@pytest.mark.parametrize("limits", ["", LIMITS], ids=["free", "limited"])
@pytest.mark.parametrize("name", first_fast(OBJECTIVES, 1))
def test_no_design_in_a_box_is_under_its_bound(name: str, limits: str, tmp_path: Path) -> None:
    problem = stiffness_problem(tmp_path, OBJECTIVES[name], limits, mounts=TURNED)
    low, high = (np.array([getattr(d, side) for d in problem.mount_decisions]) for side in ("lower", "upper"))
    centre, tight = next(designs_of(problem, low, high, 100, 5))[0], 0.0
    for share in (1.0, 0.02):
        below = np.clip(centre - 0.5 * share * (high - low), low, high - share * (high - low))
        above = below + share * (high - low)
        best, minimum = min(designs_of(problem, below, above, 40, 6), key=lambda pair: pair[1])
        # the known design is worse than others of the box
        bound = SdpRelaxation(problem, 1.2 * minimum, 1e-3, best.tolist()).bound(below, above)[0]
        assert bound <= minimum * (1.0 + 1e-9)
        tight = max(tight, bound / minimum)
    assert tight > 0.8


BALANCED = """
[[counterweights]]
name = "front"
x = "-187.5 mm"
unbalance = { between = ["0 kg m", "0.03 kg m"] }
angle = { between = [30, 150] }
[[balancer_shafts]]
name = "left"
ratio = 2
position = ["100 mm", "-100 mm"]
[[balancer_shafts.unbalances]]
unbalance = { between = ["0 kg m", "0.02 kg m"] }
angle = 180
"""
MOVED = changed(
    MOUNTS,
    ("[[mounts.places]]\nname = \"front right\"", "turned = [{ between = [-20, 30], start = 5 }, 0, 0]\n"
     "[[mounts.places]]\nname = \"front right\""),
    ('["-300 mm"', '[{ between = ["-400 mm", "-200 mm"], start = "-250 mm" }'),
)  # fmt: skip


NORMS = {"mean": 0, "rms": 0, "maximum": 0, "peak to peak": 0, "worst mean": 0}


@pytest.mark.parametrize("norm", first_fast(NORMS, 1))
def test_no_design_of_mounts_and_unbalances_is_under_the_bound(norm: str, tmp_path: Path) -> None:
    """Check every norm with a sector, an angle, an inclination, a place and two stiffnesses."""
    objective = f'[objective]\nminimise = "{norm} mount force"\norders = [1, 2, 4]\n[fidelity]\nsamples = 144\n'
    problem = problem_of(tmp_path, ENGINE, BLOCK, MOVED, BALANCED, objective + LIMITS)
    generator, given = np.random.default_rng(8), []
    domains = [d.set for d in problem.unbalances]
    for share in generator.random((120, len(problem.decisions))):
        values: list[Any] = []
        for d, part in zip(problem.decisions, share, strict=True):
            if d.is_affine:
                low, high = d.set.angles
                values.append(d.upper * part * np.exp(1j * (low + generator.random() * (high - low))))
            else:
                values.append(d.lower + part * (d.upper - d.lower))
        each = evaluate(problem, problem.design(values))
        if each.violation(problem.limits) <= 0.0:
            given.append((objective_value(problem, each), values))
    assert len(domains) == 2
    assert len(given) > 20
    minimum, best = min(given, key=lambda pair: pair[0])
    boxes = SdpRelaxation(problem, 1.2 * minimum, 1e-3, best)
    low, high = boxes.lower.copy(), boxes.upper.copy()
    assert boxes.bound(low, high)[0] <= minimum
    # about the best of them, its place held
    held = [*("position" in d.name for d in problem.mount_decisions), False, False, False]
    width = np.where(held, 0.0, 1e-3 * (high - low))
    near = np.clip(boxes.reference, low + width, high - width)
    bound = boxes.bound(near - width, near + width)[0]
    # the unbalances may cancel the one order that others than root mean squares are shown by
    assert (0.3 * minimum if norm == "rms" else 0.0) <= bound <= minimum


@pytest.mark.parametrize("name", ["rms", pytest.param("means", marks=pytest.mark.slow)])
def test_a_bound_holds_for_any_multipliers_of_a_solver(
    name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Check bounds from random multipliers, and from none."""
    problem = stiffness_problem(
        tmp_path, OBJECTIVES.get(name, MEANS), LIMITS, mounts=DAMPED if name == "means" else TURNED
    )
    low, high = (np.array([getattr(d, side) for d in problem.mount_decisions]) for side in ("lower", "upper"))
    high = low + 0.2 * (high - low)
    best, minimum = min(designs_of(problem, low, high, 200, 1), key=lambda pair: pair[1])
    boxes, generator = SdpRelaxation(problem, 1.5 * minimum, 1e-3, best.tolist()), np.random.default_rng(3)
    # roots of a mean narrow each other on the whole of what is divided
    boxes.lower, boxes.upper = low, high

    right = ConeProgram.bound

    def wrong_by(by: float, noise: float) -> Any:
        return lambda self, cost, z: right(self, cost, spoilt(self, z, by, noise, generator))

    # each of several orders has its own bound, so that one kind of error has many chances
    ways = (wrong_by(2.0, 1e-3), wrong_by(2.0, 0.0), wrong_by(0.0, 0.0), wrong_by(0.0, 1.0))
    for wrong in ways[: 1 if name == "means" else 4]:
        monkeypatch.setattr(ConeProgram, "bound", wrong)
        boxes._reset()
        assert boxes.bound(low, high)[0] <= minimum


def test_a_mean_is_shown_by_its_strongest_order_less_odd_multiples() -> None:
    """Compare E58 with sums over samples of random ellipses in space."""
    generator, samples = np.random.default_rng(5), 720
    angles = 2.0 * np.pi * np.arange(samples) / samples
    for place in (1, 2, 6):
        others = [Order(0, k * place, 1.0, np.zeros((1, 6)), np.zeros((1, 3)), 0) for k in (3, 5)]
        phases = samples // place
        factor = 2.0 / phases / math.tan(math.pi / phases)
        head = orders_.EpigraphVariable(
            (), 1.0, 1.0, 0.0, False, factor, tuple(zip(others, (3, 5), strict=True)), phases
        )
        for _ in range(30):
            size = 10.0 ** generator.uniform(-2.0, 0.0)
            forces = {
                k: (1.0 if k == 1 else size) * (generator.normal(size=3) + 1j * generator.normal(size=3))
                for k in (1, 2, 3, 4, 5)
            }
            signal = sum(np.real(f[:, None] * np.exp(1j * k * place * angles)) for k, f in forces.items())
            mean = float(np.linalg.norm(signal, axis=0).mean())
            shown = factor * np.linalg.norm(forces[1])
            shown -= sum(w * np.linalg.norm(forces[k]) for w, k in zip(head.multiple_weights, (3, 5), strict=True))
            assert shown <= mean * (1.0 + 1e-12)
            if size < 0.02:
                assert mean < 1.3 * factor * np.linalg.norm(forces[1])


def test_no_force_of_a_high_order_exceeds_its_line() -> None:
    """Check E62 against forces from a new solution, with an inclination and a place open."""
    problem = load(POWERTRAIN.with_name("tractor-four-elastic.toml"))
    boxes, generator = relaxation_of(problem), np.random.default_rng(6)
    about, tight = np.array([d.real_start for d in problem.mount_decisions]), 0.0
    omega = 2.0 * np.pi * 70.0
    for low, high, x, _ in designs_in(generator, boxes, about, 30):
        parts = boxes.parts(low, high)
        mounting = mounting_in(problem.design(x.tolist(), problem.mount_decisions))
        numbers = numbers_of(parts[0], mounting)
        for mounts in parts:
            load_ = generator.normal(size=mounts.size) + 1j * generator.normal(size=mounts.size)
            high = HighOrder(mounts, load_, omega, generator.uniform(-1.0, 1.0, mounts.numbers))
            if not high.is_above:
                continue
            line = high.bound
            assert line is not None
            k, h = (mounts.root @ mounting.total(m) @ mounts.root.T for m in (mounting.springs, mounting.losses))
            motion = np.linalg.solve(k + 1j * h - omega**2 * np.eye(mounts.size), load_)
            travel = mounting.motions @ mounts.root.T @ motion
            forces = np.einsum("mij,mj->mi", mounting.springs + 1j * mounting.losses, travel)
            force = float(np.linalg.norm(forces, axis=1).sum())
            assert force <= line.constant + float(line.slopes @ numbers)
            # chords are over what they cover by what is told of them, and by nothing at their ends
            over = high.looseness(numbers)
            assert np.all(over >= 0.0)
            assert over.sum() <= sum(chord.bound(numbers).at_reference for chord in high.chords)
            tight = max(tight, force / line.largest)
    assert tight > 0.3


@pytest.mark.parametrize("norm", ["rms", "mean"])
def test_orders_without_load_have_no_bound(norm: str, tmp_path: Path) -> None:
    """Check that orders without load have no bound alone, and add nothing to others."""
    silent = f'minimise = "{norm} mount force"\norders = [3]\noperating_points = ["idle"]'
    problem = stiffness_problem(tmp_path, silent)
    assert spring_bound(Question(problem, 0.0, 0.0, problem.start)).bound == 0.0
    assert spring_bound(Question(problem, 1.0, 1e-4, problem.start)).bound == 0.0


def powertrain(orders: str, frequency: str, opened: int) -> dict[str, Any]:
    """Return the powertrain with so many open stiffnesses, and a limit on its lowest natural frequency."""
    import tomllib

    tables = tomllib.loads(POWERTRAIN.read_text(encoding="utf-8"))
    tables["constraints"] = [{"limit": "natural frequencies", "min": frequency}]
    tables["objective"] = {"minimise": "rms mount force", "orders": [int(h) for h in orders.split()]}
    tables["search"] = {"starts": 6}
    left = opened
    for place in tables["mounts"]["places"]:
        for k, number in enumerate(place["stiffness"]):
            if left:
                left -= 1
            else:
                place["stiffness"][k] = number["start"]
    return tables


@pytest.mark.slow
def test_four_springs_are_proven_in_a_few_boxes() -> None:
    """Check a proof in few boxes, where expansions leave a gap of a tenth after thousands."""
    problem = load(powertrain("2 4", "7 Hz", 4))
    result = solve(problem)
    assert result.certificate is not None
    assert result.objective is not None
    assert result.certificate.kind is Proof.GLOBAL
    value = result.objective.value
    near = [decision.value for decision in result.decisions]
    few = spring_bound(Question(problem, value, 1e-4 * value, near))
    assert 0 < few.boxes < 40
    many = divided_bound(replace(problem, search=replace(problem.search, boxes=400)), value, 1e-4 * value)
    assert many.bound < 0.9 * value < 0.999 * value < few.bound <= value


@pytest.mark.slow
def test_no_local_search_finds_less_than_the_bound_of_six_springs() -> None:
    """Compare with Nelder-Mead on the exact model, from far and near starts.

    With a tenth worse as target, the bound comes near to the best design, and no further.
    """
    from scipy.optimize import minimize

    problem = replace(load(powertrain("2 4", "7 Hz", 6) | {"search": {"starts": 1}}), tolerance=1e-3)
    result = solve(problem)
    assert result.certificate is not None
    bound, initial = result.certificate.lower_bound, evaluate(problem)
    low, high = (np.array([getattr(d, side) for d in problem.mount_decisions]) for side in ("lower", "upper"))

    def worth(s: np.ndarray) -> float:
        each = with_mounts(initial, problem.design(np.clip(low * (high / low) ** s, low, high).tolist()))
        return objective_value(problem, each) * (1.0 + 100.0 * max(each.violation(problem.limits), 0.0))

    best = np.log(np.array([decision.value for decision in result.decisions]) / low) / np.log(high / low)
    starts = [0.95 * best + 0.02, *np.random.default_rng(7).random((2, 6))]
    ends = [minimize(worth, start, method="Nelder-Mead", options={"maxfev": 150}) for start in starts]
    minimum = min(float(end.fun) for end in ends)
    assert minimum >= bound * (1.0 - 1e-6)
    assert result.certificate.kind is Proof.GLOBAL
    assert result.objective is not None
    few, value = replace(problem, search=replace(problem.search, boxes=4)), result.objective.value
    answer = spring_bound(Question(few, 1.1 * value, 1e-3 * value, [decision.value for decision in result.decisions]))
    assert 0.999 * value < answer.bound <= min(value, minimum) * (1.0 + 1e-9)


@pytest.mark.slow
def test_sums_over_samples_are_those_of_the_cycle_with_more_than_two_of_every_order(tmp_path: Path) -> None:
    boxes = relaxation_of(stiffness_problem(tmp_path, MEANS))
    ((weight, own),) = boxes._terms
    places = {order.index for order in own.orders}
    assert len(places) == 2
    fine, coarse = replace(own, samples=2 * max(places) + 1), replace(own, samples=2 * max(places))
    assert fine.is_sampled_fully
    assert not coarse.is_sampled_fully
    for second in (fine, coarse):
        boxes._terms = [(weight, fine), (weight, second)]
        assert boxes.is_sampled_fully is (second is fine)


PLACES = changed(MOUNTS, ('["300 mm", "200 mm", "0 mm"]', '[{ between = ["270 mm", "350 mm"] }, "200 mm", "0 mm"]'))


@pytest.mark.parametrize("mounts", [MOUNTS, PLACES], ids=["stiffness", "places too"])
def test_forces_of_a_motion_are_linear_in_stiffness_and_not_over_what_places_allow(tmp_path: Path, mounts: str) -> None:
    problem, generator = stiffness_problem(tmp_path, OBJECTIVES["rms"], mounts=mounts), np.random.default_rng(5)
    model = StiffnessBoxes(problem, 1.0).model if mounts is MOUNTS else None
    lower, upper = (np.array([getattr(d, side) for d in problem.mount_decisions]) for side in ("lower", "upper"))
    whole = open_mounts(problem, lower, upper)
    weights = generator.normal(size=(len(whole.motions), 3, 3))
    weights = weights + weights.transpose(0, 2, 1)
    near = np.zeros(whole.numbers)
    for x in generator.uniform(lower, upper, (12, len(lower))):
        mounting = mounting_in(problem.design(x.tolist(), problem.mount_decisions))
        if model is not None:
            near = numbers_of(whole, mounting)
            line = linear_sum(whole, weights, near)
            true = float(np.sum(weights * mounting.springs))
            assert line.constant + line.slopes @ near == pytest.approx(true, rel=1e-9)
            assert line.at_reference == pytest.approx(true, rel=1e-9)
        load = generator.normal(size=(6, 2)) @ [1.0, 1.0j]
        for m, (motion, spring) in enumerate(zip(mounting.motions, mounting.springs, strict=True)):
            travel = motion @ whole.root.T @ load
            true, over = (
                float((travel.conj() @ spring @ travel).real),
                float(np.sum(work_weight(whole, m, load) * spring)),
            )
            assert true <= over * (1.0 + 1e-9)
            assert over <= true * 1.0001 or mounts is PLACES
            assert over < 60.0 * true


def test_a_place_behind_the_middle_is_narrowed_at_both_ends(tmp_path: Path) -> None:
    """Check that narrowing keeps the better designs of a grid, and little more, for negative places."""
    fixed = MOUNTS.replace(OPEN_STIFFNESS, '"400 N/mm"').replace(
        '["-300 mm"', '[{ between = ["-400 mm", "-50 mm"], start = "-300 mm" }'
    )
    objective = '[objective]\nminimise = "rms mount force"\norders = [2]\n'
    problem = problem_of(tmp_path, ENGINE.replace("700 rpm", "500 rpm"), BLOCK, fixed, objective)
    evaluation, (place,) = evaluate(problem), problem.mount_decisions
    designs = np.linspace(place.lower, place.upper, 41)
    values = [objective_value(problem, with_mounts(evaluation, problem.design([x]))) for x in designs.tolist()]
    best, limit = float(designs[np.argmin(values)]), 1.01 * min(values)
    boxes = SdpRelaxation(problem, limit, 1e-3, [best])
    box, _ = narrowed(boxes, boxes.lower, boxes.upper, np.ones(len(boxes.lower)))
    assert box is not None
    better = designs[np.array(values) <= limit]
    assert better.min() - 0.02 < box[0][0] <= better.min() < better.max() <= box[1][0] < better.max() + 0.02


def test_no_response_on_hydraulic_mounts_exceeds_its_bound() -> None:
    """Check responses above all modes, at the stiffest corner, against a new solution for the motion."""
    problem = load(POWERTRAIN.with_name("powertrain-hydraulic.toml"))
    generator, chosen = np.random.default_rng(2), tuple(range(len(problem.engine.mounts)))
    corner = np.array([d.upper for d in problem.mount_decisions])
    mounts, tight = open_mounts(problem, corner, corner), 0.0
    mounting = mounting_in(problem.design(corner.tolist(), problem.mount_decisions))
    assert mounts.dynamic
    stiffness, loss, damping = (
        mounts.root @ mounting.total(each) @ mounts.root.T
        for each in (mounting.springs, mounting.losses, mounting.dampers)
    )
    for omega in math.sqrt(mounts.highest) * np.array([1.2, 1.5, 2.0, 4.0]):
        extra = mounts.dynamic.impedance(np.array([omega]), mounts.root.T)[0]
        full = stiffness + extra + 1j * (loss + omega * damping) - omega**2 * np.eye(6)
        for load_ in (np.linalg.eigh(stiffness + extra.real)[1][:, -1], *generator.normal(size=(5, 6))):
            travel = mounting.motions @ mounts.root.T @ np.linalg.solve(full, load_)
            maximum = response_bound(mounts, load_[None].astype(np.complex128), omega, True, chosen)
            response = float(np.linalg.norm(travel, axis=1).sum())
            assert response <= maximum * (1.0 + 1e-9)
            tight = max(tight, response / maximum)
    assert tight > 0.3


@pytest.mark.parametrize("share", [0.25, 0.5])
def test_a_share_of_a_norm_is_cut_off_at_the_norm_over_the_share(share: float, tmp_path: Path) -> None:
    """Check that a root with a share of the norm is cut off at the norm over this share."""
    boxes = relaxation_of(problem_of(tmp_path, ENGINE, BLOCK, MOUNTS, "[objective]\n" + OBJECTIVES["rms"]))
    ((variable,), *_), look = boxes._variables, boxes._box(0, boxes.lower, boxes.upper)
    whole, part = (
        look.cut_off([replace(variable, share=own, loss=0.0)], boxes._roots[0]).uppers[0] for own in (1.0, share)
    )
    assert part == pytest.approx(whole / share**2, rel=1e-12)
    # the reduction of the norm by other orders adds to the root
    lossy = look.cut_off([replace(variable, loss=0.3 * variable.unit)], boxes._roots[0]).uppers[0]
    assert math.sqrt(lossy) == pytest.approx(math.sqrt(whole) + 0.3, rel=1e-12)
