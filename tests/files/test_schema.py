"""The schema for editors: up to date, true of the ready problems, and no rubber stamp."""

from __future__ import annotations

import copy
import json
import re
import textwrap
import tomllib
from pathlib import Path
from typing import Any

import jsonschema
import pytest

import laufruhe
from laufruhe import units
from laufruhe.files.reader import load
from laufruhe.files.ready import schema_file
from problem_files import PROBLEMS, READY
from schemas import WORDS, alternatives, default, schema, study_schema

LANCHESTER = next(path for path in READY if path.stem == "tractor-four-lanchester")
STUDIES = [path for path in sorted(PROBLEMS.glob("*.toml")) if path not in READY]
DOCS = Path(__file__).parents[2] / "docs"
REFERENCE = DOCS / "reference"
EXAMPLE = re.compile(r"^ *```toml\n(.*?)^ *```", re.MULTILINE | re.DOTALL)
# a page on packages shows a pyproject.toml and words that its package adds
EXAMPLES = [
    path
    for folder in ("..", ".", "how-to", "reference", "tutorials")
    for path in sorted((DOCS / folder).glob("*.md"))
    if path.stem != "extend" and EXAMPLE.search(path.read_text(encoding="utf-8"))
]
NUMBERS = ("m", "kg", "kg m", "kg m^2", "Pa", "N", "N m", "N/m", "N s/m", "Hz", "rad", "rad/s", "m/s", "s")


def problem_pages() -> list[str]:
    """Return the pages that explain the tables of problem files: the overview, and those that its table names."""
    overview = (REFERENCE / "problem-files.md").read_text(encoding="utf-8")
    return ["problem-files.md", *dict.fromkeys(re.findall(r"^\| `.*\]\(([\w-]+\.md)\) \|$", overview, re.MULTILINE))]


@pytest.fixture(scope="module")
def validator() -> jsonschema.Draft7Validator:
    data = json.loads(schema_file()[1])
    jsonschema.Draft7Validator.check_schema(data)
    return jsonschema.Draft7Validator(data)


def test_shipped_schema_is_the_generated_one() -> None:
    """Compare the file in the package with the schema of the models."""
    assert schema_file()[1] == schema()


@pytest.mark.parametrize("path", READY, ids=lambda path: path.stem)
def test_ready_problems_validate(path: Path, validator: jsonschema.Draft7Validator) -> None:
    """Check that the schema accepts all files that the reader accepts."""
    validator.validate(tomllib.loads(path.read_text(encoding="utf-8")))
    assert load(path).name == path.stem


def _set(*keys: str | int, value: Any) -> Any:
    def change(tables: Any) -> None:
        for key in keys[:-1]:
            tables = tables[key]
        tables[keys[-1]] = value

    return pytest.param(change, id=".".join(map(str, keys)))


def _drop(*keys: str | int) -> Any:
    def change(tables: Any) -> None:
        for key in keys[:-1]:
            tables = tables[key]
        del tables[keys[-1]]

    return pytest.param(change, id="without " + ".".join(map(str, keys)))


@pytest.mark.parametrize(
    "change",
    [
        _set("engine", "strok", value="120 mm"),
        _set("engine", "stroke", value=120),
        _set("engine", "layout", value="star"),
        _set("engine", "throws", value="0, 180"),
        _set("engine", "cylinders", value=0),
        _set("gas", "model", value="otto"),
        _set("mounts", "positions", 0, value=["1 m", "2 m"]),
        _set("counterweights", 0, "mass", value={"between": ["0 kg"]}),
        _set("counterweights", 0, "mass", value={"between": ["0 kg", "1 kg"], "from": "0 kg"}),
        _set("objective", "minimise", value="mean mount farce"),
        _set("balancer_shafts", 0, "unbalances", value=[]),
        _set("constraints", 0, "max", value=True),
        _drop("title"),
        _drop("engine", "stroke"),
        _drop("operating_points"),
    ],
)
def test_damaged_problems_do_not(change: Any, validator: jsonschema.Draft7Validator) -> None:
    """Check that the schema refuses a problem with one fault."""
    tables = tomllib.loads(LANCHESTER.read_text(encoding="utf-8"))
    damaged = copy.deepcopy(tables)
    change(damaged)
    assert damaged != tables
    with pytest.raises(jsonschema.ValidationError):
        validator.validate(damaged)


def test_every_key_of_a_problem_file_is_explained() -> None:
    """In code, not in prose: between backticks, in a fence, or indented."""
    text = "\n".join((REFERENCE / name).read_text(encoding="utf-8") for name in problem_pages())
    code = re.findall(r"`[^`\n]+`|^(?:    |```)[^\n]*$|^\[[^\n]*$|^[a-z_]+ *=[^\n]*$", text, re.MULTILINE)
    known = set(re.findall(r"[a-z_]+", "\n".join(code)))
    tables = json.loads(schema_file()[1])
    keys = {key for table in (tables, *tables["definitions"].values()) for key in table.get("properties", {})}
    assert not keys - known


def test_every_page_of_keys_is_read() -> None:
    """The overview leads to a page for each group of tables."""
    assert {"engine.md", "mounts-and-block.md", "crankshaft.md", "quantities.md"} < set(problem_pages())


@pytest.mark.parametrize("path", EXAMPLES, ids=lambda path: path.stem)
def test_examples_of_the_pages_fit_the_schema(path: Path) -> None:
    """A block with a title is a complete file; another one may lack keys, but has no wrong key or value."""
    for text in EXAMPLE.findall(path.read_text(encoding="utf-8")):
        tables = tomllib.loads(textwrap.dedent(text))
        is_study = "study" in tables
        data = json.loads(schema_file(is_study=is_study)[1])
        jsonschema.Draft7Validator(data if "title" in tables else _partial(data)).validate(tables)
        if "title" in tables and not is_study:
            assert laufruhe.load(tables).title == tables["title"]


def _partial(schema: Any) -> Any:
    """Return the schema without the keys that a table must have, except those that choose its kind."""
    if isinstance(schema, dict):
        return {
            key: value if key == "if" else _partial(value)
            for key, value in schema.items()
            if key != "required" or not isinstance(value, list)
        }
    return [_partial(value) for value in schema] if isinstance(schema, list) else schema


@pytest.mark.parametrize("is_study", [False, True], ids=["problem", "study"])
def test_every_key_has_words_and_an_example_that_may_stand_there(is_study: bool) -> None:
    tables = json.loads(schema_file(is_study=is_study)[1])
    for name, table in {"": tables, **tables["definitions"]}.items():
        keys = table.get("properties", {})
        if "between" in keys:  # a number that may be open: the keys that have it say what it is
            continue
        for key, entry in keys.items():
            assert entry["description"], f"{name}.{key}"
            assert entry["description"] in entry["x-taplo"]["docs"]["main"]
            one = jsonschema.Draft7Validator({**entry, "definitions": tables["definitions"]})
            assert entry["examples"]
            assert not [error for example in entry["examples"] for error in one.iter_errors(example)], f"{name}.{key}"


def test_words_of_keys_are_of_keys_that_there_are() -> None:
    keys: set[str] = set()
    for is_study in (False, True):
        tables = json.loads(schema_file(is_study=is_study)[1])
        for name, table in {tables["title"]: tables, **tables["definitions"]}.items():
            properties = table.get("properties", {})
            keys |= {*properties, *(f"{name.rpartition('__')[2]}.{key}" for key in properties)}
    words = tomllib.loads(WORDS.read_text(encoding="utf-8"))
    assert not {*words["words"], *words["examples"]} - keys


def test_numbers_are_checked_with_their_unit(validator: jsonschema.Draft7Validator) -> None:
    """Whatever the reader shows as an example of a dimension passes, and no other dimension's example does."""
    for unit in NUMBERS:
        result = re.compile(units.pattern(unit))
        assert result.match(units.example(unit))
        # a speed of rotation may be given as turns a second
        others = [other for other in NUMBERS if other != unit and (unit, other) != ("rad/s", "Hz")]
        assert not [other for other in others if result.match(units.example(other))]


@pytest.mark.parametrize("is_study", [False, True], ids=["problem", "study"])
def test_defaults_stand_with_their_units(is_study: bool) -> None:
    """The text of a default is read as the number that counts without the key."""
    tables = json.loads(schema_file(is_study=is_study)[1])
    texts = {}
    for name, table in tables["definitions"].items():
        for key, entry in table.get("properties", {}).items():
            dimensions = [one["x-dimension"] for one in alternatives(tables, entry) if "x-dimension" in one]
            if dimensions and isinstance(entry.get("default"), float):
                texts[name, key] = text = json.loads(default(tables, entry))
                assert units.parse(text, units.unit_of_dimension(dimensions[0])) == pytest.approx(entry["default"])
    assert texts
    if not is_study:
        assert texts["WiebeTable", "intake_pressure"] == "1.01325 bar"
        assert default(tables, tables["definitions"]["WiebeTable"]["properties"]["heat_ratio"]) == "1.35"


@pytest.fixture(scope="module")
def study_validator() -> jsonschema.Draft7Validator:
    data = json.loads(schema_file(is_study=True)[1])
    jsonschema.Draft7Validator.check_schema(data)
    return jsonschema.Draft7Validator(data)


def test_shipped_study_schema_is_the_generated_one() -> None:
    assert schema_file(is_study=True)[1] == study_schema()


@pytest.mark.parametrize("path", STUDIES, ids=lambda path: path.stem)
def test_ready_studies_validate(path: Path, study_validator: jsonschema.Draft7Validator) -> None:
    study_validator.validate(tomllib.loads(path.read_text(encoding="utf-8")))


@pytest.mark.parametrize(
    "change",
    [
        _set("study", "parts", 0, "titel", value="x"),
        _set("study", "parts", 0, "kind", value="fraction"),
        _set("study", "parts", 0, "sweep", 0, "spacing", value="even"),
        _set("study", "parts", 0, "cases", 0, "equal_power_to", value="4"),
        _drop("study"),
    ],
)
def test_damaged_studies_do_not(change: Any, study_validator: jsonschema.Draft7Validator) -> None:
    tables = tomllib.loads((LANCHESTER.parent / "tractor-sweeps.toml").read_text(encoding="utf-8"))
    damaged = copy.deepcopy(tables)
    change(damaged)
    assert damaged != tables
    with pytest.raises(jsonschema.ValidationError):
        study_validator.validate(damaged)
