"""The kinds of study parts: a module each, found by being here."""

from __future__ import annotations

from collections.abc import Mapping
from importlib import import_module
from pkgutil import iter_modules
from typing import get_args

from laufruhe.extension import extended
from laufruhe.studies.part import Part

_MODULES = [import_module(f"{__name__}.{module.name}") for module in iter_modules(__path__)]
_CLASSES = [kind for module in _MODULES for kind in vars(module).values() if isinstance(kind, type)]
KINDS: Mapping[str, type[Part]] = extended(
    "study_kinds",
    Part,
    [kind for kind in _CLASSES if issubclass(kind, Part) and "kind" in kind.model_fields],
    lambda kind: str(get_args(kind.model_fields["kind"].annotation)[0]),
)
