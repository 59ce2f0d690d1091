"""Replicating a paper by a file: expressions, what may be asked of a case, and what is drawn."""
