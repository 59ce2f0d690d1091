"""Economics of balancer shafts: least force over their number and mass, compared with engines of more cylinders.

The engines with more cylinders have no shafts and equal power (eqs. 14-23); `worth` holds the rules.
"""

from laufruhe.extension import Extension

EXTENSION = Extension("economics", study_kinds=("laufruhe.extensions.economics.part:Economics",))
