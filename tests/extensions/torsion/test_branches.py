"""Geared branches, compared with openTorsion and with equations of all discs and gear constraints."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import opentorsion
import pytest
from scipy.linalg import eigh, null_space

import laufruhe
from lanes import first_fast
from laufruhe.errors import InputError
from laufruhe.extensions.torsion.machine import Absorber, Disc, ShaftSection, Torsion
from laufruhe.extensions.torsion.physics import (
    chain_of,
    critical_modes,
    dynamic_stiffness,
    natural_modes,
    receptances,
    section_stiffness,
)
from laufruhe.files.reader import tables_of
from laufruhe.numerics.arrays import Array
from laufruhe.physics.torque import turning_inertia
from problem_files import PROBLEMS

SEEDS = range(60)
TREES = first_fast(SEEDS, 10, 60)


def tree(seed: int) -> Torsion:
    """Return a random crankshaft of two to five discs, with up to four branches and two dampers."""
    random = np.random.default_rng(seed)
    count = int(random.integers(2, 6))
    discs = [Disc(f"{k}", random.uniform(0.01, 0.5), random.uniform(0.0, 0.5)) for k in range(count)]
    parents = list(range(count - 1))
    for _ in range(random.integers(1, 5)):
        parent = int(random.integers(0, len(discs)))
        ratio = discs[parent].ratio * random.choice([-1.0, 1.0]) * random.uniform(0.3, 3.0)
        for _ in range(random.integers(1, 4)):
            parents.append(parent)
            parent = len(discs)
            inertia = random.uniform(0.005, 0.2)
            discs.append(Disc(f"{parent}", inertia, random.uniform(0.0, 0.5), ratio=ratio))
    sections = [
        ShaftSection(f"s{k}", random.uniform(1e4, 1e6), random.uniform(0.0, 5.0)) for k in range(len(discs) - 1)
    ]
    absorbers = [
        Absorber(
            f"a{k}", discs[int(random.integers(len(discs)))].name, 0.01, random.uniform(1e3, 1e5), 0.0,
            random.uniform(0.0, 5.0),
        )
        for k in range(random.integers(0, 3))
    ]  # fmt: skip
    output = discs[int(random.integers(len(discs)))].name
    return Torsion(tuple(discs), tuple(sections), tuple(absorbers), output, None, tuple(parents))


class Full:
    """Equations of discs at their own angles, with two massless discs at each gear, tied by a constraint."""

    def __init__(self, chain: Torsion) -> None:
        links = [(a, b, s.stiffness, s.damping) for (a, b, _), s in zip(chain.links, chain.sections, strict=False)]
        count = len(chain.discs)
        links += [(chain.index(a.on), count + k, a.stiffness, a.damping) for k, a in enumerate(chain.absorbers)]
        self.count = count + len(chain.absorbers)
        self.ratio = np.array([*(d.ratio for d in chain.discs), *(chain.discs[chain.index(a.on)].ratio
                                                                 for a in chain.absorbers)])  # fmt: skip
        # gears (parent, node, ratio): a node on the faster or slower side that follows the parent
        self.gears: list[tuple[int, int, float]] = []
        self.ends: list[tuple[int, int]] = []
        size = self.count
        for a, b, *_ in links:
            own = self.ratio[b] / self.ratio[a]
            if own != 1.0:
                self.gears.append((a, size, own))
                a, size = size, size + 1
            self.ends.append((a, b))
        self.size, self.values = size, [(k, c) for *_, k, c in links]
        self.inertia = np.zeros(size)
        self.inertia[: self.count] = [*(d.inertia for d in chain.discs), *(a.inertia for a in chain.absorbers)]
        self.friction = np.zeros(size)
        self.friction[:count] = [d.damping for d in chain.discs]

    def matrices(self) -> tuple[Array, Array, Array, Array]:
        """Return inertia, damping, stiffness, and a basis of the angles that the gears allow."""
        stiffness, damping = np.zeros((self.size, self.size)), np.diag(self.friction)
        for (a, b), (k, c) in zip(self.ends, self.values, strict=True):
            row = np.zeros(self.size)
            row[a], row[b] = 1.0, -1.0
            stiffness += k * np.outer(row, row)
            damping += c * np.outer(row, row)
        constraints = np.zeros((len(self.gears), self.size))
        for row, (parent, node, ratio) in zip(constraints, self.gears, strict=True):
            row[parent], row[node] = ratio, -1.0
        free = null_space(constraints) if self.gears else np.eye(self.size)
        return np.diag(self.inertia), damping, stiffness, free


def assembly(chain: Torsion) -> opentorsion.Assembly:
    """Return the same tree in openTorsion, with an idler that restores the sense of turning."""
    full = Full(chain)
    discs = [
        opentorsion.Disk(k, I=i, c=c)
        for k, (i, c) in enumerate(zip(full.inertia[: full.count], full.friction, strict=False))
    ]
    shafts = [
        opentorsion.Shaft(min(ends), max(ends), k=k, c=c) for ends, (k, c) in zip(full.ends, full.values, strict=True)
    ]
    gears, size, first = [], full.size, {}
    for parent, node, ratio in full.gears:
        driver = first.setdefault(parent, opentorsion.Gear(parent, 0.0, 1.0))
        if driver not in gears:
            gears.append(driver)
        if ratio > 0.0:
            driver = opentorsion.Gear(size, 0.0, 1.0, driver)
            gears.append(driver)
            size += 1
        gears.append(opentorsion.Gear(node, 0.0, 1.0 / abs(ratio), driver))
    return opentorsion.Assembly(shafts, disk_elements=discs, gear_elements=gears)


@pytest.mark.parametrize("seed", TREES)
def test_natural_frequencies_of_trees(seed: int) -> None:
    chain = tree(seed)
    theirs = assembly(chain)
    squares = np.linalg.eigvals(np.linalg.solve(theirs.M, theirs.K))
    mass, _, stiffness, free = Full(chain).matrices()
    dense = eigh(free.T @ stiffness @ free, free.T @ mass @ free, eigvals_only=True)
    frequencies = natural_modes(chain).frequencies
    for others in (squares.real, dense):
        assert frequencies == pytest.approx(np.sqrt(np.sort(others)[1:]) / math.tau, rel=1e-9)


@pytest.mark.parametrize("seed", TREES)
def test_forced_response_of_trees(seed: int) -> None:
    """Compare the torque in every section with openTorsion, for a torque on each disc in three orders."""
    chain = tree(seed)
    full, speed, orders = Full(chain), 200.0, np.array([0.5, 2.0, 6.0])
    ours = receptances(chain, orders, speed) * section_stiffness(chain, orders, speed)[:, :, None]
    mass, damping, stiffness, free = full.matrices()
    theirs = assembly(chain)
    transform = theirs.T(theirs.E())
    count, sections = len(chain.discs), len(chain.sections)
    for h, order in enumerate(orders):
        rate = order * speed
        dynamic = stiffness + 1j * rate * damping - rate**2 * mass
        of_theirs = theirs.K + 1j * rate * theirs.C - rate**2 * theirs.M
        # a torque of one at crank speed is one over the ratio at the disc itself
        drives = np.zeros((len(transform), count))
        drives[np.arange(count), np.arange(count)] = 1.0 / full.ratio[:count]
        dense = free @ np.linalg.solve(free.T @ dynamic @ free, free.T @ drives[: full.size])
        opened = transform @ np.linalg.solve(of_theirs, transform.T @ drives)
        for angles in (dense, opened):
            twists = np.array([angles[a] - angles[b] for a, b in full.ends[:sections]])
            torque = twists * np.array([[k + 1j * rate * c] for k, c in full.values[:sections]])
            assert np.abs(ours[h] - torque).max() < 1e-9 * np.abs(torque).max()


@pytest.mark.parametrize("seed", TREES[:5])
def test_mean_torque_of_trees(seed: int) -> None:
    """Check that the mean torque of a disc goes through the sections between it and the load, over their ratios."""
    chain = tree(seed)
    mean = receptances(chain, np.zeros(1), 100.0)[0].real
    torque = mean * np.array([[s.stiffness] for s in chain.sections])
    for disc in range(len(chain.discs)):
        balance = np.zeros(len(chain.discs))
        balance[disc] += 1.0
        balance[chain.driven] -= 1.0
        for row, (front, rear, ratio) in zip(torque, chain.links, strict=False):
            balance[front] -= row[disc] * ratio
            balance[rear] += row[disc] * ratio
        assert balance == pytest.approx(np.zeros(len(chain.discs)), abs=1e-12)


def test_rule_of_equivalent_discs() -> None:
    """Compare a branch of ratio n with a straight shaft of J n^2, k n^2 and c n^2 (Den Hartog)."""
    chain = tree(3)
    straight = replace(
        chain,
        discs=tuple(
            replace(d, inertia=d.inertia * d.ratio**2, damping=d.damping * d.ratio**2, ratio=1.0) for d in chain.discs
        ),
        sections=tuple(
            replace(s, stiffness=s.stiffness * r**2, damping=s.damping * r**2)
            for s, (*_, r) in zip(chain.sections, chain.links, strict=False)
        ),
        absorbers=tuple(
            replace(a, **{key: getattr(a, key) * chain.discs[chain.index(a.on)].ratio ** 2
                          for key in ("inertia", "stiffness", "damping")})
            for a in chain.absorbers
        ),
    )  # fmt: skip
    orders = np.array([1.0, 3.5])
    theirs = dynamic_stiffness(straight, orders, 300.0)
    assert dynamic_stiffness(chain, orders, 300.0) == pytest.approx(theirs, rel=1e-13)
    assert critical_modes(chain, 2.0).frequencies == pytest.approx(critical_modes(straight, 2.0).frequencies, rel=1e-10)


BRANCH = {
    "on": "flywheel", "ratio": -2.5, "gear_inertia": "0.004 kg m^2",
    "discs": [{"name": "generator", "inertia": "0.02 kg m^2", "shaft": {"stiffness": "5e4 N m/rad"}}],
}  # fmt: skip


def test_branch_of_a_file() -> None:
    """Check that gear and generator count with their discs and with the turning inertia."""
    without = laufruhe.load(PROBLEMS / "inline-five-damper.toml")
    file = tables_of(PROBLEMS / "inline-five-damper.toml")
    file["torsion"]["branches"] = [BRANCH]
    engine = laufruhe.load(file).engine
    chain = chain_of(engine)
    assert chain.discs[chain.index("generator")].ratio == -2.5
    assert chain.driven == chain.index("flywheel")
    gain = chain.discs[chain.driven].inertia - chain_of(without.engine).discs[-1].inertia
    assert gain == pytest.approx(0.004 * 6.25)
    inertias = [turning_inertia(e, without.fidelity) or 0.0 for e in (engine, without.engine)]
    assert inertias[0] - inertias[1] == pytest.approx(0.024 * 6.25)
    # a gear of no mass
    file["torsion"]["branches"] = [{key: value for key, value in BRANCH.items() if key != "gear_inertia"}]
    plain = chain_of(laufruhe.load(file).engine)
    assert plain.discs[plain.driven].inertia == pytest.approx(chain_of(without.engine).discs[-1].inertia)


@pytest.mark.parametrize(("key", "value", "text"), [
    ("on", "flywhel", 'torsion.branches[1].on = "flywhel": is no disc before this branch; did you mean'),
    ("ratio", {"between": [1, 2]}, "torsion.branches[1].ratio"),
    ("discs", [], "torsion.branches[1].discs: is missing"),
])  # fmt: skip
def test_wrong_branches(key: str, value: object, text: str) -> None:
    file = tables_of(PROBLEMS / "inline-five-damper.toml")
    branch = BRANCH | {key: value}
    if key == "discs":
        del branch["gear_inertia"]
    file["torsion"]["branches"] = [branch]
    with pytest.raises(InputError) as error:
        laufruhe.load(file)
    assert text in str(error.value)
