"""Scripts that nothing but `make bench` runs still find what they import."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

import laufruhe

SCRIPTS = Path(__file__).parents[1] / "benchmarks"


@pytest.mark.slow
def test_scripts_can_be_imported():
    names = ", ".join(sorted(path.stem for path in SCRIPTS.glob("*.py")))
    # of the package under test, wherever another one is installed
    own = {**os.environ, "PYTHONPATH": str(Path(laufruhe.__file__).parents[1])}
    words = [sys.executable, "-c", f"import {names}"]
    done = subprocess.run(words, cwd=SCRIPTS, env=own, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
