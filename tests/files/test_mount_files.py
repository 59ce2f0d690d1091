"""Elastic mounts in problem files: keys, and input that is refused in one clear line."""

from __future__ import annotations

import numpy as np
import pytest

from laufruhe.errors import InputError
from laufruhe.problem.channels import mounting_in
from laufruhe.problem.evaluation import evaluate
from mounts.files import BLOCK, ENGINE, MOUNTS, OPEN, SAG, changed, problem_of

RIGID = '[mounts]\npositions = [["1 m", "0.2 m", "0 m"], ["-1 m", "-0.2 m", "0 m"]]\n'


def test_numbers_decisions_and_mirrors_are_read(tmp_path):
    problem = problem_of(tmp_path, ENGINE, BLOCK, MOUNTS, SAG)
    decisions, mounts = problem.mount_decisions, problem.engine.mounts
    assert [d.name for d in decisions] == ["front left.stiffness.z", "rear left.stiffness.z"]
    assert [d.unit for d in decisions] == ["N/m"] * 2
    assert mounts[0].stiffness == pytest.approx((120e3, 120e3, 400e3))
    assert mounts[1].position == pytest.approx((0.3, -0.2, 0.0))
    assert all(mount.loss_factor == 0.1 for mount in mounts)
    changed_engine = problem.design([1e5, 3e5])
    assert [mount.stiffness[2] for mount in changed_engine.mounts] == pytest.approx([1e5, 1e5, 3e5, 3e5])


def test_a_mirrored_mount_is_the_mirror_image_when_turned_and_moved(tmp_path):
    text = changed(
        MOUNTS, ('"200 mm", "0 mm"]\nstiffness', '{ between = ["100 mm", "300 mm"], start = "150 mm" }, "50 mm"]\n'
                 'turned = [{ between = [0, 80] }, 20, 30]\nstiffness'),
    )  # fmt: skip
    problem = problem_of(tmp_path, ENGINE, BLOCK, text, SAG)
    values = [d.start for d in problem.mount_decisions]
    values[[d.name for d in problem.mount_decisions].index("front left.turned.x")] = 0.7
    left, right = problem.design(values).mounts[:2]
    mirror = np.diag([1.0, -1.0, 1.0])
    assert right.stiffness_matrix == pytest.approx(mirror @ left.stiffness_matrix @ mirror)
    assert left.stiffness_matrix[1, 2] != 0.0
    assert right.position == pytest.approx(mirror @ np.array(left.position))


def test_like_follows_stiffness_but_not_place(tmp_path):
    text = changed(
        MOUNTS, ('mirror_of = "front left"', 'like = "front left"\nposition = ["310 mm", "-190 mm", "5 mm"]')
    )
    problem = problem_of(tmp_path, ENGINE, BLOCK, text, SAG)
    mounts = problem.design([7e5, 3e5]).mounts
    assert mounts[1].stiffness == mounts[0].stiffness
    assert mounts[1].position == pytest.approx((0.31, -0.19, 0.005))


def test_a_range_of_speeds_becomes_points_that_share_their_weight(tmp_path):
    text = changed(ENGINE, ('speed = "700 rpm"', 'speed = "700 rpm"\nup_to = "2500 rpm"\nsteps = 4\nweight = 2'))
    points = problem_of(tmp_path, text, BLOCK, MOUNTS, SAG).points
    assert [round(p.speed * 30 / np.pi) for p in points] == [700, 1300, 1900, 2500]
    assert [p.weight for p in points] == [0.5] * 4
    assert points[1].name == "idle 1300 rpm"


def test_evaluation_has_forces_and_travel(tmp_path):
    problem = problem_of(tmp_path, ENGINE, BLOCK, MOUNTS, SAG)
    loads = evaluate(problem).loads[0]
    assert loads.mount_travel is not None
    mounting = mounting_in(problem.engine)
    expected = mounting.travel(loads.wrench, problem.points[0].speed).coefficients
    assert np.array_equal(loads.mount_travel.coefficients, expected)


REFUSED = {
    "negative stiffness": (MOUNTS.replace('"120 N/mm", "120 N/mm"', '"-120 N/mm", "120 N/mm"', 1), BLOCK, SAG,
                           r"mounts.places\[1\].stiffness\[1\] = .*: must be at least 0"),
    "wrong unit": (MOUNTS.replace('"120 N/mm", "120 N/mm"', '"120 mm", "120 N/mm"', 1), BLOCK, SAG,
                   r"'mm' is not a unit of a stiffness"),
    "no block": (MOUNTS, "", SAG, "block: is missing, but elastic mounts need the mass and inertia of the block"),
    "block on rigid": (RIGID, BLOCK, "", "block: needs elastic mounts"),
    "free mode": ('[mounts]\nkind = "elastic"\n[[mounts.places]]\nname = "a"\nposition = ["0 m", "0 m", "0.12 m"]\n'
                  'stiffness = ["1 N/mm", "1 N/mm", "1 N/mm"]\n', BLOCK, "",
                  "mounts: leave the block free in roll and pitch and yaw"),
    "reversed bounds": (MOUNTS.replace(OPEN, '{ between = ["9 N/mm", "3 N/mm"] }', 1), BLOCK, SAG, "bounds reversed"),
    "limits that contradict": (MOUNTS, BLOCK, SAG + 'min = "15 Hz"\n', "contradicts itself: at least 15 Hz and"),
    "speed for frequency": (MOUNTS, BLOCK, SAG.replace("40/3 Hz", "400 rpm"), "'rpm' is no frequency in Hz"),
    "unknown key": (MOUNTS.replace("loss_factor", "loss_facto"), BLOCK, SAG, "did you mean 'loss_factor'"),
    "unknown leader": (MOUNTS.replace('mirror_of = "rear left"', 'mirror_of = "rear lef"'), BLOCK, SAG,
                       "is not the name of a mount that stands before this one in the file; did you mean 'rear left'"),
    "follows already": (MOUNTS.replace('mirror_of = "rear left"', 'mirror_of = "rear left"\nloss_factor = 0.2'), BLOCK,
                        SAG, "already follows from mount 'rear left'"),
    "impossible inertia": (MOUNTS, BLOCK.replace("27 kg", "270 kg"), SAG, "block: .*belong to no body"),
    "massless block": (MOUNTS, BLOCK.replace("420 kg", "0 kg"), SAG, "block.mass .*must be more than 0"),
    "minimum of a peak": (MOUNTS, BLOCK, SAG + '[[constraints]]\nlimit = "maximum mount travel"\nmin = "1 mm"\n',
                          r"constraints\[2\].min: cannot stand beside mount travel"),
    "no side": (MOUNTS, BLOCK, SAG.replace('max = "40/3 Hz"', ""), "is missing; give min or max or outside"),
    "band upside down": (MOUNTS, BLOCK, SAG.replace('max = "40/3 Hz"', 'outside = ["9 Hz", "5 Hz"]'), "ends reversed"),
    "frequencies minimised": (MOUNTS, BLOCK, SAG.replace('"static sag"', '"natural frequencies"'),
                              "can be limited but not minimised"),
    "travel of rigid mounts": (RIGID, "", '[objective]\nminimise = "mean mount travel"\n', "needs elastic mounts"),
    "axis without frequency": (MOUNTS, BLOCK, SAG.replace("static sag", "torque-roll residual"),
                               "frequency: is missing"),
    "more than all energy": (MOUNTS, BLOCK, SAG + '[[constraints]]\nlimit = "kinetic-energy decoupling"\nmin = "1.2"\n',
                             "a share of energy above 1"),
    "unknown point": (MOUNTS, BLOCK, SAG + '[[constraints]]\nlimit = "transmissibility"\nmax = "1"\n'
                      'operating_points = ["idel"]\n', "did you mean 'idle'"),
    "range without steps": (MOUNTS, BLOCK, SAG, "steps: is missing"),
}  # fmt: skip


@pytest.mark.parametrize("case", sorted(REFUSED))
def test_wrong_input_is_one_clear_line(case, tmp_path):
    mounts, block, objective, expected = REFUSED[case]
    engine = ENGINE.replace('"700 rpm"', '"700 rpm"\nup_to = "900 rpm"') if case == "range without steps" else ENGINE
    with pytest.raises(InputError, match=expected) as caught:
        problem_of(tmp_path, engine, block, mounts, objective)
    lines = str(caught.value).splitlines()
    assert len(lines) == 1
    assert lines[0].startswith(str(tmp_path / "problem.toml"))


def test_a_band_is_kept_free_once_and_others_beside_it(tmp_path):
    bands = [f'[[constraints]]\nlimit = "natural frequencies"\noutside = ["{a} Hz", "{b} Hz"]\n' for a, b in
             ((12, 16), (20, 25), (12, 16))]  # fmt: skip
    objective = '[objective]\nminimise = "static sag"\n'
    assert len(problem_of(tmp_path, ENGINE, BLOCK, MOUNTS, objective, *bands[:2]).limits) == 2
    with pytest.raises(InputError, match=r"constraints\[3\]\.outside: limits '.*' once more, beside constraints\[1\]"):
        problem_of(tmp_path, ENGINE, BLOCK, MOUNTS, objective, *bands)
