"""Mutants change one line, stay Python, and are the same for the same seed."""

import ast
import difflib

import pytest

from mutants.run_mutants import equivalents
from mutants.single_lines import ROOMS, SOURCE, all_mutants, drawn, mutants_of


def test_a_mutant_is_one_other_line_that_python_reads() -> None:
    source = SOURCE / "laufruhe" / "physics" / "mount_forces.py"
    lines = source.read_text(encoding="utf-8").splitlines()
    result = mutants_of(source)
    assert len({(m.line, m.after) for m in result}) == len(result) > 20
    for mutant in result:
        changed = [*lines[: mutant.line - 1], mutant.after, *lines[mutant.line :]]
        assert lines[mutant.line - 1] == mutant.before != mutant.after
        ast.parse("\n".join(changed))
        assert sum(line.startswith("+ ") for line in difflib.ndiff(lines, changed)) == 1


def test_every_kind_of_change_is_made(tmp_path, monkeypatch) -> None:
    text = "def f(a, b):\n    if a < b and not a:\n        return -a + min(a, 0.5)\n    return a is None, 2 * b\n"
    (tmp_path / "one.py").write_text(text)
    monkeypatch.setattr("mutants.single_lines.SOURCE", tmp_path)
    assert [m.after.strip() for m in mutants_of(tmp_path / "one.py")] == [
        "if a < b or not a:",
        "if a > b and not a:",
        "if a < b and a:",
        "return -a - min(a, 0.5)",
        "return a + min(a, 0.5)",
        "return -a + max(a, 0.5)",
        "return -a + min(a, 1.0)",
        "return a is not None, 2 * b",
        "return a is None, 2 / b",
        "return a is None, 3 * b",
    ]


def test_messages_annotations_and_texts_are_left_alone(tmp_path, monkeypatch) -> None:
    text = '''def f(a: int = 0) -> "1 + 1":
    """1 < 2."""
    if a:
        raise ValueError(f"{a + 1} < 3")
    return f"{a - 1}" + "x"
'''
    (tmp_path / "one.py").write_text(text)
    monkeypatch.setattr("mutants.single_lines.SOURCE", tmp_path)
    assert [m.after.strip() for m in mutants_of(tmp_path / "one.py")] == ['def f(a: int = 1) -> "1 + 1":']


def test_numbers_that_change_nothing_are_left_alone(tmp_path, monkeypatch) -> None:
    text = """def f(a, b):
    size = b.max() or np.random.default_rng(7).random() or 1.0
    return (a / np.where(b > 0.0, b, 1.0)).reshape(-1, 3) / size
"""
    (tmp_path / "one.py").write_text(text)
    monkeypatch.setattr("mutants.single_lines.SOURCE", tmp_path)
    assert [m.after.strip() for m in mutants_of(tmp_path / "one.py")] == [
        "size = b.max() and np.random.default_rng(7).random() or 1.0",
        "size = b.min() or np.random.default_rng(7).random() or 1.0",
        "return (a / np.where(b > 0.0, b, 1.0)).reshape(-1, 3) * size",
        "return (a * np.where(b > 0.0, b, 1.0)).reshape(-1, 3) / size",
        "return (a / np.where(b < 0.0, b, 1.0)).reshape(-1, 3) / size",
        "return (a / np.where(b > 1.0, b, 1.0)).reshape(-1, 3) / size",
        "return (a / np.where(b > 0.0, b, 1.0)).reshape(-1, 4) / size",
    ]


def test_an_edit_leaves_all_other_mutants_in_the_sample(tmp_path, monkeypatch) -> None:
    (tmp_path / "laufruhe" / "prove").mkdir(parents=True)
    file = tmp_path / "laufruhe" / "prove" / "one.py"
    monkeypatch.setattr("mutants.single_lines.SOURCE", tmp_path)
    monkeypatch.setattr("mutants.single_lines.ROOMS", ("prove",))
    samples = []
    for head in ("", "def more(a):\n    return a + 2\n\n\n"):
        file.write_text(head + "class One:\n    def value(self, a, b):\n        return min(a, b) + 3 * a - b\n")
        all_mutants.cache_clear()
        samples.append(drawn(100, 1))
    all_mutants.cache_clear()
    assert {m.function for m in samples[0]} == {"One.value"}
    assert [m.change for m in samples[1] if m.function != "more"] == [m.change for m in samples[0]]
    assert len(samples[1]) == len(samples[0]) + 2


def test_listed_equivalent_mutants_have_a_reason() -> None:
    listed = equivalents()
    files = {change.partition(":")[0] for change in listed}
    made = {mutant.change for file in files for mutant in mutants_of(SOURCE / file)}
    assert not listed.keys() - made
    assert all(len(reason.split()) > 3 for reason in listed.values())


@pytest.mark.slow
def test_a_sample_is_the_same_for_its_seed_and_covers_the_rooms(monkeypatch) -> None:
    first, again, other = drawn(200, 7), drawn(200, 7), drawn(200, 8)
    assert first == again != other
    assert {room for room in ROOMS for mutant in first if mutant.file.startswith(f"laufruhe/{room}/")} == set(ROOMS)
