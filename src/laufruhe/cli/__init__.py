"""Command line: `commands` and their options, and one module for the work of each family of commands."""

from laufruhe.cli.commands import app, main

__all__ = ["app", "main"]
