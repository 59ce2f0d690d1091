"""Replicating a paper by a file: expressions, what may be asked of a case, and what is drawn."""

from laufruhe.extension import Extension

EXTENSION = Extension("replication", study_kinds=("laufruhe.extensions.replication.part:Replication",))
