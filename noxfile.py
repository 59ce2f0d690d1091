"""Tests with every Python that is present: `nox` runs the fast lane, `nox -s tests -- -k gap` any others.

A Python that is missing is left out, with a word.
"""

import nox

nox.options.error_on_missing_interpreters = False
nox.options.reuse_existing_virtualenvs = True
nox.options.sessions = ["tests"]


@nox.session(python=["3.11", "3.12", "3.13"])
def tests(session: nox.Session) -> None:
    """The fast lane, with the versions of constraints.txt where they exist for this Python."""
    session.install("--constraint", "constraints.txt", ".[all]", *nox.project.dependency_groups(
        nox.project.load_toml("pyproject.toml"), "test"))  # fmt: skip
    arguments = session.posargs or ["-m", "not slow", "--hypothesis-profile=fast"]
    session.run("python", "-m", "pytest", "-n", "auto", "--maxprocesses", "8", *arguments, env={"OMP_NUM_THREADS": "1"})
