"""Live page with a local server: sliders for all open numbers, limits and loads (docs/how-to/live-page.md).

`page_state` parses requests, `answers` computes them in worker processes, `latest_worker` runs only the newest
request, `guard` and `transport` admit only clients with the printed address.
"""

from laufruhe.extension import Extension

EXTENSION = Extension("served_page", commands=("laufruhe.extensions.served_page.command:PAGE",))
