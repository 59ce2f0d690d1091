"""Files to begin with: a draft of a problem file, copies of ready problems, lists of catalogue engines."""

from laufruhe.extension import Extension

_HERE = "laufruhe.extensions.beginning.command"
EXTENSION = Extension("beginning", commands=tuple(f"{_HERE}:{name}" for name in ("INIT", "EXAMPLES", "ENGINES")))
