"""The JSON schema of problem files, for editors; shipped as `laufruhe.schema.json`."""

from __future__ import annotations

import json
from importlib.resources import files

from laufruhe.files.file_models import ProblemFile

FILE_NAME = "laufruhe.schema.json"


def generated() -> str:
    """The schema as the models have it now."""
    schema = {"$schema": "https://json-schema.org/draft/2020-12/schema", **ProblemFile.model_json_schema()}
    return json.dumps(schema, indent=2, ensure_ascii=False) + "\n"


def shipped() -> str:
    """The schema in the package."""
    return (files("laufruhe.files") / FILE_NAME).read_text(encoding="utf-8")
