"""Worst mean of a signal: its mean over the cycle at the operating point where that is largest."""

from laufruhe.extension import Extension

EXTENSION = Extension("worst_mean", norms=("laufruhe.extensions.worst_mean.norm:WorstMean",))
