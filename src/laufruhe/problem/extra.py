"""Requests of extensions that a problem carries beyond its drawing."""

from __future__ import annotations

from typing import ClassVar


class Extra:
    """Ask of a problem what its drawing does not tell; the core evaluates the drawing, and a reduction decides.

    Attributes
    ----------
    words
        What it asks, as a plural or a noun with its article: whoever shows the drawing alone names what is left out.
    """

    words: ClassVar[str]

    @property
    def open_names(self) -> tuple[str, ...]:
        """Names of what it decides."""
        return ()

    def objective_name(self, name: str) -> str:
        """Return the name of what is minimised, from that of the drawing."""
        return name
