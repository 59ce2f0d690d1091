"""Where a user begins: a problem file to fill in, ready problems to copy, engines to start from."""

from __future__ import annotations

import sys
from collections.abc import Mapping, Sequence
from itertools import groupby
from pathlib import Path

import typer

from laufruhe.cli.questions import asked, described
from laufruhe.cli.screen import typed
from laufruhe.errors import printed, refused
from laufruhe.files import drafts, ready
from laufruhe.files.catalogue import CatalogueEngine, engine_named, engines
from laufruhe.files.complaints import in_file, nearest
from laufruhe.files.toml_text import toml_value
from laufruhe.report import files

_TAKEN = ("exists already and is another", "name another place")


def begun(file: Path, name: str | None) -> str:
    """Write a problem file with its schema beside it; what to say of it."""
    source = _known(name) if name is not None else _asked_for(file)
    texts = _texts(file, source)
    _write({file.parent / other: text for other, text in texts.items()})
    known = ready.ready().get((source or "").removesuffix(".toml"))
    command = "study" if known is not None and known.is_study else "solve"
    return f"{printed(str(file))}: ready to be changed; then: {typed('laufruhe', command, str(file))}\n"


def _texts(file: Path, source: str | None) -> dict[str, str]:
    """Files to write, by name."""
    if source is not None and source not in engines():
        one = ready.ready_named(source)
        return {file.name if other == one.path.name else other: text for other, text in ready.copies([source]).items()}
    draft = drafts.draft_of_table(*described(), file) if source is None else drafts.draft_of_engine(source)
    return {file.name: draft, **dict([ready.schema_file()])}


def _someone_answers() -> bool:
    return sys.stdin.isatty()


def _asked_for(file: Path) -> str | None:
    """What to begin from, as the user types it; None for an engine of their own."""
    if not _someone_answers():
        rule, remedy = "asks questions, and nobody is there to answer", "add --from with an engine or a ready problem"
        raise refused("init", "", rule, remedy)
    if file.exists():
        raise refused("file", str(file), *_TAKEN)
    typer.echo("An engine of the catalogue (laufruhe engines), a ready problem (laufruhe examples),")
    source: str | None = asked("or nothing, to describe your own", "", lambda text: _known(text) if text else None)
    return source


def _known(source: str) -> str:
    """What --from names; `InputError` where there is none of that name."""
    if source not in engines() and source.removesuffix(".toml") not in ready.ready():
        advice = nearest(source, [*engines(), *ready.ready()], "laufruhe engines and laufruhe examples list them")
        raise refused("--from", source, "is no engine and no ready problem", advice)
    return source


def copied(names: Sequence[str], folder: Path) -> str:
    """Ready problems in a folder, with what they refer to; what to say of them."""
    texts = ready.copies(names)
    _write({folder / name: text for name, text in texts.items()})
    return "".join(f"{printed(str(folder / name))}\n" for name in texts)


def _write(texts: Mapping[Path, str]) -> None:
    """All of them, or none where one would take the place of another file."""
    for path, text in texts.items():
        above = next(above for above in (path, *path.parents) if above.exists())
        if path.is_dir():
            raise refused("file", str(path), "is a folder", "name a file in it")
        if above != path and not above.is_dir():
            raise refused("file", str(path), f"cannot be written ('{above}' is not a folder)", "name another place")
        kept = path.name in ready.SCHEMAS
        if path.exists() and not kept and path.read_bytes() != text.encode():
            raise refused("file", str(path), *_TAKEN)
    files.write_all(texts)


def listed() -> str:
    """Ready problems by what they are for."""
    lines = ["Copy one with: laufruhe examples NAME, or begin with it: laufruhe init --from NAME"]
    for use, group in groupby(ready.ready().values(), lambda one: one.use):
        lines += ["", use[:1].upper() + use[1:], *(f"  {one.name:42}{one.title}" for one in group)]
    return "\n".join(lines) + "\n"


def catalogue() -> str:
    """Engines by number of cylinders."""
    lines = ['In a problem file: engine = "KEY". As a file to begin with: laufruhe init --from KEY', ""]
    lines += [f"{'key':22}{'bore x stroke [mm]':>20}{'cm^3':>8}   engine"]
    lines += [_line(one) for one in sorted(engines().values(), key=lambda one: one.engine["cylinders"])]
    return "\n".join(lines) + "\n"


def _line(one: CatalogueEngine) -> str:
    size = " x ".join(str(one.engine[key]).removesuffix(" mm") for key in ("bore", "stroke"))
    return f"{one.key:22}{size:>20}{one.displacement.removesuffix(' cm^3'):>8}   {one.name}"


def shown(names: Sequence[str]) -> str:
    """What the catalogue says of some engines."""
    with in_file("laufruhe"):
        return "\n".join(_described_one(engine_named(name, "engine")) for name in names)


def _described_one(found: CatalogueEngine) -> str:
    lines = [found.name, f"Source: {found.source}.", f"Displacement, as published: {found.displacement}."]
    lines += [found.note] if found.note else []
    for key, value in found.engine.items():
        lines.append(f"    {key} = {toml_value(value)}" + ("   # assumed" if key in found.assumed else ""))
    return "\n".join(lines) + "\n"
