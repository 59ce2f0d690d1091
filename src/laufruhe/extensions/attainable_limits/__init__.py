"""Values that limits in conflict can attain, each while the others hold (P16).

Without it results without a design name the limits in conflict alone.
"""

from laufruhe.extension import Extension

EXTENSION = Extension("attainable_limits", diagnoses=("laufruhe.extensions.attainable_limits.solver:DIAGNOSIS",))
