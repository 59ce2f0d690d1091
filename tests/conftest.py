"""Settings that every test shares."""

import os
import tempfile
from pathlib import Path

import pytest
from hypothesis import settings
from hypothesis.configuration import set_hypothesis_home_dir

# Set before any test module can import matplotlib: no test has a display.
os.environ["MPLBACKEND"] = "Agg"

# Derandomised: a failure repeats on the next machine, and no example database is needed.
settings.register_profile("laufruhe", derandomize=True, deadline=None, database=None, max_examples=50)
# `make test-fast` asks for this one
settings.register_profile("fast", settings.get_profile("laufruhe"), max_examples=10)
settings.load_profile("laufruhe")


def pytest_configure(config: pytest.Config) -> None:
    # Hypothesis keeps tables beside the tests unless told where; nothing may stay behind.
    home = tempfile.TemporaryDirectory(prefix="hypothesis-")
    set_hypothesis_home_dir(Path(home.name))
    config.add_cleanup(home.cleanup)
