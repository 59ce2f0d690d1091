"""Search cranks of eleven to 48 throws, which have more than a million even stars (S5, S44 to S48).

Without it the stars of shorter cranks are looked at one by one, and longer ones are refused.
"""

from laufruhe.extension import Extension

EXTENSION = Extension("long_cranks", methods=("laufruhe.extensions.long_cranks.long_crank_method:LONG_CRANKS",))
