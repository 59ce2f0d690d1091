"""Order of tables: additions of extensions stand where they say."""

from __future__ import annotations

from dataclasses import replace

import pytest

from laufruhe import extension
from laufruhe.errors import ModelError
from laufruhe.extension import in_order
from laufruhe.solvers import METHODS
from laufruhe.solvers.method import Method


def test_an_object_stands_before_the_one_that_it_names(monkeypatch: pytest.MonkeyPatch) -> None:
    own = METHODS[:3]
    more, last = replace(own[0], name="more", before=own[2].name), replace(own[0], name="last", before="")
    monkeypatch.setattr(extension, "extended", lambda *_: {row.name: row for row in (*own, more, last)})
    assert in_order("methods", Method, own) == (*own[:2], more, own[2], last)
    lost = replace(more, before="nothing of the kind")
    monkeypatch.setattr(extension, "extended", lambda *_: {row.name: row for row in (*own, lost)})
    with pytest.raises(ModelError, match="'more' names 'nothing of the kind', which does not exist"):
        in_order("methods", Method, own)
