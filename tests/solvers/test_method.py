"""Rows of the table of methods that extensions add."""

from __future__ import annotations

from dataclasses import replace

import pytest

from laufruhe.errors import ModelError
from laufruhe.solvers import METHODS, methods


def test_a_row_of_an_extension_stands_before_the_one_that_it_names(monkeypatch: pytest.MonkeyPatch) -> None:
    own = METHODS[:3]
    more = replace(own[0], name="more", before=own[2].name)
    monkeypatch.setattr(methods, "extended", lambda *_: {row.name: row for row in (*own, more)})
    assert methods._with_extensions(own) == (*own[:2], more, own[2])
    monkeypatch.setattr(methods, "extended", lambda *_: {"more": replace(more, before="nothing of the kind")})
    with pytest.raises(ModelError, match="'more' stands before 'nothing of the kind', which is no method"):
        methods._with_extensions(own)
