"""Decide the lead angles of geared shafts and of cranks with common chambers by boxes of leads (P13 to P15).

Without it leads are decided by local programs, without a bound.
"""

from laufruhe.extension import Extension

_HERE = "laufruhe.extensions.phase_leads.methods"
EXTENSION = Extension("phase_leads", methods=(f"{_HERE}:SHIFTED_LOADS", f"{_HERE}:SHARED_CHAMBERS"))
