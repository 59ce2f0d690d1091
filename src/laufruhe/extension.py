"""Extensions: additions to the tables of the core.

Those of this package are the folders of `laufruhe.extensions`; the core runs without each of them. Another installed
package names an `Extension` as an entry point of the group `laufruhe.extensions`. Objects are imported when the table
that they belong to is made, so that each of their modules imports no more than the room of that table.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from importlib import import_module
from importlib.metadata import entry_points
from pathlib import Path
from pkgutil import iter_modules
from typing import Any, Literal

from laufruhe.errors import ModelError

GROUP = "laufruhe.extensions"
Tables = Literal[
    "norms", "channels", "kinds", "layouts", "drives", "methods", "quantities", "provers", "reductions", "study_kinds",
    "commands", "keys", "notes", "pictures", "sections",
]  # fmt: skip


@dataclass(frozen=True)
class Extension:
    """Objects that a package adds to the tables, each by its name `module:attribute`.

    Attributes
    ----------
    name
        Name of the package in messages.
    norms
        Subclasses of `laufruhe.numerics.norms.Norm`.
    channels
        Objects of `laufruhe.problem.channels.Channel`.
    dependences
        Lines of the table in `laufruhe.problem.dependence`, about these channels and kinds; a channel without one is
        unknown to every bound, and decided locally.
    kinds
        Objects of `laufruhe.problem.decision.Kind`: kinds of numbers that may be open.
    layouts
        Objects of `laufruhe.machine.layouts.LayoutKind`.
    drives
        Objects of `laufruhe.machine.drives.DriveKind`.
    methods
        Objects of `laufruhe.solvers.method.Method`: rows of the table of methods, each before the one that it names.
    quantities
        Objects of `laufruhe.files.quantities.Quantity`: decisions that several numbers of the file follow.
    provers
        Objects of `laufruhe.prove.mounts.provers.Prover`: bounds of designs on open mounts.
    reductions
        Objects of `laufruhe.solvers.methods.Reduction`, each with the one that it stands before.
    study_kinds
        Subclasses of `laufruhe.studies.part.Part`.
    commands
        Objects of `typer.models.CommandInfo`; their modules are imported by `laufruhe --help`, so they import little.
    keys
        Objects of `laufruhe.files.problem_file.Key`: tables of a problem file.
    notes
        Objects of `laufruhe.files.problem_file.Note`: what a file may write at any number.
    sections
        Objects of `laufruhe.report.section.Section`: tables and numbers of a result.
    pictures
        Objects of `laufruhe.present.pictures.ResultPicture`.
    """

    name: str
    norms: tuple[str, ...] = ()
    channels: tuple[str, ...] = ()
    dependences: tuple[str, ...] = ()
    kinds: tuple[str, ...] = ()
    layouts: tuple[str, ...] = ()
    drives: tuple[str, ...] = ()
    methods: tuple[str, ...] = ()
    quantities: tuple[str, ...] = ()
    provers: tuple[str, ...] = ()
    reductions: tuple[str, ...] = ()
    study_kinds: tuple[str, ...] = ()
    commands: tuple[str, ...] = ()
    keys: tuple[str, ...] = ()
    notes: tuple[str, ...] = ()
    sections: tuple[str, ...] = ()
    pictures: tuple[str, ...] = ()


_OF_SIZES = (
    "crank-pin bending stress", "web stress", "journal torsion stress", "journal stress", "rod stress", "bolt stress",
    "main-bearing pressure times speed", "share of the buckling load", "piston-pin pressure", "piston-pin deflection",
    "piston-pin bending stress", "piston-pin ovality", "throw clearance", "running-gear mass",
)  # fmt: skip
HOMES: Mapping[Tables, Mapping[str, str]] = {
    "study_kinds": {"economics": "economics", "replication": "replication", "tolerance": "robust"},
    "commands": {"page": "served_page"},
    "keys": {
        "torsion": "torsion",
        "tolerances": "robust",
        "robust": "robust",
        "assembly": "robust",
        "run_up": "run_ups",
        "running_gear": "sizes",
    },
    "notes": {"±": "robust", "+-": "robust", "+/-": "robust", "tolerance": "robust"},
    "layouts": {"rotary": "rotary"},
    "drives": {"swinging-yoke": "swinging_yoke"},
    "channels": dict.fromkeys(_OF_SIZES, "sizes"),
}
"""Extensions of this package by what they add to tables: whoever asks for it without the folder is told its name."""
INSTALL = "install laufruhe with all its folders"


def lack(extension: str) -> tuple[str, str]:
    """Return rule and remedy of what needs an extension of this package that is not there."""
    return f"needs the extension '{extension}', which is not installed", INSTALL


@cache
def extensions() -> tuple[Extension, ...]:
    """Return the extensions of this package, then those of other packages, each in the order of their names."""
    folders = iter_modules([str(Path(__file__).with_name("extensions"))])
    addresses = [(one.name, f"laufruhe.extensions.{one.name}:EXTENSION") for one in folders]
    addresses += sorted((point.name, point.value) for point in entry_points(group=GROUP))
    loaded = []
    for name, address in addresses:
        one = _imported(name, address)
        if not isinstance(one, Extension):
            raise ModelError(f"extension '{name}': {address} is no laufruhe.extension.Extension; mend it")
        loaded.append(one)
    return tuple(loaded)


class Table(Mapping[str, Any]):
    """Objects by their names, filled at first use.

    A module of an extension may import the room of its table, whichever of the two is imported first.
    """

    def __init__(self, fill: Callable[[], Mapping[str, Any]]) -> None:
        self._fill = cache(fill)

    def __getitem__(self, name: str) -> Any:
        return self._fill()[name]

    def __iter__(self) -> Iterator[str]:
        return iter(self._fill())

    def __len__(self) -> int:
        return len(self._fill())


def extended(
    table: Tables, kind: Any, own: Iterable[Any], name_of: Callable[[Any], str] = lambda one: str(one.name)
) -> Table:
    """Return a table by names: objects or classes of this package, then those of extensions.

    Parameters
    ----------
    kind
        Class of the objects, or base of the classes.
    own
        Objects of this package.
    name_of
        Function that returns the name of an object in the table.

    Raises
    ------
    ModelError
        At first use, if one cannot be imported, is of another kind, or has the name of another one.
    """

    def filled() -> dict[str, Any]:
        entries = {name_of(one): one for one in own}
        for extension in extensions():
            for address, one in objects(extension, table):
                if not (issubclass(one, kind) if isinstance(one, type) else isinstance(one, kind)):
                    raise ModelError(f"extension '{extension.name}': {address} is no {kind.__name__}; mend it")
                if (name := name_of(one)) in entries:
                    rule = f"{table} have '{name}' already; give it another name"
                    raise ModelError(f"extension '{extension.name}': {rule}")
                entries[name] = one
        return entries

    return Table(filled)


def objects(extension: Extension, table: Tables) -> Iterator[tuple[str, Any]]:
    """Yield the addresses and objects that an extension adds to a table."""
    for address in getattr(extension, table):
        yield address, _imported(extension.name, address)


def in_order(table: Tables, kind: Any, own: Sequence[Any]) -> tuple[Any, ...]:
    """Return a table as a list: an object of an extension comes before the one that it names, else last.

    Raises
    ------
    ModelError
        If it names a missing one.
    """
    entries = list(own)
    for one in [*extended(table, kind, own).values()][len(own) :]:
        names = [other.name for other in entries]
        if one.before and one.before not in names:
            raise ModelError(f"{table}: '{one.name}' stands before '{one.before}', which is not there; mend it")
        entries.insert(names.index(one.before) if one.before else len(entries), one)
    return tuple(entries)


def _imported(name: str, address: str) -> Any:
    module, _, attribute = address.partition(":")
    try:
        return getattr(import_module(module), attribute)
    except (ImportError, AttributeError) as error:
        raise ModelError(f"extension '{name}': {address} cannot be imported ({error}); mend or uninstall it") from error
