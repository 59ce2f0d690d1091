"""CasADi is loaded where something open needs it, and what needs it says so where it is missing."""

from __future__ import annotations

import subprocess
import sys

import pytest

from problem_files import PROBLEMS

SCRIPT = """
import sys
sys.modules |= {"casadi": None}
import laufruhe
from laufruhe.errors import SolverError
print(laufruhe.solve(sys.argv[1]).status)
try:
    laufruhe.solve(sys.argv[2])
except SolverError as error:
    print(error)
"""


QUICK = """
import sys
sys.modules |= dict.fromkeys(("casadi", "cvxpy", "matplotlib", "pandas", "scipy", "xarray"))
import laufruhe
print(laufruhe.solve(sys.argv[1]).status)
"""


@pytest.mark.slow
def test_counterweights_and_shafts_are_decided_with_no_library_but_the_solver_of_cones() -> None:
    """None of the others is imported: each would take longer than the design."""
    path = str(PROBLEMS / "tractor-four-lanchester.toml")
    found = subprocess.run([sys.executable, "-c", QUICK, path], check=True, capture_output=True, text=True)
    assert found.stdout == "optimal\n"


@pytest.mark.slow
def test_who_draws_is_ready_without_what_studies_and_solvers_need() -> None:
    names = "casadi", "clarabel", "cvxpy", "pandas", "pydantic", "scipy", "xarray"
    code = f"import sys; sys.modules |= dict.fromkeys({names}); from laufruhe.plots import get_ready; get_ready()"
    subprocess.run([sys.executable, "-c", code], check=True)


@pytest.mark.slow
def test_without_casadi_counterweights_are_decided_and_uneven_throws_say_what_they_need() -> None:
    paths = [str(PROBLEMS / f"{name}.toml") for name in ("tractor-single", "inline-nine-uneven")]
    found = subprocess.run([sys.executable, "-c", SCRIPT, *paths], check=True, capture_output=True, text=True)
    assert found.stdout.splitlines() == [
        "optimal", "these open numbers need casadi, which is not installed; pip install casadi",
    ]  # fmt: skip
