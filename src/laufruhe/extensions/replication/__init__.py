"""Replicating a paper by a file: expressions, quantities of a case, and pictures."""

from laufruhe.extension import Extension

EXTENSION = Extension("replication", study_kinds=("laufruhe.extensions.replication.part:Replication",))
