"""Firing patterns: plain sums over time, states of operating points, closed forms, and every pattern one by one."""

from __future__ import annotations

import itertools
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import xarray as xr

from extensions.skip_fire.pattern_sums import PlainTorque, drawn
from lanes import first_fast
from laufruhe.errors import InputError
from laufruhe.extensions.flywheel.machine import Flywheel
from laufruhe.extensions.skip_fire.patterns import count_patterns, is_even, patterns, rotations
from laufruhe.extensions.skip_fire.torque import FiringModel
from laufruhe.files.cylinder_states import CylinderState
from laufruhe.files.reader import load, load_tables, tables_of
from laufruhe.physics.gas_loads import gas_loads
from laufruhe.plots.picture import draw
from laufruhe.problem.evaluation import evaluate
from laufruhe.problem.measure import MEASURES, Measure
from laufruhe.studies.kinds import KINDS
from laufruhe.studies.reader import load_study
from laufruhe.studies.runner import run
from problem_files import PROBLEMS, written

MISFIRE, VEE = PROBLEMS / "inline-four-misfire.toml", PROBLEMS / "vee-eight-cross.toml"
ROLL, FORCE, TRAVEL = (
    Measure(*MEASURES[name], alternating=True) for name in ("rms roll moment", "rms mount force", "rms mount travel")
)
PEAK, WORK, SPEED = (
    Measure(*MEASURES[name]) for name in ("maximum mount force", "peak to peak stored work", "degree of irregularity")
)


def model_of(path: Path, cycles: int = 1, state: str = "cut", inertia: float = 0.2) -> FiringModel:
    problem = load(path)
    engine = problem.engine.with_extra(Flywheel(inertia))
    problem = replace(problem, engine=engine, points=problem.points[:1])
    names, gas = tuple(part.name for part in engine.slider_cranks if part.bore != 0.0), problem.points[0].gas
    misfire, cut = (names, ()) if state == "misfire" else ((), names)
    skipped = CylinderState(misfire, cut, state == "open", "").gas(gas, engine.cycle, "skipped")
    return FiringModel(problem, gas, skipped, cycles)


@pytest.mark.parametrize(("length", "step"), [(1, 1), (6, 1), (8, 4), (9, 1), (9, 3), (10, 2)])
def test_patterns_are_all_words_up_to_rotation(length: int, step: int) -> None:
    for firings in range(length + 1):
        result = list(patterns(length, firings, step))
        words = {"".join(word) for word in itertools.product("01", repeat=length) if word.count("1") == firings}
        assert len(result) == count_patterns(length, firings, step)
        assert set().union(*(rotations(pattern, step) for pattern in result)) == words
        assert sum(len(rotations(pattern, step)) for pattern in result) == len(words)
        # a pattern is even if numbers of firings within windows of one length differ by one at most
        for word in words:
            counts = [
                [(word + word)[start : start + size].count("1") for start in range(length)] for size in range(1, length)
            ]
            assert is_even(word) == all(max(count) - min(count) <= 1 for count in counts)


@pytest.mark.parametrize("seed", first_fast(range(40), 0, 5))
def test_torque_is_the_plain_sum_over_cylinders_and_cycles(seed: int) -> None:
    case = drawn(seed)
    plain, model = PlainTorque(case), case.model
    engine, means = model.problem.engine, plain.means()
    gas = gas_loads(engine, model.skipped, model.problem.fidelity).mapped(lambda loads: loads[:, 3])
    torque = (gas + model.torque(case.pattern)).with_finer_base(engine.cycle.base_order / model.cycles)
    angles = np.random.default_rng(seed).uniform(0.0, torque.period, 300)
    exact = plain.at(angles)
    largest = np.abs(exact).max()
    # the closed form of kinks has eight digits, coefficients have more
    assert torque.values(angles) == pytest.approx(exact, abs=2e-8 * largest)
    coefficients = torque.padded(len(means["orders"])).coefficients[: len(means["orders"])]
    coefficients[0] *= 2.0
    assert np.abs(coefficients - means["waves"]).max() < 1e-9 * largest
    assert model.crank_torque(case.pattern).coefficients[0].real == pytest.approx(means["mean"], abs=1e-9 * largest)
    # orders beyond half the number of samples are left out
    assert model.evaluation(case.pattern).value(ROLL) == pytest.approx(means["rms"], rel=1e-6)


@pytest.mark.parametrize("name", first_fast(["inline-four-misfire", "vee-eight-cross", "two-stroke-three",
                                             "opposed-pistons-lead", "car-four-willans"], 0))  # fmt: skip
def test_all_firings_are_the_engine(name: str) -> None:
    """Compare a pattern of all firings over one and three cycles with the engine, in every measure."""
    for cycles in (1, 3):
        model = model_of(PROBLEMS / f"{name}.toml", cycles)
        measures = [ROLL, WORK, SPEED] + [FORCE, PEAK] * bool(model.problem.engine.mounts)
        usual, every = evaluate(model.problem), model.evaluation("1")
        assert [every.value(m) for m in measures] == pytest.approx([usual.value(m) for m in measures], rel=1e-8)


@pytest.mark.parametrize("state", ["cut", "open", "misfire"])
def test_fixed_patterns_are_states_of_operating_points(state: str) -> None:
    """Compare with the loads of an operating point that names the same cylinders: 3 and 2 of the order 1, 3, 4, 2."""
    tables = tables_of(MISFIRE)
    names = {"misfire": [2, 3]} if state == "misfire" else {"cut": [2, 3]}
    valves = {"cut_valves": "open"} if state == "open" else {}
    point = {"name": "half", "speed": "800 rpm", **names, **valves}
    problem = load_tables({**tables, "operating_points": [point]}, MISFIRE)
    engine = problem.engine.with_extra(Flywheel(0.2))
    core, model = evaluate(replace(problem, engine=engine)), model_of(MISFIRE, 2, state)
    pattern = model.evaluation("1010")
    measures = [ROLL, FORCE, TRAVEL, PEAK, WORK, SPEED]
    assert [pattern.value(m) for m in measures] == pytest.approx([core.value(m) for m in measures], rel=1e-8)


def test_spectrum_is_that_of_the_pattern_times_one_pulse() -> None:
    """Equal cylinders with even firing: each order is the discrete Fourier transform of the pattern at this order."""
    pattern = "1101000"
    model = model_of(MISFIRE, 7)
    torque, pulse = model.torque(pattern), model.opportunities[0].pulse
    # 28 opportunities of half a turn
    transform = np.fft.fft([int(fires) for fires in 4 * pattern])
    expected = pulse.coefficients * transform[np.arange(len(pulse.coefficients)) % 28]
    assert torque.base * 14 == 1
    assert torque.coefficients == pytest.approx(expected, abs=1e-12 * np.abs(expected).max())
    # firings of every other opportunity leave exact zeros between the orders 1, 2, ...
    assert model_of(MISFIRE, 5).torque("10").repeat_order() == 1


def test_speed_of_a_heavy_flywheel_follows_the_stored_work() -> None:
    """Check over three cycles that T3 tends to stored work over J w^2 (textbook eq. 25)."""
    model = model_of(MISFIRE, 3, inertia=1e4)
    design = model.evaluation("110")
    stored = design.value(WORK) / (1e4 * model.point.speed**2)
    assert design.value(SPEED) == pytest.approx(stored, rel=1e-4)
    # more than within the first cycle alone
    short = model_of(MISFIRE, 1, inertia=1e4).evaluation("1101").value(SPEED)
    assert abs(design.value(SPEED) / short - 1.0) > 0.05


def study(problem: Path, more: str, name: str = "p") -> str:
    head = f'title = "t"\n[study]\n[[study.parts]]\nname = "{name}"\nkind = "skip fire"\ntitle = "t"\n{more}\n'
    return f'{head}[[study.parts.cases]]\nname = "one"\nproblem = "{problem}"\n'


def computed(folder: Path, text: str) -> xr.Dataset:
    return run(load_study(written(folder, text, "study")), folder, folder / "kept")[0]["p"]


@pytest.mark.slow
def test_the_best_is_the_least_of_every_pattern(tmp_path: Path) -> None:
    """Compare with all words, without rotations, on elastic mounts; other patterns are best by the roll moment."""
    model = model_of(MISFIRE, 3)
    words = ["".join(word) for word in itertools.product("01", repeat=6) if word.count("1") == 3]
    every = {word: [model.evaluation(word).value(m) for m in (FORCE, ROLL)] for word in words}
    measures = [f'{{ quantity = "{name}", alternating = true }}' for name in ("rms mount force", "rms roll moment")]
    data = computed(
        tmp_path, study(MISFIRE, f"opportunities = [6]\ndemands = ['1/2']\nmeasures = [{','.join(measures)}]")
    )
    values = sorted(value for value, _ in every.values())
    assert data["value"].values[[0, -1], 0] == pytest.approx([values[0], values[-1]], rel=1e-9)
    assert data["alike"].values.sum() == data["different"].values[0] == count_patterns(6, 3, 2)
    assert set(data["compared"].values) == {len(words)}
    for pattern, row in zip(data["pattern"].values, data["value"].values, strict=True):
        assert row == pytest.approx(every[pattern], rel=1e-9)
    assert every[data["pattern"].values[0]][1] > min(value for _, value in every.values())


@pytest.mark.slow
def test_half_of_a_vee_eight_fires_every_other_cylinder(tmp_path: Path) -> None:
    """Production engines fire every other cylinder of the firing order (A. Rayl in EV World, 14 December 2004)."""
    set_wheel = '\n[study.parts.cases.set]\n"flywheel.inertia" = "0.4 kg m^2"\n"fidelity.samples" = 720\n'
    keys = 'opportunities = [8]\ndemands = ["1/2"]\nmeasures = [{ quantity = "degree of irregularity" }]'
    data = computed(tmp_path, study(VEE, keys) + set_wheel)
    assert data["pattern"].values[0] == "10101010"
    assert data["remark"].values[0] == "even; only cylinders 1, 4, 7, 6"
    assert data["value"].values[1, 0] > 1.5 * data["value"].values[0, 0]


@pytest.mark.slow
def test_fewest_firings_give_the_torque(tmp_path: Path) -> None:
    model = model_of(MISFIRE, 1)
    idle, full = (model.crank_torque(pattern).coefficients[0].real for pattern in "01")
    for share, firings in ((0.0, 0), (0.6, 5), (0.625, 5), (0.6251, 6), (1.0, 8)):
        demand = f"{max(idle + share * (full - idle), 0.0):.9f} N m"
        data = computed(tmp_path, study(MISFIRE, f"opportunities = [8]\ndemands = ['{demand}']"))
        assert set(data["firings"].values) == {firings}
        assert data["mean_torque"].values == pytest.approx(idle + firings / 8 * (full - idle), abs=1e-9)


@pytest.mark.slow
def test_the_study_has_tables_and_pictures(tmp_path: Path) -> None:
    keys = 'opportunities = [4, 5]\ndemands = ["1/1", "30 N m", "25 N m"]'
    data = computed(tmp_path, study(MISFIRE, keys))
    kind = KINDS["skip fire"]
    texts = kind.table(data)
    # two demands for one number of firings are compared once
    assert len(texts) == 2 * len(set(zip(data["opportunities"].values, data["firings"].values, strict=True))) == 8
    assert "Proof: all 1 patterns" in texts[0]
    assert texts[1].rows[0][0] == "`1111`"
    draw(kind.picture(data))


@pytest.mark.slow
def test_cases_have_their_own_measures(tmp_path: Path) -> None:
    text = study(MISFIRE, 'opportunities = [1]\ndemands = ["1/1", "0 N m"]')
    text += '[[study.parts.cases]]\nname = "two"\nproblem = "' + str(VEE) + '"\n'
    data = computed(tmp_path, text)
    texts = KINDS["skip fire"].table(data)
    assert [texts[k].head[2] for k in (1, 5)] == ["maximum alternating mount force [N]", "mean mount force [N]"]
    assert [texts[k].rows[0][-1] for k in (1, 3, 5, 7)] == ["even"] * 4
    assert "nan" not in str(texts)
    draw(KINDS["skip fire"].picture(data))


BAD = [
    (MISFIRE, 'opportunities = [4]\ndemands = ["1/3"]', "cannot fire 1/3 of 4 opportunities"),
    (MISFIRE, 'opportunities = [4]\ndemands = ["5/4"]', "is no share from 0 to 1"),
    (MISFIRE, 'opportunities = [4]\ndemands = ["50"]', "is no share from 0 to 1"),
    (MISFIRE, "opportunities = [4]\ndemands = [0.3]", "cannot fire 0.3 of 4 opportunities"),
    (MISFIRE, 'opportunities = [4]\ndemands = ["half"]', "is neither a share"),
    (MISFIRE, 'opportunities = [4]\ndemands = ["40 N m"]', "all give 34 N m"),
    (
        MISFIRE,
        'opportunities = [32]\ndemands = ["1/2"]',
        "skip fire: opportunities = 32: has more than 10000 patterns of 16 firings",
    ),
    (MISFIRE, 'opportunities = [4]\ndemands = ["1/2"]\noperating_point = "full"', "has no 'full'"),
    (
        MISFIRE,
        'opportunities = [4]\ndemands = ["1/2"]\nmeasures = [{ quantity = "rms crank torque" }]',
        "does not follow",
    ),
    (
        MISFIRE,
        'opportunities = [4]\ndemands = ["1/2"]\nmeasures = [{ quantity = "rms rod force" }]',
        "does not follow from its torque",
    ),
    (
        VEE,
        'opportunities = [4]\ndemands = ["1/2"]\nmeasures = [{ quantity = "added mass" }]',
        "does not follow from its torque",
    ),
    (PROBLEMS / "rotary-two.toml", 'opportunities = [4]\ndemands = ["1/2"]', "rotary"),
    (PROBLEMS / "klein-steam-pump.toml", 'opportunities = [4]\ndemands = ["1/2"]', "needs [gas] with model seiliger"),
    (PROBLEMS / "inline-five-open.toml", 'opportunities = [5]\ndemands = ["1/5"]', "needs [gas] with model seiliger"),
    (MISFIRE, 'opportunities = []\ndemands = ["1/2"]', "opportunities"),
    (MISFIRE, 'opportunities = [4]\ndemands = ["1/2"]\nskipped = "stopped"', "closed valves"),
]


@pytest.mark.parametrize("demand", ['"0.5"', "0.5", '"50 %"', '"50%"', '"2/4"'])
def test_a_share_is_a_fraction_a_number_or_in_percent(tmp_path: Path, demand: str) -> None:
    data = computed(tmp_path, study(MISFIRE, f"opportunities = [2]\ndemands = [{demand}]"))
    assert data["firings"].values.tolist() == [1]


@pytest.mark.parametrize(("problem", "keys", "said"), BAD)
def test_bad_parts_are_one_line(tmp_path: Path, problem: Path, keys: str, said: str) -> None:
    with pytest.raises(InputError) as caught:
        computed(tmp_path, study(problem, keys))
    assert said in str(caught.value)
    assert "\n" not in str(caught.value)


def test_uneven_speed_is_refused(tmp_path: Path) -> None:
    text = study(MISFIRE, 'opportunities = [4]\ndemands = ["1/2"]')
    with pytest.raises(InputError, match="needs loads by order"):
        computed(tmp_path, text + 'set = { "fidelity.crank_inertia" = "0.2 kg m^2" }')
