"""The Python reference says what is so: every call in it is made."""

from __future__ import annotations

import doctest
import re
import subprocess
import sys
from pathlib import Path

import pytest

import laufruhe
from laufruhe.files.ready import copies
from laufruhe.problem.problem import Problem
from laufruhe.python.results import Result
from laufruhe.report.saved_result import SavedResult

PAGE = Path(__file__).parents[2] / "docs" / "reference" / "python.md"


def test_answers_are_those_of_the_page(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "tractor-single.toml").write_text(copies(["tractor-single"])["tractor-single.toml"], encoding="utf-8")
    text = "\n".join(re.findall(r"```pycon\n(.*?)```", PAGE.read_text(encoding="utf-8"), re.DOTALL))
    test = doctest.DocTestParser().get_doctest(text, {}, "reference", str(PAGE), 0)
    lines: list[str] = []
    assert doctest.DocTestRunner(optionflags=doctest.NORMALIZE_WHITESPACE).run(test, out=lines.append).failed == 0, (
        lines
    )


def test_classes_are_named_without_loading_them() -> None:
    assert (laufruhe.Problem, laufruhe.Result, laufruhe.SavedResult) == (Problem, Result, SavedResult)
    assert dir(laufruhe) == sorted(laufruhe.__all__)
    with pytest.raises(AttributeError, match="no attribute 'Reslt'"):
        laufruhe.Reslt  # type: ignore[attr-defined]  # noqa: B018
    code = "import sys, laufruhe; print('numpy' in sys.modules, 'pydantic' in sys.modules)"
    assert subprocess.check_output([sys.executable, "-c", code], text=True).split() == ["False", "False"]


@pytest.mark.slow
def test_rooms_that_pages_name_are_there_at_once() -> None:
    code = "import laufruhe; print(laufruhe.plots.draw.__name__, laufruhe.machine.OperatingPoint.__name__)"
    assert subprocess.check_output([sys.executable, "-c", code], text=True).split() == ["draw", "OperatingPoint"]


def test_everything_public_is_on_the_page() -> None:
    text = PAGE.read_text(encoding="utf-8")
    for name in set(laufruhe.__all__) - {"__version__"}:
        assert re.search(rf"\b{name}\b", text), name
    for owner, names in ((Problem, ("with_values", "open", "fix")), (Result, ("forces", "orders", "modes"))):
        for name in names:
            assert getattr(owner, name).__doc__
            assert re.search(rf"\b{name}\(", text), name
