"""The kinds of study parts: a module each, found by being here."""

from __future__ import annotations

from collections.abc import Mapping
from importlib import import_module
from pkgutil import iter_modules
from typing import get_args

from laufruhe.extension import extended
from laufruhe.studies.part import Part


def _found() -> Mapping[str, type[Part]]:
    modules = [import_module(f"{__name__}.{module.name}") for module in iter_modules(__path__)]
    classes = [one for module in modules for one in vars(module).values() if isinstance(one, type)]
    kinds = [one for one in classes if issubclass(one, Part) and "kind" in one.model_fields]
    return extended("study_kinds", Part, kinds, lambda one: str(get_args(one.model_fields["kind"].annotation)[0]))


KINDS: Mapping[str, type[Part]] = _found()
