"""The kinds of study parts: a module each, found by being here."""

from __future__ import annotations

from collections.abc import Mapping
from importlib import import_module
from pkgutil import iter_modules
from typing import get_args

from laufruhe.extension import extended
from laufruhe.studies.part import Part


def _find_kinds() -> Mapping[str, type[Part]]:
    modules = [import_module(f"{__name__}.{module.name}") for module in iter_modules(__path__)]
    classes = [kind for module in modules for kind in vars(module).values() if isinstance(kind, type)]
    kinds = [kind for kind in classes if issubclass(kind, Part) and "kind" in kind.model_fields]
    return extended("study_kinds", Part, kinds, lambda kind: str(get_args(kind.model_fields["kind"].annotation)[0]))


KINDS: Mapping[str, type[Part]] = _find_kinds()
