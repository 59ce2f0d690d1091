"""Benchmark scripts: their imports, and their end after failures."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

import laufruhe

SCRIPTS = Path(__file__).parents[1] / "benchmarks"
SHORT = {
    "well": ("print('fine')", "s"),
    "wrong": ("print('no room'); raise SystemExit(3)", "FAILED with exit status 3"),
    "missing": ("from pages import skip; skip('no browser')", "left out: no browser"),
    "endless": ("import time; time.sleep(600)", "FAILED: took longer than 4 s"),
}


def ran(*words: str) -> subprocess.CompletedProcess[str]:
    """Run Python with the package under test, wherever another one is installed."""
    source = str(Path(laufruhe.__file__).parents[1])
    tables = {**os.environ, "PYTHONPATH": os.pathsep.join([source, str(SCRIPTS)])}
    return subprocess.run([sys.executable, *words], cwd=SCRIPTS, env=tables, capture_output=True, text=True)


@pytest.mark.slow
def test_scripts_can_be_imported_and_too_small_studies_are_refused():
    """Check imports, and the refusal of 4 scenes, of which a hundredth is none."""
    names = ", ".join(sorted(path.stem for path in SCRIPTS.glob("*.py")))
    done = ran("-c", f"import {names}; bench_cluster.main()", "--solves", "4")
    assert done.returncode == 2, done.stderr
    assert "4 is too few" in done.stderr


@pytest.mark.slow
def test_all_benchmarks_run_after_failures(tmp_path: Path):
    """Check that a benchmark that fails or exceeds its time is named, and that those after it run."""
    for name, (text, _) in SHORT.items():
        (tmp_path / f"{name}.py").write_text(text, encoding="utf-8")
    scripts = {name: tmp_path / f"{name}.py" for name in SHORT}
    program = "import every, sys; from pathlib import Path; every.SCRIPTS = {}; sys.exit(every.main())"
    paths = {name: str(path) for name, path in scripts.items()}
    given = program.format("{n: Path(p) for n, p in " + repr(paths) + ".items()}")
    done = ran("-c", given, "--limit", "4")
    lines = done.stdout.splitlines()
    assert done.returncode == 1, done.stderr
    for k, (name, (_, expected)) in enumerate(SHORT.items(), 1):
        (line,) = [line for line in lines if line.startswith(f"[{k}/{len(SHORT)}] {name} ... ")]
        assert expected in line
    assert "no room" in lines
    assert lines[-1].endswith("; 2 failed")
