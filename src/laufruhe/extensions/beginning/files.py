"""Draft of a problem file, copies of ready problems, and lists of both and of catalogue engines."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import groupby
from pathlib import Path

import typer

from laufruhe.cli.screen import typed
from laufruhe.errors import InputError, printed, refused
from laufruhe.extensions.beginning import drafts
from laufruhe.extensions.beginning.questions import Answers, ask, ask_engine, layout_of
from laufruhe.files import ready
from laufruhe.files.catalogue import engine_named, engines
from laufruhe.files.complaints import errors_in_file, nearest
from laufruhe.files.toml_text import toml_value
from laufruhe.report import files

_TAKEN = ("exists with other contents", "choose another name")


def write_draft(file: Path, name: str | None) -> str:
    """Write a problem file and its schema into one folder, and return the message about it."""
    source, layout = (_checked_source(name), {}) if name is not None else _requested_source(file)
    command = "solve"
    if source is not None and source not in engines():
        entry = ready.ready_named(source)
        command = "study" if entry.is_study else "solve"
        copies = ready.copies([source]).items()
        texts = {file.name if copy_name == entry.path.name else copy_name: text for copy_name, text in copies}
    else:
        draft = drafts.draft_of_tables(ask_engine(layout), file) if source is None else drafts.draft_of_engine(source)
        texts = {file.name: draft, **dict([ready.schema_file()])}
    _write({file.parent / copy_name: text for copy_name, text in texts.items()})
    return f"{printed(str(file))}: ready to be changed; then: {typed('laufruhe', command, str(file))}\n"


def _requested_source(file: Path) -> tuple[str | None, Answers]:
    # an engine that the user describes has no source, and perhaps a layout
    if file.exists():
        raise refused("file", str(file), *_TAKEN)
    typer.echo("Start from an engine (laufruhe engines) or a ready problem (laufruhe examples),")
    words = "or press Enter to describe your own engine, or name its layout, such as V8"
    source: tuple[str | None, Answers] = ask(words, "", _source_or_layout)
    return source


def _source_or_layout(text: str) -> tuple[str | None, Answers]:
    if not text:
        return None, {}
    try:
        return _checked_source(text), {}
    except InputError:
        layout = layout_of(text)
        if layout is None:
            raise
        return None, layout


def _checked_source(source: str) -> str:
    if source not in engines() and source.removesuffix(".toml") not in ready.ready():
        advice = nearest(source, [*engines(), *ready.ready()], "laufruhe engines and laufruhe examples list them")
        raise refused("--from", source, "is no engine and no ready problem", advice)
    return source


def copy_ready(names: Sequence[str], folder: Path) -> str:
    """Copy ready problems into a folder with the files that they need, and return their paths as text."""
    texts = ready.copies(names)
    _write({folder / name: text for name, text in texts.items()})
    return "".join(f"{printed(str(folder / name))}\n" for name in texts)


def _write(texts: Mapping[Path, str]) -> None:
    # no text is written if one would replace another file
    for path, text in texts.items():
        above = next(above for above in (path, *path.parents) if above.exists())
        if path.is_dir():
            raise refused("file", str(path), "is a folder", "name a file in it")
        if above != path and not above.is_dir():
            raise refused("file", str(path), f"cannot be written ('{above}' is not a folder)", "name another place")
        if path.exists() and path.name not in ready.SCHEMAS and path.read_bytes() != text.encode():
            raise refused("file", str(path), *_TAKEN)
    files.write_all(texts)


def ready_list() -> str:
    """Return the list of ready problems by use."""
    lines = ["Copy one with: laufruhe examples NAME, or begin with it: laufruhe init --from NAME"]
    for use, group in groupby(ready.ready().values(), lambda problem: problem.use):
        lines += ["", use[:1].upper() + use[1:], *(f"  {problem.name:42}{problem.title}" for problem in group)]
    return "\n".join(lines) + "\n"


def engine_list() -> str:
    """Return the list of catalogue engines by number of cylinders."""
    lines = ['In a problem file: engine = "KEY". As a file to begin with: laufruhe init --from KEY', ""]
    lines += [f"{'key':22}{'bore x stroke [mm]':>20}{'cm^3':>8}   engine"]
    for engine in sorted(engines().values(), key=lambda engine: engine.engine["cylinders"]):
        size = " x ".join(str(engine.engine[key]).removesuffix(" mm") for key in ("bore", "stroke"))
        lines.append(f"{engine.key:22}{size:>20}{engine.displacement.removesuffix(' cm^3'):>8}   {engine.name}")
    return "\n".join(lines) + "\n"


def engine_details(names: Sequence[str]) -> str:
    """Return the catalogue entries of some engines as text."""
    with errors_in_file("laufruhe"):
        entries = [engine_named(name, "engine") for name in names]
    lines = []
    for k, engine in enumerate(entries):
        lines += [""] if k else []
        lines += [engine.name, f"Source: {engine.source}.", f"Displacement, as published: {engine.displacement}."]
        lines += [engine.note] if engine.note else []
        for key, value in engine.engine.items():
            lines.append(f"    {key} = {toml_value(value)}" + ("   # assumed" if key in engine.assumed else ""))
    return "\n".join(lines) + "\n"
