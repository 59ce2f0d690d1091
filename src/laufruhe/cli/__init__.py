"""The command line: `commands` is what is typed, one module for what each family of commands does."""

from laufruhe.cli.commands import app, main

__all__ = ["app", "main"]
