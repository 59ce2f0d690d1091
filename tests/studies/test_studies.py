"""Studies: results of each kind, independent of stops, cores and leftovers."""

from __future__ import annotations

import json
import os
import shutil
import signal
import subprocess
import sys
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import xarray as xr
from typer.testing import CliRunner

import laufruhe.studies.scenes
import ready
from laufruhe.cli import app
from laufruhe.cli import study as cli_study
from laufruhe.errors import InputError
from laufruhe.extension import HOMES
from laufruhe.extensions.sweeps.balancer_sizing import shaft_groups
from laufruhe.extensions.sweeps.layout_comparison import LayoutComparison
from laufruhe.files.reader import load
from laufruhe.files.study_tables import CaseTable
from laufruhe.problem.measure import MEASURES, Limit, Measure
from laufruhe.report.study_report import _flat
from laufruhe.solvers import solve
from laufruhe.studies import runner
from laufruhe.studies.kinds import KINDS
from laufruhe.studies.part import Part
from laufruhe.studies.reader import load_study
from laufruhe.studies.runner import run
from laufruhe.studies.scenes import Point, ProblemFiles
from laufruhe.studies.solved import solve_scene
from laufruhe.studies.stores import FINISHED_POINTS
from problem_files import PROBLEMS

SPEED = "operating_points.1.mean_piston_speed"
FRACTION = "counterweights.web.balance_factor"


@pytest.fixture(scope="module")
def small(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a folder with the single-cylinder at few samples, so that a point takes milliseconds."""
    folder = tmp_path_factory.mktemp("small")
    text = (PROBLEMS / "tractor-single.toml").read_text(encoding="utf-8")
    (folder / "single.toml").write_text(text + "\n[fidelity]\nsamples = 144\n", encoding="utf-8")
    return folder


def study(folder: Path, *parts: str) -> Path:
    path = folder / "s.toml"
    path.write_text('title = "t"\n[study]\n' + "".join(parts), encoding="utf-8")
    return path


def part(kind: str, cases: list[str], sweep: str = "", name: str = "p", more: str = "") -> str:
    head = f'[[study.parts]]\nname = "{name}"\nkind = "{kind}"\ntitle = "t"\n{more}\n{sweep}\n'
    return head + "".join(f'[[study.parts.cases]]\nname = "{case}"\nproblem = "{case}.toml"\n' for case in cases)


def swept(quantity: str, text: str) -> str:
    return f'[[study.parts.sweep]]\nquantity = "{quantity}"\n{text}\n'


def computed(path: Path, folder: Path = PROBLEMS, jobs: int = 1, points_file: Path | None = None) -> xr.Dataset:
    return run(load_study(path), folder, points_file or path.parent / "kept" / FINISHED_POINTS, jobs=jobs)[0]["p"]


def points_in(content: bytes) -> set[str]:
    """Return the marks and records of lines that are whole; times differ."""
    found = [line.partition(b" ")[2] for line in content.splitlines()]
    return {str(json.loads(line)[::2]) for line in found if line.endswith(b"}]")}


SPEEDS = swept(SPEED, 'from = "6 m/s"\nto = "12 m/s"\npoints = {}')


def test_every_kind_is_computed_and_shown() -> None:
    """Check each kind of study by what it declares."""
    homes = HOMES["study_kinds"].items()
    there = {name for name, home in homes if (Path(laufruhe.__file__).parent / "extensions" / home).exists()}
    assert set(KINDS) == {"percentile", *there}
    for kind in KINDS.values():
        for said in ("points", "answer", "dataset", "table", "picture"):
            assert getattr(kind, said) is not getattr(Part, said)


def test_fraction_at_its_optimum_beats_every_fraction_swept(tmp_path: Path, small: Path) -> None:
    """The study finds about half right; the row left open is proven, the swept ones are as given."""
    sweeps = swept(SPEED, 'values = ["8 m/s", "12 m/s"]') + swept(FRACTION, "from = 0\nto = 1\npoints = 6")
    data = computed(study(tmp_path, part("counterweight fraction", ["single"], sweeps)), small)
    assert data.sizes["point"] == 2 * (6 + 1)
    assert data[SPEED].attrs["units"] == "m/s"
    best = data["optimum"].values
    assert set(data["proof"].values[best]) == {"global"}
    assert set(data["proof"].values[~best]) == {"nothing open"}
    assert np.isnan(data["lower_bound"].values[~best]).all()
    for speed in (8.0, 12.0):
        line = data[SPEED].values == speed
        assert (data["objective"].values[line & best] <= data["objective"].values[line & ~best]).all()
        assert 0.4 < data[FRACTION].values[line & best].item() < 0.6


def test_fraction_over_speed_is_what_solve_finds(tmp_path: Path, small: Path) -> None:
    data = computed(study(tmp_path, part("counterweight fraction", ["single"], SPEEDS.format(3))), small)
    for k, speed in enumerate((6.0, 9.0, 12.0)):
        alone = solve(
            ProblemFiles(small).problem(Point(CaseTable(name="a", problem="single.toml"), {SPEED: f"{speed} m/s"}))
        )
        assert alone.objective is not None
        assert alone.certificate is not None
        assert data["objective"].values[k] == pytest.approx(alone.objective.value, rel=1e-8)
        assert data["lower_bound"].values[k] == pytest.approx(alone.certificate.lower_bound, rel=1e-6)
        # the optimum is flat, so decisions agree less
        assert data["decided"].values[k, 0] == pytest.approx(alone.decisions[0].value, rel=1e-4)


def test_a_couple_is_in_newton_metres_and_needs_no_mounts(tmp_path: Path, small: Path) -> None:
    text = (small / "single.toml").read_text(encoding="utf-8")
    start, end = text.index("[mounts]"), text.index("[[counterweights]]")
    (tmp_path / "free.toml").write_text(text[:start] + text[end:], encoding="utf-8")
    kind = part("counterweight fraction", ["free"], SPEEDS.format(2), more='metric = "rms rocking couple"')
    answer = CliRunner().invoke(app, ["study", str(study(tmp_path, kind)), "--out", str(tmp_path / "out")])
    assert answer.exit_code == 0, answer.output
    assert "rms rocking couple, initial [N m]" in (tmp_path / "out" / "report.md").read_text(encoding="utf-8")
    with xr.open_dataset(tmp_path / "out" / "p.nc") as data:
        assert data["objective"].attrs["units"] == "N m"
        assert not data.sizes.get("mount")


def test_sizing_has_every_set_of_shafts_once(tmp_path: Path) -> None:
    """Pairs that one decision drives are built together; more shafts are never worse."""
    name = "tractor-four-lanchester-and-moment"
    data = computed(study(tmp_path, part("balancer sizing", [name])))
    force, moment = "force left + force right", "moment left + moment right"
    assert data["shafts"].values.tolist() == ["none", force, moment, f"{force} + {moment}"]
    none, with_force, with_moment, both = data["objective"].values
    assert data["proof"].values.tolist() == ["nothing open", "global", "global", "global"]
    assert both <= min(with_force, with_moment)
    assert max(with_force, with_moment) <= none * (1.0 + 1e-4)
    alone = solve(load(PROBLEMS / f"{name}.toml"))
    assert alone.objective is not None
    assert both == pytest.approx(alone.objective.value, rel=1e-6)


def test_limits_on_absent_shafts_are_none(tmp_path: Path) -> None:
    """Check a limit on the mass of shafts for the plain engine without shafts."""
    problem = load(PROBLEMS / "tractor-four-lanchester.toml")
    assert problem.limits
    data = computed(study(tmp_path, part("balancer sizing", ["tractor-four-lanchester"])))
    assert data["objective"].values[0] == pytest.approx(data["objective_given"].values[0])
    assert data["objective"].values[-1] == pytest.approx(227.3, abs=0.1)


def test_mass_of_no_shafts_is_zero(tmp_path: Path) -> None:
    data = computed(study(tmp_path, part("balancer sizing", ["tractor-three"], more='metric = "balancer mass"')))
    assert data["objective"].values[0] == 0.0
    assert data["objective"].attrs["units"] == "kg"


def test_groups_follow_decisions() -> None:
    problem = load(PROBLEMS / "tractor-four-lanchester-and-moment.toml")
    assert shaft_groups(problem) == [("force left", "force right"), ("moment left", "moment right")]
    fixed = replace(problem, decisions=())
    assert len(shaft_groups(fixed)) == 4


def test_a_result_without_open_numbers_is_no_optimum(tmp_path: Path) -> None:
    path = study(tmp_path, part("layout comparison", ["boxer-four", "vee-six-90"]))
    shutil.copy(PROBLEMS / "boxer-four.toml", tmp_path)
    shutil.copy(PROBLEMS / "vee-six-90.toml", tmp_path)
    answer = CliRunner().invoke(app, ["study", str(path), "--out", str(tmp_path / "out"), "--json", "-"])
    assert answer.exit_code == 0, answer.output
    rows = [
        line
        for line in (tmp_path / "out" / "report.md").read_text(encoding="utf-8").splitlines()
        if "boxer" in line and line.startswith("|")
    ]
    assert rows[0].endswith("| nothing open |")
    parts = json.loads(answer.stdout)["parts"]["p"]
    assert parts["coords"]["proof"]["data"] == ["nothing open", "global"]
    assert parts["data_vars"]["lower_bound"]["data"][0] is None
    assert parts["seconds"] > 0.0


def test_designs_are_ranked_by_further_quantities(tmp_path: Path) -> None:
    """Compare with each solve; articulated rods have no pin force, and no weight is the least mass."""
    more = (
        'metric = "mean mount force"\nfurther = ["added mass", "maximum crank-pin force", "peak to peak stored work"]'
    )
    path = study(tmp_path, part("layout comparison", ["boxer-four", "vee-six-90"], more=more))
    data = computed(path)
    for k, name in enumerate(("boxer-four", "vee-six-90")):
        result = ready.solved(name)
        for j, quantity in enumerate(data["quantity"].values.tolist()):
            expected = result.final.value(Measure(*MEASURES[quantity]))
            assert data["further"].values[k, j] == pytest.approx(expected, rel=1e-6, abs=1e-9)
    *_, words, ranking = LayoutComparison.table(data)
    assert "Ranked" in words
    assert ranking.rows[0][0] == (
        "boxer-four" if data["objective"].values[0] < data["objective"].values[1] else "vee-six-90"
    )
    assert next(row for row in ranking.rows if row[0] == "boxer-four")[2] == "0 (1)"


def test_an_engine_without_a_further_quantity_says_why(tmp_path: Path, small: Path) -> None:
    """Check the reason in the cell of the engine without main bearings."""
    folder = tmp_path / "problems"
    shutil.copytree(small, folder)
    text = (folder / "single.toml").read_text(encoding="utf-8")
    bearings = '[[main_bearings]]\nbeside_throws = "50 mm"\n'
    (folder / "carried.toml").write_text(f"{text}\n{bearings}", encoding="utf-8")
    more = 'metric = "mean mount force"\nfurther = ["maximum main-bearing force"]\nflywheel_for = "1/50"'
    data = computed(study(tmp_path, part("layout comparison", ["single", "carried"], more=more)), folder)
    *_, ranking = LayoutComparison.table(data)
    assert ranking.head[-2:] == ["maximum main-bearing force [N]", "flywheel for 1/50 [kg m²]"]
    cells = {row[0]: row[2] for row in ranking.rows}
    assert cells["single"] == "– needs main bearings"
    assert cells["carried"].endswith(" (1)")
    assert data["why_none"].values.tolist() == [["needs main bearings", ""], ["", ""]]
    rows = _flat(data)
    # a reason stands under a head without a unit
    assert rows["why_none: maximum main-bearing force"].tolist() == ["needs main bearings", ""]
    assert rows["further: maximum main-bearing force [N]"][1] > 0.0
    wheel = data["further"].sel(quantity="flywheel for 1/50").values
    assert wheel[0] == wheel[1] > 0.0


def test_a_further_quantity_that_an_engine_lacks_is_one_line(tmp_path: Path) -> None:
    more = 'further = ["maximum main-bearing force"]'
    with pytest.raises(InputError, match="needs main bearings") as caught:
        computed(study(tmp_path, part("layout comparison", ["boxer-four"], more=more)))
    assert len(str(caught.value).splitlines()) == 1


def test_a_scene_of_two_names_is_solved_once_and_shown_twice(tmp_path: Path) -> None:
    text = (
        part("layout comparison", ["boxer-four"]) + '[[study.parts.cases]]\nname = "b"\nproblem = "boxer-four.toml"\n'
    )
    data = computed(study(tmp_path, text))
    assert data["case"].values.tolist() == ["boxer-four", "b"]
    assert np.ptp(data["objective"].values) == 0.0
    assert len(points_in((tmp_path / "kept" / FINISHED_POINTS).read_bytes())) == 1


def test_contradicting_limits_are_kept_as_such(tmp_path: Path) -> None:
    problem = load(PROBLEMS / "tractor-four-lanchester.toml")
    force = Limit("force", problem.objective[0].measure, 1.0)
    record = solve_scene(replace(problem, limits=(force,)))
    assert (record["status"], record["proof"]) == ("infeasible", "none")
    assert record["objective_given"] == pytest.approx(893.3, abs=0.1)
    assert np.isnan([record["objective"], record["lower_bound"], *record["mean"].values()]).all()


def test_goes_on_from_a_file_cut_anywhere(tmp_path: Path, small: Path) -> None:
    path = study(tmp_path, part("counterweight fraction", ["single"], SPEEDS.format(5)))
    points_file = tmp_path / "kept" / FINISHED_POINTS
    whole = computed(path, small, points_file=points_file)
    content = points_file.read_bytes()
    assert len(points_in(content)) == 5
    cut = tmp_path / "cut" / FINISHED_POINTS
    cut.parent.mkdir()
    for length in (1, len(content) // 2, len(content) - 1):
        cut.write_bytes(content[:length])
        assert computed(path, small, points_file=cut).identical(whole)
        assert points_in(cut.read_bytes()) == points_in(content)


def test_points_hang_on_all_that_they_use(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    text = (PROBLEMS / "tractor-single.toml").read_text(encoding="utf-8")
    start, end = text.index("[gas]"), text.index("[mounts]")
    gas = '[gas]\nmodel = "trace"\nfile = "trace.csv"\n\n'
    problem, trace = tmp_path / "single.toml", tmp_path / "trace.csv"
    problem.write_text(text[:start] + gas + text[end:], encoding="utf-8")
    trace.write_text("0, 60\n180, 2\n360, 1\n540, 1\n", encoding="utf-8")
    case = CaseTable(name="a", problem="single.toml")

    def mark(point: Point | None = None, settings: dict[str, object] | None = None) -> str:
        return ProblemFiles(tmp_path).fingerprint(point or Point(case), settings or {"kind": "x"})

    first = mark()
    assert mark() == first
    assert mark(Point(case.model_copy(update={"name": "another name"}))) == first
    others = [
        mark(Point(case, {SPEED: "9 m/s"})),
        mark(Point(case, metric="rms shaking force")),
        mark(Point(case, shafts=())),
        mark(Point(case.model_copy(update={"equal_power_to": 2}))),
        mark(settings={"kind": "y"}),
    ]
    trace.write_text("0, 61\n180, 2\n360, 1\n540, 1\n", encoding="utf-8")
    others.append(mark())
    problem.write_text(problem.read_text(encoding="utf-8").replace("1.25 kg", "1.26 kg"), encoding="utf-8")
    others.append(mark())
    monkeypatch.setattr(laufruhe.studies.scenes, "program", lambda: "another")
    others.append(mark())
    assert len({first, *others}) == 1 + len(others)


@pytest.fixture
def pool_at_once(monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    monkeypatch.setattr(runner, "POOL_PAYS", 0.0)
    return


def test_progress_says_how_long_is_left(monkeypatch: pytest.MonkeyPatch) -> None:
    """Check that the time left counts the points of this run alone, and that lines are rare."""
    now, said = [0.0], []
    monkeypatch.setattr(cli_study.time, "perf_counter", lambda: now[0])
    tell = cli_study._Progress(said.append)
    tell(5000, 10_000)
    now[0] = 10.0
    tell(5100, 10_000)
    now[0] = 10.1
    tell(5101, 10_000)
    tell(10_000, 10_000)
    assert said == ["5000 of 10000 points", "5100 of 10000 points, about 8 min left", "10000 of 10000 points"]


@pytest.mark.slow
def test_cores_change_nothing(tmp_path: Path, small: Path, pool_at_once: None) -> None:
    path = study(tmp_path, part("counterweight fraction", ["single"], SPEEDS.format(4)))
    one = computed(path, small, 1, tmp_path / "1" / FINISHED_POINTS)
    two = computed(path, small, 2, tmp_path / "2" / FINISHED_POINTS)
    assert one.identical(two)


@pytest.mark.slow
def test_an_error_of_a_worker_is_one_line(tmp_path: Path, small: Path, pool_at_once: None) -> None:
    """In the middle of this sweep the cycle cannot be met; its ends were tried before."""
    values = '["9 kp/cm^2", "8 kp/cm^2", "400 kp/cm^2", "7 kp/cm^2", "6 kp/cm^2"]'
    path = study(tmp_path, part("counterweight fraction", ["single"], swept("gas.imep", f"values = {values}")))
    with pytest.raises(InputError, match=r"gas.imep = 400 kp/cm\^2") as caught:
        computed(path, small, 2, tmp_path / "2" / FINISHED_POINTS)
    assert "\n" not in str(caught.value)


LONG = part("counterweight fraction", ["single"], SPEEDS.format(25))


@pytest.fixture(scope="module")
def whole(small: Path, tmp_path_factory: pytest.TempPathFactory) -> xr.Dataset:
    """Return an uninterrupted long study."""
    return computed(study(tmp_path_factory.mktemp("whole"), LONG), small)


# stops where it stands once three points are kept; on a slow machine too it has the time to say so when interrupted
HALTS = """
import time
import laufruhe.cli.supervised
from laufruhe.studies.stores import FinishedPoints
laufruhe.cli.supervised.PATIENCE = 300
keep, kept = FinishedPoints.keep, []
def keep_three(*words):
    keep(*words)
    kept.append(words)
    if len(kept) == 3:
        print("three", flush=True)
        time.sleep(1e4)
FinishedPoints.keep = keep_three
from laufruhe.cli import main
main()
"""


@pytest.mark.slow
@pytest.mark.parametrize("stop", [signal.SIGINT, signal.SIGKILL])
def test_stopped_study_goes_on(tmp_path: Path, small: Path, stop: signal.Signals, whole: xr.Dataset) -> None:
    shutil.copy(small / "single.toml", tmp_path)
    path = study(tmp_path, LONG)
    source = str(Path(laufruhe.studies.scenes.__file__).parents[2])
    environment = {**os.environ, "PYTHONPATH": source}
    out = tmp_path / "out"
    command = [sys.executable, "-c", HALTS, "study", str(path), "--out", str(out), "--jobs", "1"]
    # a test run in the background has its interrupts ignored, and hands that on
    restore = lambda: signal.signal(signal.SIGINT, signal.default_int_handler)  # noqa: E731
    pipes = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE}
    process = subprocess.Popen(command, env=environment, text=True, preexec_fn=restore, **pipes)  # type: ignore[call-overload]
    assert process.stdout.readline() == "three\n"
    process.send_signal(stop)
    said = process.communicate()[1]
    points_file = out / FINISHED_POINTS
    content = points_file.read_bytes()
    assert len(points_in(content)) == 3
    if stop is signal.SIGINT:
        assert process.returncode == 130
        assert said == "laufruhe: interrupted; finished points are kept, the same command goes on\n"
    data = computed(path, tmp_path, points_file=points_file)
    assert points_file.read_bytes().startswith(content)
    assert data.identical(whole)


@pytest.mark.parametrize(("star", "root", "second"), [("root-two", 2.0, True), ("root-ten", 10.0, False)])
def test_two_stroke_shaft_is_the_closed_form(star: str, root: float, second: bool) -> None:
    """Eqs. 30 and 31: U s = m r / 2 a sqrt(2) or sqrt(10); only the second star has no second order."""
    problem = load(PROBLEMS / f"tractor-two-stroke-four-{star}.toml")
    # gas torque stays whatever the shaft does
    result = solve(replace(problem, points=tuple(replace(point, gas=None) for point in problem.points)))
    size = next(d.value for d in result.decisions if d.name == "shaft.front.unbalance")
    # the solver's own tolerance on the unbalance, at a kink of the objective
    assert size * 0.5 == pytest.approx(1.25 * 0.06 / 2 * 0.125 * root**0.5, rel=2e-3)
    assert result.objective is not None
    left = result.objective.value / result.objective.initial
    assert left > 0.5 if second else left < 0.06
