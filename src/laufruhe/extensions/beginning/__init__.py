"""Files to begin with: a draft of a problem file, copies of ready problems, lists of catalogue engines."""

from laufruhe.extension import Extension

_COMMANDS = "laufruhe.extensions.beginning.commands"
EXTENSION = Extension("beginning", commands=tuple(f"{_COMMANDS}:{name}" for name in ("INIT", "EXAMPLES", "ENGINES")))
