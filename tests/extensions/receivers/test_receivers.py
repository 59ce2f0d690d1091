"""Receivers of a file: values and proofs against an own evaluation, dependences, and complaints."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import laufruhe
from attack.families import toml
from extensions.receivers import tractor_seat
from extensions.receivers.plain_receivers import PlainReceivers, draw, functions
from lanes import first_fast
from laufruhe.errors import InputError, ModelError
from laufruhe.extensions.receivers.section import SECTION
from laufruhe.plots import figure
from laufruhe.problem.evaluation import evaluate
from laufruhe.problem.measure import MEAN_MOUNT_FORCE, Term
from laufruhe.problem.mount_resonance import evaluate_start
from laufruhe.problem.problem import Problem
from picture_faults import faults_of
from problem_files import PROBLEMS

UNITS = {"acceleration": "m/s^2", "velocity": "m/s", "pressure": "Pa"}


def written(table: dict[str, Any], folder: Path) -> Path:
    path = folder / "problem.toml"
    path.write_text(toml(table), encoding="utf-8")
    return path


def measured(path: Path, design: Any) -> float:
    """Return the value of the objective of a file for a design, by the own evaluation."""
    model = PlainReceivers(path)
    norm, _, quantity = model.table["objective"]["minimise"].partition(" receiver ")
    return model.value(design, model.table["objective"], norm, UNITS[quantity])


def random_designs(problem: Problem, count: int) -> list[Any]:
    rng, designs = np.random.default_rng(count), []
    for _ in range(count):
        values = [
            rng.uniform(d.lower, d.upper) * (np.exp(1j * rng.uniform(*d.set.angles)) if d.rotor_drives else 1.0)
            for d in problem.decisions
        ]
        designs.append(evaluate(problem, problem.design(values)))
    return designs


# mean, rms and maximum; a frame and rigid ground; points and transfer functions of both forces
DRAWN = [("pistons", 5), ("weights", 4), ("weights", 0), ("places", 4), ("places", 2)]


@pytest.mark.parametrize(("kind", "seed"), first_fast(DRAWN, 2))
def test_values_are_those_of_forces_over_the_cycle_and_no_bound_is_false(kind: str, seed: int, tmp_path: Path) -> None:
    path = written(draw(seed, tmp_path, kind), tmp_path)
    result = laufruhe.solve(laufruhe.load(path))
    assert result.objective is not None
    assert result.certificate is not None
    assert result.objective.value == pytest.approx(measured(path, result.final), rel=1e-6)
    assert result.certificate.kind == "global"
    values = [measured(path, design) for design in random_designs(result.problem, 4)]
    assert result.certificate.lower_bound <= min(values)


READY = {
    "motorcycle-handlebar": (1.343006, 1.401994),
    "tractor-seat": (0.0509373, 0.0731950),
    "marine-genset-deck": (0.00206808, 0.00330475),
}
"""Weighted response of the ready problems, and that of the design of least mean mount force."""


@pytest.mark.parametrize("name", first_fast(READY, 0))
def test_least_mount_force_is_not_least_response(name: str) -> None:
    """Both designs have the figures of the page of receivers."""
    path, (best, other) = PROBLEMS / f"{name}.toml", READY[name]
    problem = laufruhe.load(path)
    by_response = laufruhe.solve(problem)
    by_force = laufruhe.solve(problem.changed(objective=(Term(MEAN_MOUNT_FORCE),)))
    for result, value in ((by_response, best), (by_force, other)):
        assert result.certificate is not None
        assert result.certificate.kind == "global"
        assert result.final.value(problem.objective[0].measure) == pytest.approx(value, rel=1e-5)
    assert measured(path, by_response.final) == pytest.approx(best, rel=1e-5)


def test_functions_of_the_seat_are_those_of_its_model(tmp_path: Path) -> None:
    tractor_seat.write(tmp_path)
    for axis in "xyz":
        name = f"tractor-seat-{axis}.csv"
        assert (tmp_path / name).read_text(encoding="utf-8") == (PROBLEMS / name).read_text(encoding="utf-8")


def test_signals_are_affine_in_weights_and_masses(tmp_path: Path) -> None:
    """The middle of two designs has the mean of their signals, to rounding."""
    problem = laufruhe.load(written(draw(4, tmp_path, "pistons"), tmp_path))
    channel = problem.objective[0].measure.load
    first, last = random_designs(problem, 2)
    values = [[r.unbalance for r in d.engine.rotors] + [p.reciprocating_mass for p in d.engine.slider_cranks]
              for d in (first, last)]  # fmt: skip
    engine = replace(
        first.engine,
        rotors=tuple(
            replace(r, unbalance=0.5 * (a + b)) for r, a, b in zip(first.engine.rotors, *values, strict=False)
        ),
        slider_cranks=tuple(
            replace(p, reciprocating_mass=0.5 * (p.reciprocating_mass + other.reciprocating_mass))
            for p, other in zip(first.engine.slider_cranks, last.engine.slider_cranks, strict=True)
        ),
    )
    middle, a, b = (d.signals(channel)[0].coefficients for d in (evaluate(problem, engine), first, last))
    assert middle == pytest.approx(0.5 * (a + b), rel=1e-9, abs=1e-9 * np.abs(middle).max())


@pytest.mark.parametrize("mounts", ["rigid", "time"])
@pytest.mark.parametrize("with_frame", [False, True])
def test_motion_needs_mounts_in_the_frequency_domain(mounts: str, with_frame: bool, tmp_path: Path) -> None:
    table = plain(tmp_path)
    table["fidelity"], table["receivers"] = {"mounts": mounts}, table["receivers"][:1]
    table["objective"] = {"minimise": "rms receiver acceleration"}
    if not with_frame:
        del table["frame"]
    with pytest.raises(ModelError, match="needs mounts in the frequency domain"):
        laufruhe.evaluate(laufruhe.load(written(table, tmp_path)))


def test_open_mounts_give_a_local_optimum_without_a_bound(tmp_path: Path) -> None:
    table = draw(0, tmp_path, "mounts")
    table["search"] = {"starts": 2}
    del table["counterweights"], table["balancer_shafts"]
    result = laufruhe.solve(laufruhe.load(written(table, tmp_path)))
    assert result.certificate is not None
    assert (result.certificate.kind, result.certificate.lower_bound) == ("local", 0.0)
    assert result.objective is not None
    measure = result.problem.objective[0].measure
    assert result.objective.value <= min(design.value(measure) for design in random_designs(result.problem, 10))


def plain(folder: Path) -> dict[str, Any]:
    """Return a single with a point on its block, one with transfer functions, and a frame."""
    functions(np.random.default_rng(0), 3, folder / "f.csv")
    places = [["200 mm", "100 mm", "0 mm"], ["200 mm", "-100 mm", "0 mm"], ["-200 mm", "0 mm", "0 mm"]]
    return {
        "title": "t",
        "engine": {"layout": "inline", "cycle": "four-stroke", "stroke": "80 mm", "rod_ratio": 0.25,
                   "reciprocating_mass": "0.5 kg", "throws": [0]},
        "operating_points": [{"speed": "3000 rpm"}],
        "block": {"mass": "60 kg", "inertia": ["2 kg m^2", "2 kg m^2", "2 kg m^2"]},
        "mounts": {"kind": "elastic", "loss_factor": 0.1, "stiffness": ["200 N/mm"] * 3, "positions": places,
                   "names": ["m0", "m1", "m2"]},
        "frame": {"mass": "100 kg", "inertia": ["9 kg m^2"] * 3},
        "receivers": [
            {"name": "head", "point": ["0 mm", "0 mm", "300 mm"]},
            {"name": "seat", "transfer_functions": {"z": "f.csv"}, "force": "frame", "band": ["5 Hz", "200 Hz"]},
        ],
        "objective": {"minimise": "rms receiver acceleration", "receivers": ["seat"]},
    }  # fmt: skip


def test_an_undamped_resonance_is_infinite(tmp_path: Path) -> None:
    """The block bounces on its mounts at the frequency of order 1."""
    table = plain(tmp_path)
    del table["frame"]
    corners = [["200 mm", y, "0 mm"] for y in ("100 mm", "-100 mm")] + [
        ["-200 mm", y, "0 mm"] for y in ("100 mm", "-100 mm")
    ]
    bounce = 60.0 * (2.0 * np.pi * 50.0) ** 2 / 4.0
    stiff = {"between": ["100 N/mm", "9000 N/mm"], "start": f"{bounce!r} N/m"}
    table["mounts"] = {"kind": "elastic", "places": [
        {"name": f"m{k}", "position": place, "stiffness": ["200 N/mm", "200 N/mm", stiff]} if k == 0
        else {"name": f"m{k}", "position": place, "like": "m0"} for k, place in enumerate(corners)
    ]}  # fmt: skip
    functions(np.random.default_rng(0), 4, tmp_path / "f.csv")
    table["receivers"][1]["force"] = "rigid ground"
    problem = laufruhe.load(written(table, tmp_path))
    initial = evaluate_start(problem)
    assert initial.resonance
    measure = problem.objective[0].measure
    assert [initial.value(replace(measure, at=(name,))) for name in ("head", "seat")] == [np.inf, np.inf]


REFUSED = [
    ({"receivers.1.force": None}, "receivers[2].force: is missing: the forces that the functions apply to"),
    ({"frame": None}, 'receivers[2].force = "frame": needs the forces on a frame that moves'),
    ({"receivers.1.band": None}, "receivers[2].band: is missing, and f.csv has values from 2 Hz to 500 Hz alone"),
    ({"receivers.1.band": ["1 Hz", "200 Hz"]}, "reaches beyond f.csv, which has values from 2 Hz to 500 Hz"),
    ({"receivers.1.transfer_functions": {"sound": "f.csv"}}, "receivers[2].transfer_functions.sound: is no component"),
    ({"receivers.1.transfer_functions": {"z": "no.csv"}}, '"no.csv": cannot be read'),
    ({"receivers.1.weighting": "Wj"}, "receivers[2].weighting = \"Wj\": is no weighting and no file"),
    ({"receivers.1.weighting": ["Wd", "Wk"]}, "has 2 entries for 3 directions"),
    ({"receivers.0.unit": "Pa"}, "receivers[1].unit = \"Pa\": is no unit of motion"),
    ({"receivers.0.force": "frame"}, "receivers[1].force"),
    ({"receivers.0.point": None}, "receivers[1].point"),
    ({"receivers.0.name": "seat"}, "two receivers have one name"),
    ({"receivers.0.on": "frame", "frame": None, "receivers.1.force": "rigid ground"}, "receivers[1].on"),
    ({"receivers": None, "objective": {"minimise": "rms mount force"}}, "frame: acts on receivers alone"),
    ({"receivers": None, "frame": None}, "needs a receiver with unit m/s^2"),
    ({"objective.receivers": ["ear"]}, "objective.receivers"),
    ({"block": None, "mounts": {"names": ["m0", "m1", "m2"], "positions": [["1 m", "0 m", "0 m"], ["0 m", "1 m", "0 m"],
       ["0 m", "0 m", "0 m"]]}}, "frame: needs an engine on elastic mounts"),
]  # fmt: skip


@pytest.mark.parametrize(("changes", "text"), REFUSED)
def test_a_complaint_has_one_clear_line(changes: dict[str, Any], text: str, tmp_path: Path) -> None:
    table: Any = plain(tmp_path)
    for key, value in changes.items():
        *names, last = key.split(".")
        holder = table
        for name in names:
            holder = holder[int(name) if name.isdigit() else name]
        holder.pop(last) if value is None else holder.update({last: value})
    with pytest.raises(InputError) as error:
        laufruhe.load(written(table, tmp_path))
    assert text in str(error.value)
    assert "\n" not in str(error.value)


HEADS = [
    ("frequency [Hz],m0 x real,m0 x imaginary", "has no columns for the force on mount m0 y"),
    ("rpm,m0 x real,m0 x imaginary", "has 'rpm' as its first column"),
    ("1,2,3", "has no headings"),
]


@pytest.mark.parametrize(("head", "text"), HEADS)
def test_a_file_has_a_column_for_every_force(head: str, text: str, tmp_path: Path) -> None:
    table = plain(tmp_path)
    (tmp_path / "f.csv").write_text(f"{head}\n" + "".join(f"{f},1,0\n" for f in (2, 100, 500)), encoding="utf-8")
    with pytest.raises(InputError, match=text):
        laufruhe.load(written(table, tmp_path))


def test_a_curve_from_a_file_weights_the_response(tmp_path: Path) -> None:
    """A factor of two at every frequency doubles the response."""
    table = plain(tmp_path)
    (tmp_path / "twice.csv").write_text("frequency [Hz],factor\n1,2\n300,2\n", encoding="utf-8")
    values = []
    for weighting in ("none", "twice.csv"):
        table["receivers"][1]["weighting"] = weighting
        result = laufruhe.evaluate(laufruhe.load(written(table, tmp_path)))
        values.append(result.objective.value if result.objective else 0.0)
    assert values[1] == pytest.approx(2.0 * values[0], rel=1e-12)


def test_report_and_picture_show_the_response(tmp_path: Path) -> None:
    table = plain(tmp_path)
    table["receivers"][1]["weighting"] = "Wk"
    result = laufruhe.evaluate(laufruhe.load(written(table, tmp_path)))
    assert result.objective is not None
    (sheet,) = SECTION.tables(result)
    assert [row[1:3] for row in sheet.rows] == [("head", "none"), ("seat", "Wk")]
    assert SECTION.record is not None
    (point,) = SECTION.record(result)["seat"]["points"]
    assert point["rms"] == pytest.approx(result.objective.value, rel=1e-9)
    assert faults_of(figure(result, "receivers"), result.problem.title) == []
