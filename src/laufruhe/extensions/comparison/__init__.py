"""Designs side by side: inputs, decisions, objectives, loads and proofs of problem files and saved results."""

from laufruhe.extension import Extension

EXTENSION = Extension("comparison", commands=("laufruhe.extensions.comparison.command:COMMAND",))
