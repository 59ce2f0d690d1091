"""More freedom and fewer limits are never worse; problems with hardly anything in them end in a design too."""

from __future__ import annotations

import re
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest

from lanes import first_fast
from laufruhe import solve
from laufruhe.numerics.norms import NORMS
from laufruhe.prove.certificate import Proof
from laufruhe.solvers import Result, Status
from problem_files import loaded

ENGINE = """
title = "in line"
[engine]
layout = "inline"
cycle = "two-stroke"
stroke = "90 mm"
rod_ratio = 0.27
reciprocating_mass = "{mass}"
cylinder_spacing = "100 mm"
throws = {throws}
[[operating_points]]
speed = "3000 rpm"
[mounts]
positions = [["300 mm", "200 mm", "0 mm"], ["250 mm", "-200 mm", "-60 mm"], ["-300 mm", "30 mm", "-40 mm"]]
[objective]
minimise = "{measure}"
"""
LOADS = ("mount force", "shaking force", "rocking couple", "roll moment")
WEIGHT = """
[[counterweights]]
name = "{name}"
x = {x}
radius = "60 mm"
mass = {mass}
angle = {angle}
"""
SIZE, TURN = '{{ between = ["0 kg", "{maximum:.3f} kg"] }}', "{{ between = [0, 360] }}"
FRONT = ('"40 mm"', SIZE, TURN)
# place, mass and angle of the weights; each has what those before it allow, and more
FREEDOM = (
    (('"40 mm"', '"0 kg"', "200"),),
    (('"40 mm"', SIZE, "200"),),
    (('"40 mm"', SIZE, "{{ between = [120, 260] }}"),),
    (FRONT,),
    (FRONT, ('"-70 mm"', SIZE, TURN)),
    (FRONT, ('{{ between = ["-90 mm", "-50 mm"] }}', SIZE, TURN)),
)


def _text(seed: int, weights: tuple[tuple[str, str, str], ...], more: str = "") -> str:
    generator = np.random.default_rng(seed)
    count = int(generator.integers(1, 5))
    throws = [0, *(int(angle) for angle in generator.integers(1, 359, count - 1))]
    measure = f"{list(NORMS)[seed % 4]} {LOADS[int(generator.integers(4))]}"
    maximum = generator.uniform(0.05, 1.5)
    text = ENGINE.format(mass="0.8 kg", throws=throws, measure=measure)
    for name, (x, mass, angle) in zip("ab", weights, strict=False):
        texts = (each.format(maximum=maximum) for each in (x, mass, angle))
        text += WEIGHT.format(**dict(zip(("x", "mass", "angle"), texts, strict=True)), name=name)
    return text + more


def _never_worse(found: list[Result]) -> None:
    for fewer, more in pairwise(found):
        if fewer.status is Status.INFEASIBLE:
            continue
        assert fewer.objective is not None
        assert more.objective is not None
        value = fewer.objective.value
        room = fewer.problem.tolerance * value + 1e-9 * more.objective.initial
        assert more.certificate is None or more.certificate.lower_bound <= value + 1e-9 * more.objective.initial
        # a bound that boxes of places could not close leaves its gap
        gap = more.certificate.gap if more.certificate is not None else 0.0
        assert more.objective.value <= value * (1.0 + gap) + room


@pytest.mark.parametrize("seed", first_fast((1, 2, 0, 4, 3), 2, 4))
def test_more_freedom_is_never_worse(seed: int, tmp_path: Path) -> None:
    _never_worse([solve(loaded(tmp_path, _text(seed, weights))) for weights in FREEDOM])


@pytest.mark.parametrize("seed", first_fast((1, 2, 0, 4, 3), 1, 3))
def test_fewer_limits_are_never_worse(seed: int, tmp_path: Path) -> None:
    tight, loose, other = (
        f'[[constraints]]\nlimit = "{limit}"\nmax = "{maximum}"\n'
        for limit, maximum in (("added mass", "0.02 kg"), ("added mass", "0.3 kg"), ("rms shaking force", "1900 N"))
    )
    texts = (_text(seed, FREEDOM[-2], more) for more in (tight + other, loose + other, loose, ""))
    _never_worse([solve(loaded(tmp_path, text)) for text in texts])


OPEN, NONE = "{ between = [0, 360] }", ()
EDGES = {
    "nothing open": ("0.8 kg", 3, NONE),
    "no masses": ("0 kg", 3, NONE),
    "no masses, one weight": ("0 kg", 3, (('"40 mm"', '{ between = ["0 kg", "1 kg"] }', OPEN),)),
    "one cylinder alone": ("0.8 kg", 1, NONE),
    "bounds that are one": ("0.8 kg", 2, (('"40 mm"', '{ between = ["0 kg", "0 kg"] }', "180"),)),
    "all at least bounds": ("0.8 kg", 2, (('"40 mm"', '{ between = ["9 kg", "10 kg"] }', "180"),)),
    "all at largest bounds": ("0.8 kg", 1, (('"0 mm"', '{ between = ["0 kg", "0.001 kg"] }', "180"),)),
    "48 cylinders": ("0.8 kg", 48, (('"40 mm"', '{ between = ["0 kg", "1 kg"] }', OPEN),)),
}


@pytest.mark.parametrize("measure", [f"{norm} {load}" for norm, load in zip(NORMS, (*LOADS, *LOADS), strict=False)])
@pytest.mark.parametrize("case", EDGES)
def test_minimal_problems(case: str, measure: str, tmp_path: Path) -> None:
    """Check a design no worse than the initial one, with its bound; a limit of zero is kept or named."""
    mass, count, weights = EDGES[case]
    text = ENGINE.format(mass=mass, throws=[97 * k % 360 for k in range(count)], measure=measure)
    for x, size, angle in weights:
        text += WEIGHT.format(name="a", x=x, mass=size, angle=angle)
    result = solve(loaded(tmp_path, text))
    assert result.objective is not None
    assert result.objective.value <= result.objective.initial
    if result.certificate is not None:
        assert result.certificate.kind is Proof.GLOBAL
    held = solve(
        loaded(tmp_path, text + '[[constraints]]\nname = "none"\nlimit = "rms rocking couple"\nmax = "0 N m"\n')
    )
    assert held.conflict == ("none",) if held.status is Status.INFEASIBLE else held.limits[0].value <= 1e-5


@pytest.mark.parametrize("scale", [(1e-6, 1.0, 1.0), (1e5, 1e-3, 1.0), (1.0, 1e2, 1e6), (1.0, 1.0, 1e-6)])
@pytest.mark.parametrize("seed", range(3))
def test_sizes_far_apart_keep_value_and_kind(seed: int, scale: tuple[float, float, float], tmp_path: Path) -> None:
    """Masses, speed and bounds a million times as large or small: forces follow, and the proof is the same."""
    mass, speed, bounds = scale
    limit = "" if seed else '[[constraints]]\nlimit = "rms shaking force"\nmax = "{:g} N"\n'

    def solved(m: float, n: float, b: float) -> Result:
        text = _text(seed, FREEDOM[3], limit.format(4000 * m * n * n))
        text = text.replace('"0.8 kg"', f'"{0.8 * m:g} kg"').replace("3000 rpm", f"{3000 * n:g} rpm")
        grown = re.sub(r'"0 kg", "([\d.]+) kg"', lambda found: f'"0 kg", "{float(found[1]) * b * m:.17g} kg"', text)
        return solve(loaded(tmp_path, grown))

    one, other = solved(1.0, 1.0, bounds), solved(mass, speed, bounds)
    assert one.status is other.status
    if one.objective is not None:
        assert one.certificate is not None
        assert other.objective is not None
        assert other.certificate is not None
        assert one.certificate.kind is other.certificate.kind is Proof.GLOBAL
        assert other.objective.value == pytest.approx(one.objective.value * mass * speed**2, rel=2e-4)
