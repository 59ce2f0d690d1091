"""Input that once took minutes or gigabytes is refused in one line."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

INPUTS = Path(__file__).parent / "inputs"


@pytest.mark.slow
def test_a_unit_of_powers_of_powers_ends() -> None:
    path = INPUTS / "power-of-powers.toml"
    words = [sys.executable, "-m", "laufruhe", "check", str(path)]
    done = subprocess.run(words, capture_output=True, text=True, check=False, timeout=120)
    assert (done.returncode, done.stdout) == (2, "")
    (line,) = done.stderr.splitlines()
    assert line.startswith(f"{path}: engine.stroke")
    assert "m**9**9**9**9" in line
    assert "120 mm" in line
