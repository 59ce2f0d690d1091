"""The live page with what is not affine, served on this machine alone (docs/how-to/live-page.md).

`asked` is what a page may ask for, `answers` work it out in processes of their own, `desk` hands the newest request
on, `guard` and `transport` let in whoever has the address that the command printed, and nobody else.
"""

from laufruhe.extension import Extension

EXTENSION = Extension("served_page", commands=("laufruhe.extensions.served_page.command:PAGE",))
