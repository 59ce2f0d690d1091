"""Loads in the files of other programs, and scripts that compute the engine again with other libraries."""

from laufruhe.extension import Extension

EXTENSION = Extension("exchange", commands=("laufruhe.extensions.exchange.command:COMMAND",))
