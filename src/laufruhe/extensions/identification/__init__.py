"""Identification: open numbers of an engine from orders that were measured on it."""

from laufruhe.extension import Extension

_HERE = "laufruhe.extensions.identification"
EXTENSION = Extension("identification", keys=(f"{_HERE}.file:MEASUREMENTS",), commands=(f"{_HERE}.command:IDENTIFY",))
