"""Scripts that nothing but `make bench` runs still find what they import."""

import subprocess
import sys
from pathlib import Path

import pytest

SCRIPTS = Path(__file__).parents[1] / "benchmarks"


@pytest.mark.slow
def test_scripts_can_be_imported():
    names = ", ".join(sorted(path.stem for path in SCRIPTS.glob("*.py")))
    done = subprocess.run([sys.executable, "-c", f"import {names}"], cwd=SCRIPTS, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
