"""Best of all cranks, compared with each crank by the exact model."""

import itertools
import math

import numpy as np
import pytest

from lanes import first_fast
from laufruhe.problem.evaluation import evaluate, objective_value
from laufruhe.problem.phasing import Candidate
from laufruhe.prove.certificate import Proof
from laufruhe.solvers import solve
from phasing import engines

CHANNELS = ("shaking force", "rocking couple", "mount force")
NORMS = ("rms", "mean", "maximum", "peak to peak")


def random_problem(folder, seed):
    """Return an engine that can fire evenly, its throws open, with a random sum of measures."""
    rng = np.random.default_rng(seed)
    cycle = ("two-stroke", "four-stroke")[seed % 2]
    vee = seed % 4 > 0
    count = int(rng.choice((4, 6, 8))) if vee else int(rng.integers(2, 6))
    step = 360.0 / (count // math.gcd(2 if cycle == "four-stroke" else 1, count))
    keys = ['throws = "open"', f'rotating_mass = "{rng.choice((0.0, 0.35))} kg"']
    if vee:
        bank = float(rng.choice((45.0, 90.0, 110.0, 160.0)))
        split = round(step * rng.integers(0, 3) - bank, 6) if rng.random() < 0.8 else 0.0
        if rng.random() < 0.2:
            keys += ["bank_angle = { between = [40, 130] }", f"split_pin_angle = {rng.choice((0.0, 12.0))}"]
        else:
            keys += [f"bank_angle = {bank}", f"split_pin_angle = {(split + 180.0) % 360.0 - 180.0}"]
        keys += [f'bank_stagger = "{rng.choice((0.0, 46.0, -20.0))} mm"']
    if rng.random() < 0.3:
        keys.append('offset = "4 mm"')
    terms = []
    for _ in range(rng.integers(1, 3)):
        orders = str(rng.choice(("", "orders = [1]", "orders = [2]", "orders = [1, 2, 4]")))
        measure = f"{rng.choice(NORMS)} {rng.choice(CHANNELS)}"
        terms.append(f'[[objective.terms]]\nquantity = "{measure}"\nweight = {rng.uniform(0.1, 3.0):.3f}\n{orders}')
    rest = engines.MOUNTS + "[objective]\n" + "\n".join(terms)
    layout = "vee" if vee else "inline"
    return engines.problem(folder, count, cycle, "\n".join(keys), "best = 4", rest, layout, samples=480)


def even_cranks(phasing, geometry):
    """Yield the throws of every crank whose dead centres are as many firings apart as there are cylinders."""
    layout, count = phasing.layout(*geometry), phasing.cylinders
    steps = count // math.gcd(phasing.cycle.turns, count)
    first = layout.banks[0] - layout.pin_offsets[0]
    for star in itertools.product(range(steps), repeat=len(layout.throw_positions) - 1):
        throws = tuple(first + math.tau * p / steps for p in (0, *star))
        own = [
            (b - o - throws[pin]) / math.tau * steps
            for b, o, pin in zip(layout.banks, layout.pin_offsets, layout.pins, strict=True)
        ]
        near = np.round(own)
        if np.allclose(own, near, atol=1e-6) and np.all(
            np.bincount(near.astype(int) % steps, minlength=steps) == count // steps
        ):
            yield throws


@pytest.mark.parametrize("seed", first_fast(range(160), 24, 36))
def test_the_best_of_all_even_cranks(tmp_path, seed):
    problem = random_problem(tmp_path, seed)
    phasing = problem.phasing
    values = []
    for geometry in phasing.geometries:
        for throws in even_cranks(phasing, geometry):
            crank = phasing.problem_of(Candidate(throws, None, *geometry))
            values.append(objective_value(crank, evaluate(crank)))
    result = solve(problem)
    if not values:
        assert result.objective is None
        return
    scale = 1e-3 * result.objective.initial + 1e-6
    assert result.objective.value == pytest.approx(min(values), rel=1e-3, abs=scale * 1e-3)
    assert result.certificate.kind is Proof.GLOBAL
    assert result.certificate.lower_bound <= min(values) * (1.0 + 1e-9) + 1e-6 * scale
    for entry in result.phasing.ranking:
        assert min(abs(entry.value - value) for value in values) <= 1e-3 * entry.value + 1e-3 * scale + 1e-9
        if entry.proven:
            better = sum(value < entry.value * (1.0 - 3e-4) - scale for value in values)
            assert better == 0 or result.phasing.ranking.index(entry) > 0
