"""Root mean quad of a signal, which rates vibration with peaks (ISO 2631-1)."""

from laufruhe.extension import Extension

EXTENSION = Extension("root_mean_quad", norms=("laufruhe.extensions.root_mean_quad.norm:RootMeanQuad",))
