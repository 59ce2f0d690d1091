"""Parts of the loads of a twin that turn with and against the crank: a picture and a file of numbers."""

from laufruhe.extension import Extension

_HERE = "laufruhe.extensions.twins"
EXTENSION = Extension("twins", sections=(f"{_HERE}.turning:SECTION",), pictures=(f"{_HERE}.turning:PICTURE",))
