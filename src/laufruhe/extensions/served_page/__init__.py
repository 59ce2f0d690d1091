"""Sliders on the page of a result, and a page with a local server (docs/how-to/live-page.md).

`live` has the scripts, and the loads that a page adds up by itself. `page_state` parses requests, `answers` computes
them in worker processes, `latest_worker` runs only the newest request, `guard` and `transport` admit only clients with
the printed address.
"""

from laufruhe.extension import Extension

_HERE = "laufruhe.extensions.served_page"
EXTENSION = Extension("served_page", commands=(f"{_HERE}.command:PAGE",), sections=(f"{_HERE}.live.section:SLIDERS",))
