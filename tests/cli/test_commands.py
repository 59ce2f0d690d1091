"""Commands end to end: exit statuses, files, screen, and what stands in the way of writing."""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
from contextlib import chdir
from pathlib import Path

import pytest
from typer.testing import CliRunner, Result

import laufruhe.solvers
from cli import scenes
from laufruhe.cli import app
from laufruhe.errors import SolverError
from laufruhe.numerics.cores import ONE_THREAD
from problem_files import PROBLEMS, written

PAGES = {".laufruhe.json", "result.json", "report.md", "report.html"}
TABLES = {"tables.xlsx", "forces.csv", "orders.csv", "measures.csv", "piston-motion.csv", "side-force-reversals.csv"}
DECIDED = {"shafts.csv", "decisions.csv", "limits.csv", "weights.csv"}
ALL_FILES = PAGES | TABLES | DECIDED
ALL_FILES |= {f"{name}.svg" for name in ("engine", "polar", "ellipses", "cycle", "bars", "spectrum")}


def run(*words: object) -> Result:
    result = CliRunner().invoke(app, [str(word) for word in words])
    assert result.exception is None or isinstance(result.exception, SystemExit), result.exception
    return result


def tree(folder: Path) -> set[str]:
    return {str(path.relative_to(folder)) for path in folder.rglob("*") if path.is_file()}


def refused(result: Result, *words: str) -> None:
    """Check exit status 2 and one line with these words."""
    assert result.exit_code == 2
    assert result.stdout == ""
    assert len(result.stderr.splitlines()) == 1
    for word in words:
        assert word in result.stderr


@pytest.fixture(scope="module")
def with_pictures(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Result]:
    """Return a folder with a solved and drawn problem, and its result."""
    folder = tmp_path_factory.mktemp("drawn")
    path = written(folder, scenes.TIGHT, "tight")
    with chdir(folder):
        return folder, run("solve", path)


@pytest.fixture
def drawn(with_pictures: tuple[Path, Result], here: Path) -> Path:
    """Return the path of the problem with its results beside it."""
    shutil.copytree(with_pictures[0], here, dirs_exist_ok=True)
    return here / "tight.toml"


def test_solve_writes_everything_under_results(with_pictures: tuple[Path, Result]) -> None:
    folder, result = with_pictures
    assert result.exit_code == 0
    assert tree(folder / "results") == {f"tight/{name}" for name in ALL_FILES}
    assert "balancer mass" in result.stdout
    assert "N per kg" in result.stdout
    assert "proven optimum" in result.stdout
    assert not result.stderr


def test_evaluate_leaves_the_design_as_given(here: Path) -> None:
    path = written(here, scenes.TIGHT)
    assert run("evaluate", path, "--out", "given", "--no-plots").exit_code == 0
    record = json.loads((here / "given/result.json").read_text(encoding="utf-8"))
    assert record["objective"]["value"] == record["objective"]["initial"]
    assert record["decisions"] == {}
    assert record["certificate"]["kind"] == "none"
    assert record["constraints"][0]["value"] == 0.0


def test_check_says_what_is_open_and_writes_nothing(here: Path) -> None:
    path = written(here, scenes.TIGHT)
    result = run("check", path)
    assert result.exit_code == 0
    assert result.stdout.startswith("ok: ")
    assert len(result.stdout.splitlines()) == 1
    assert "left.unbalance" in result.stdout
    assert tree(here) == {"scene.toml"}


def test_json_on_standard_output_is_pure(here: Path) -> None:
    result = run("solve", written(here, scenes.TIGHT), "--json", "-", "--no-plots")
    assert json.loads(result.stdout)["status"] == "optimal"
    assert "mount 1" in result.stderr
    assert result.stdout == (here / "results/scene/result.json").read_text(encoding="utf-8")


def test_json_file_is_the_result(here: Path) -> None:
    run("solve", written(here, scenes.TIGHT), "--json", "deep/answer.json", "--no-plots")
    assert (here / "deep/answer.json").read_bytes() == (here / "results/scene/result.json").read_bytes()
    assert tree(here / "deep") == {"answer.json"}


@pytest.mark.skipif(not Path("/dev/null").is_char_device(), reason="needs a device file")
def test_json_to_a_device_leaves_the_device(here: Path) -> None:
    assert run("solve", written(here, scenes.TIGHT), "--json", "/dev/null", "--no-plots").exit_code == 0
    assert Path("/dev/null").is_char_device()


def test_infeasible_names_the_conflict_and_is_written(here: Path) -> None:
    result = run("solve", written(here, scenes.IMPOSSIBLE), "--no-plots")
    assert result.exit_code == 1
    record = json.loads((here / "results/scene/result.json").read_text(encoding="utf-8"))
    assert record["status"] == "infeasible"
    assert set(record["conflict"]) == {"light shafts", "quiet mounts"}
    for name in record["conflict"]:
        assert name in result.stderr
    assert "idle limit" not in result.stderr


def test_a_solver_that_gives_up_is_a_failed_result(here: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def give_up(*_: object, **__: object) -> None:
        raise SolverError("the cone solver gave up")

    monkeypatch.setattr(laufruhe.solvers, "solve", give_up)
    result = run("solve", written(here, scenes.TIGHT), "--no-plots")
    assert result.exit_code == 1
    assert "gave up" in result.stderr
    assert json.loads((here / "results/scene/result.json").read_text(encoding="utf-8"))["status"] == "failed"


def test_an_interrupt_leaves_nothing(here: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def interrupt(*_: object, **__: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr(laufruhe.solvers, "solve", interrupt)
    path = written(here, scenes.TIGHT)
    result = run("solve", path, "--json", "answer.json")
    assert result.exit_code == 130
    assert result.stderr == "laufruhe: interrupted, nothing was written\n"
    assert list(here.iterdir()) == [path]


def test_an_interrupt_keeps_the_earlier_result(here: Path, drawn: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    before = {name: (here / "results/tight" / name).read_bytes() for name in ALL_FILES}

    def interrupt(*_: object, **__: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr("laufruhe.cli.drawing.processors", lambda: 1)
    monkeypatch.setattr("laufruhe.plots.draw_and_show", interrupt)
    assert run("solve", drawn).exit_code == 130
    assert {name: (here / "results/tight" / name).read_bytes() for name in ALL_FILES} == before
    assert {entry.name for entry in (here / "results/tight").iterdir()} == ALL_FILES


def test_pictures_of_another_result_do_not_stay(here: Path, drawn: Path) -> None:
    (here / "results/tight/notes.txt").write_text("mine")
    run("solve", drawn, "--no-plots")
    assert tree(here / "results/tight") == PAGES | TABLES | DECIDED | {"notes.txt"}
    assert tree(here / "results") == {f"tight/{name}" for name in tree(here / "results/tight")}


def test_solve_and_evaluate_have_places_of_their_own(here: Path) -> None:
    path = written(here, scenes.TIGHT)
    run("solve", path, "--no-plots")
    before = (here / "results/scene/result.json").read_bytes()
    run("evaluate", path, "--no-plots")
    assert (here / "results/scene/result.json").read_bytes() == before
    assert (here / "results/scene-initial/result.json").is_file()
    refused(run("evaluate", path, "--out", "results/scene"), "--out", "holds the results of laufruhe solve")


def test_files_of_others_are_never_overwritten(here: Path) -> None:
    path = written(here, scenes.TIGHT)
    (here / "mine").mkdir()
    (here / "mine/report.md").write_text("mine")
    for out in (".", "mine", "..", here):
        refused(run("solve", path, "--out", out), "--out")
    assert run("evaluate", path, "--no-plots").exit_code == 0
    (here / "results/scene-initial/cycle.svg").write_text("mine")
    refused(run("evaluate", path), "results", "'cycle.svg', which Laufruhe did not make")
    for name, text in (("trace.csv", "1,2\n"), ("package.json", '{"name": 1}'), ("deep.json", "[" * 5000),
                       ("book.json", '{"title": "mine"}'), ("list.json", '[{"problem": 1}]')):  # fmt: skip
        (here / name).write_text(text)
        refused(run("check", path, "--json", name), "--json", "did not make")
        assert (here / name).read_text() == text
    assert (here / "mine/report.md").read_text() == "mine"
    assert (here / "results/scene-initial/cycle.svg").read_text() == "mine"
    for _ in range(2):
        assert run("check", path, "--json", "own.json").exit_code == 0


@pytest.mark.parametrize("command", ["solve", "evaluate", "check"])
def test_bad_input_is_refused(here: Path, command: str) -> None:
    refused(run(command, "missing.toml"), "missing.toml", "does not exist")
    wrong = written(here, scenes.TIGHT.replace('stroke = "120 mm"', 'stroke = "120 kg"'))
    refused(run(command, wrong), "scene.toml", "engine.stroke", "not a unit of a length")
    assert tree(here) == {"scene.toml"}


@pytest.mark.parametrize("command", ["solve", "evaluate", "check"])
def test_a_load_that_no_mount_carries_is_bad_input(here: Path, command: str) -> None:
    path = written(here, scenes.UNCARRIED)
    refused(run(command, path), "scene.toml", "no mount carries")
    assert list(here.iterdir()) == [path]


def test_every_complaint_gets_a_line(here: Path) -> None:
    text = scenes.TIGHT.replace("rod_ratio", "rod_ration").replace('"1.25 kg"', '"-1 kg"')
    result = run("solve", written(here, text))
    assert result.exit_code == 2
    lines = result.stderr.splitlines()
    assert len(lines) == 2
    assert all("scene.toml" in line for line in lines)
    assert "did you mean 'rod_ratio'?" in result.stderr


@pytest.mark.parametrize("tolerance", ["0", "-1", "nan", "inf", "1", "2"])
def test_a_tolerance_is_a_share(here: Path, tolerance: str) -> None:
    path = written(here, scenes.TIGHT)
    refused(run("solve", path, "--tolerance", tolerance), "--tolerance")
    assert list(here.iterdir()) == [path]


def test_the_tolerance_is_used(here: Path) -> None:
    path = written(here, scenes.TIGHT)
    run("solve", path, "--tolerance", "1e-2", "--no-plots")
    record = json.loads((here / "results/scene/result.json").read_text(encoding="utf-8"))
    assert record["status"] == "optimal"
    report = (here / "results/scene/report.md").read_text(encoding="utf-8")
    assert f"\nlaufruhe solve {path} --no-plots --tolerance 0.01\n" in report


class TestUnwritable:
    """Found out before anything is solved; nothing is left behind."""

    @pytest.fixture(autouse=True)
    def _no_solver(self, monkeypatch: pytest.MonkeyPatch) -> None:
        def solve(problem: object) -> None:
            raise AssertionError("solved before the output was checked")

        monkeypatch.setattr(laufruhe.solvers, "solve", solve)

    def test_a_file_stands_where_the_folder_goes(self, here: Path) -> None:
        path = written(here, scenes.TIGHT)
        (here / "results").write_text("a file")
        refused(run("solve", path), "results", "cannot be written")
        refused(run("solve", path, "--out", path), "--out", "is not a folder")
        refused(run("solve", path, "--out", path / "deeper"), "--out")
        assert tree(here) == {"scene.toml", "results"}

    def test_a_folder_stands_where_a_file_goes(self, here: Path) -> None:
        path = written(here, scenes.TIGHT)
        (here / "out/result.json").mkdir(parents=True)
        refused(run("solve", path, "--out", "out"), "--out", "did not make")
        assert list((here / "out").iterdir()) == [here / "out/result.json"]

    @pytest.mark.skipif(not Path("/proc/self").exists(), reason="needs a folder that nobody can write to")
    def test_nobody_can_write_there(self, here: Path) -> None:
        path = written(here, scenes.TIGHT)
        refused(run("solve", path, "--out", "/proc/laufruhe"), "--out", "/proc/laufruhe")
        refused(run("solve", path, "--json", "/proc/laufruhe/answer.json"), "--json")
        assert list(here.iterdir()) == [path]

    @pytest.mark.skipif(not hasattr(os, "geteuid") or os.geteuid() == 0, reason="root may write anywhere")
    def test_permission_is_missing(self, here: Path) -> None:
        path = written(here, scenes.TIGHT)
        (here / "locked").mkdir(mode=0o500)
        refused(run("solve", path, "--out", "locked"), "--out", "Permission denied")

    def test_json_is_a_folder(self, here: Path) -> None:
        path = written(here, scenes.TIGHT)
        refused(run("solve", path, "--json", here), "--json", "is a folder")
        assert list(here.iterdir()) == [path]

    def test_json_is_the_problem(self, here: Path) -> None:
        path = written(here, scenes.TIGHT)
        refused(run("solve", path, "--json", path), "--json", "is the problem file")
        assert path.read_text(encoding="utf-8") == scenes.TIGHT


def test_a_name_of_dots_stays_under_results(here: Path) -> None:
    assert run("evaluate", written(here, scenes.GIVEN, "..."), "--no-plots").exit_code == 0
    assert tree(here / "results") == {f"problem-initial/{name}" for name in PAGES | TABLES}


def test_markup_in_a_title_is_text(here: Path) -> None:
    title = "[red]x[/red] :smile: $a $b | <b> *c*"
    path = written(here, scenes.GIVEN.replace("Four in line", title))
    result = run("evaluate", path, "--no-plots")
    assert result.exit_code == 0
    assert title in result.stdout


def in_a_process(
    *words: str, code: str = "from laufruhe.cli import main; main()", env: dict[str, str] | None = None
) -> subprocess.CompletedProcess[str]:
    return subprocess.run([sys.executable, "-c", code, *words], capture_output=True, text=True, check=False, env=env)


def test_help_imports_no_heavy_library() -> None:
    code = (
        "import sys\n"
        "from laufruhe.cli import app\n"
        "app(['--help'], standalone_mode=False)\n"
        "heavy = {'numpy', 'cvxpy', 'casadi', 'matplotlib', 'scipy', 'pint', 'pydantic', 'pandas'} & set(sys.modules)\n"
        "assert not heavy, heavy\n"
    )
    done = in_a_process(code=code)
    assert done.returncode == 0, done.stderr
    assert "solve" in done.stdout


@pytest.mark.parametrize(("given", "threads"), [({}, ["1"] * 3), ({"OPENBLAS_NUM_THREADS": "2"}, ["2"])])
def test_linear_algebra_of_a_command_takes_one_thread_by_default(given: dict[str, str], threads: list[str]) -> None:
    """Check that a command sets one thread before NumPy starts, and an import keeps the environment."""
    code = (
        "import os, sys\n"
        "from laufruhe.cli import commands\n"
        "from laufruhe.numerics.cores import ONE_THREAD\n"
        "said = lambda: [os.environ[name] for name in ONE_THREAD if name in os.environ]\n"
        "before = said()\n"
        "commands.supervised = lambda _: print('numpy' in sys.modules, before, said())\n"
        "commands.main()\n"
    )
    around = {name: value for name, value in os.environ.items() if name not in ONE_THREAD} | given
    done = in_a_process(code=code, env=around)
    assert done.stdout == f"False {list(given.values())} {threads}\n", done.stderr


@pytest.mark.slow
def test_evaluate_and_check_need_no_solver(tmp_path: Path) -> None:
    path = written(tmp_path, scenes.GIVEN)
    code = (
        "import sys\n"
        "from laufruhe.cli import app\n"
        "for path in sys.argv[2:]:\n"
        "    app([sys.argv[1], path, *()], standalone_mode=False)\n"
        "assert not {'cvxpy', 'casadi', 'matplotlib'} & set(sys.modules)\n"
    )
    # a check loads no library that takes as long as all the rest of it
    heavy = ("cvxpy", "casadi", "clarabel", "scipy", "pint", "xarray", "pandas")
    light = code.replace("{'cvxpy', 'casadi', 'matplotlib'}", str({*heavy, "matplotlib"}))
    names = ("tractor-four-lanchester", "inline-five-torsion", "tractor-sweeps")
    done = in_a_process("check", *(str(PROBLEMS / f"{name}.toml") for name in names), code=light)
    assert done.returncode == 0, done.stderr
    ends = ["--no-plots", "--out", str(tmp_path / "out")]
    done = in_a_process("evaluate", str(path), code=code.replace("*()", f"*{ends}"))
    assert done.returncode == 0, done.stderr


def test_check_answers_in_json_and_makes_no_folder(here: Path) -> None:
    """Check that `check --json -` prints the initial design as pure JSON and writes no file."""
    answer = run("check", scenes.READY, "--json", "-")
    assert answer.exit_code == 0
    assert json.loads(answer.stdout)["status"] == "feasible"
    assert tree(here) == set()


def test_python_interface_answers_more_than_once() -> None:
    """The functions of the package are not shadowed by its rooms."""
    import laufruhe

    problem = laufruhe.load(scenes.READY)
    first, second = laufruhe.solve(problem), laufruhe.solve(problem)
    assert first.objective == second.objective
    assert laufruhe.evaluate(problem).objective == laufruhe.evaluate(problem).objective
    assert laufruhe.evaluate(problem.engine, problem.points).objective is not None
