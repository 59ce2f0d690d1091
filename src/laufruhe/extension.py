"""Extensions: packages that add objects to the tables of the core, such as channels, layouts or solvers.

The extensions of this package are the folders of `laufruhe.extensions`; the core runs without any of them. Other
packages name an `Extension` as an entry point of the group `laufruhe.extensions`. The objects of a table are imported
at its first use.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from importlib import import_module
from importlib.metadata import entry_points
from importlib.util import find_spec
from pathlib import Path
from pkgutil import iter_modules
from typing import Any, Literal

from laufruhe.errors import ModelError

GROUP = "laufruhe.extensions"
Tables = Literal[
    "norms", "channels", "kinds", "layouts", "drives", "methods", "quantities", "provers", "reductions", "study_kinds",
    "commands", "keys", "weight_keys", "gas_models", "notes", "pictures", "sections", "advice", "diagnoses",
]  # fmt: skip


@dataclass(frozen=True)
class Extension:
    """Objects that a package adds to the tables of the core, each by its address `module:attribute`.

    Attributes
    ----------
    name
        Name of the package in messages.
    needs
        Names of the extensions that its modules import. Without one of them it is left out.
    norms
        Subclasses of `laufruhe.numerics.norms.Norm`.
    channels
        Objects of `laufruhe.problem.channels.Channel`.
    dependences
        Lines of the table in `laufruhe.problem.dependence` for these channels and kinds. Without a line no bound is
        known, and problems with the channel are solved locally.
    kinds
        Objects of `laufruhe.problem.decision.Kind`: kinds of numbers that may be open.
    layouts
        Objects of `laufruhe.machine.layouts.LayoutKind`.
    drives
        Objects of `laufruhe.machine.drives.DriveKind`.
    methods
        Objects of `laufruhe.solvers.method.Method`; each is tried before the method that it names.
    quantities
        Objects of `laufruhe.files.quantities.Quantity`: numbers that determine several numbers of the file.
    provers
        Objects of `laufruhe.prove.mounts.provers.Prover`: bounds of designs on open mounts.
    reductions
        Objects of `laufruhe.solvers.methods.Reduction`; each is applied before the reduction that it names.
    study_kinds
        Subclasses of `laufruhe.studies.part.Part`.
    commands
        Objects of `typer.models.CommandInfo`; `laufruhe --help` imports their modules, so these should import little.
    keys
        Objects of `laufruhe.files.problem_file.Key`: tables of a problem file.
    weight_keys
        Objects of `laufruhe.files.problem_file.WeightKey`: keys of counterweights and of unbalances of shafts.
    gas_models
        Subclasses of `laufruhe.files.gas.GasTable`: models of [gas].
    notes
        Objects of `laufruhe.files.problem_file.Note`: notes that a file may add to any number, such as tolerances.
    sections
        Objects of `laufruhe.report.section.Section`: tables and numbers of a result.
    pictures
        Objects of `laufruhe.present.pictures.ResultPicture`.
    advice
        Objects of `laufruhe.problem.advice.Advice`: warnings about problems, and remedies for refused files.
    diagnoses
        Objects of `laufruhe.solvers.methods.Diagnosis`: completions of results at the end of a solve.
    """

    name: str
    needs: tuple[str, ...] = ()
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
    weight_keys: tuple[str, ...] = ()
    gas_models: tuple[str, ...] = ()
    notes: tuple[str, ...] = ()
    sections: tuple[str, ...] = ()
    pictures: tuple[str, ...] = ()
    advice: tuple[str, ...] = ()
    diagnoses: tuple[str, ...] = ()


_OF_SIZES = (
    "crank-pin bending stress", "web stress", "journal torsion stress", "journal stress", "rod stress", "bolt stress",
    "main-bearing pressure times speed", "share of the buckling load", "piston-pin pressure", "piston-pin deflection",
    "piston-pin bending stress", "piston-pin ovality", "throw clearance", "running-gear mass",
)  # fmt: skip
_OF_PISTONS = (
    "piston travel", "mean piston speed", "piston speed", "piston acceleration", "rod angle",
    "side-force reversal rate",
)  # fmt: skip
_OF_BEARINGS = (
    "main-bearing force", "main-bearing pressure", "hammer blow", "friction power", "crank-pin force",
    "crank-pin pressure", "side force", "rod force",
)  # fmt: skip
_OF_FLYWHEEL = ("degree of irregularity", "flywheel inertia", "flywheel mass", "rim stress", "arm stress")
_OF_RECEIVERS = ("receiver acceleration", "receiver velocity", "receiver pressure")
HOMES: Mapping[Tables, Mapping[str, str]] = {
    "study_kinds": {
        "balancer sizing": "sweeps",
        "counterweight fraction": "sweeps",
        "free forces": "sweeps",
        "layout comparison": "sweeps",
        "economics": "economics",
        "random designs": "random_studies",
        "random scenes": "random_studies",
        "replication": "replication",
        "skip fire": "skip_fire",
        "speed map": "speed_maps",
        "tolerance": "robust",
    },
    "commands": {
        "engines": "beginning",
        "examples": "beginning",
        "init": "beginning",
        "page": "served_page",
        "balance": "balancing",
        "compare": "comparison",
        "drawing": "workshop",
        "explain": "fidelity",
        "export": "exchange",
        "identify": "identification",
        "trade": "fidelity",
    },
    "keys": {
        "main_bearings": "bearing_loads",
        "flywheel": "flywheel",
        "torsion": "torsion",
        "tolerances": "robust",
        "robust": "robust",
        "assembly": "robust",
        "run_up": "run_ups",
        "running_gear": "sizes",
        "crankcase": "workshop",
        "receivers": "receivers",
        "speed_ranges": "speed_ranges",
        "frame": "receivers",
        "choices": "parts_lists",
        "parts_price": "parts_lists",
        "bob_weights": "balancing",
        "correction": "balancing",
        "measurements": "identification",
        "electric_machines": "electric_torque",
    },
    "weight_keys": {"body": "workshop"},
    "gas_models": {"chambers": "chambers", "pressure_file": "recorded_pressure", "trace": "recorded_pressure"},
    "notes": {"±": "robust", "+-": "robust", "+/-": "robust", "tolerance": "robust"},
    "reductions": {"objectives in order": "objectives_in_order"},
    "norms": {"rmq": "root_mean_quad", "worst mean": "worst_mean"},
    "layouts": {"delta": "delta", "radial": "radial", "rotary": "rotary"},
    "drives": {"swinging-yoke": "swinging_yoke", "crank-rocker": "crank_rocker", "rhombic": "rhombic"},
    "channels": dict.fromkeys(_OF_SIZES, "sizes")
    | dict.fromkeys(_OF_BEARINGS, "bearing_loads")
    | dict.fromkeys(_OF_FLYWHEEL, "flywheel")
    | dict.fromkeys(_OF_RECEIVERS, "receivers")
    | dict.fromkeys(_OF_PISTONS, "piston_motion")
    | dict.fromkeys(("shaft distance", "shaft clearance", "envelope radius"), "open_positions")
    | {"parts price": "parts_lists", "electric torque": "electric_torque"},
}
"""Extensions of this package by the names that they add to tables, for the complaint if one is not installed."""
INSTALL = "install laufruhe with all its folders"
MOVED: Mapping[str, str] = {
    name: f"{GROUP}.{module}:{name}"
    for module, names in {
        "bearing_loads.machine": ("Bearing",),
        "chambers.gas": ("Chamber", "Chambers", "Compressor", "Pump", "Steam"),
        "flywheel.machine": ("Arms", "Flywheel", "Rim"),
        "recorded_pressure.gas": ("PressureTrace",),
    }.items()
    for name in names
}
"""Classes of `laufruhe.machine` up to release 0.3 that extensions have now, with their addresses."""


def missing_extension(extension: str) -> tuple[str, str]:
    """Return rule and remedy for a file that needs an extension of this package that is not installed."""
    names = {one.name for one in extensions()}
    needs = (need for one in _all_extensions() if one.name == extension for need in one.needs if need not in names)
    return f"needs the extension '{next(needs, extension)}', which is not installed", INSTALL


def is_installed(extension: str) -> bool:
    """Return True if an extension is installed, by its name."""
    return any(one.name == extension for one in extensions())


def object_at(address: str) -> Any:
    """Return an object by its address `module:name`; raise `ModelError` if its extension is not installed."""
    module, _, name = address.partition(":")
    if module.startswith(GROUP) and find_spec(home := ".".join(module.split(".")[:3])) is None:
        raise ModelError(f"{name} {'; '.join(missing_extension(home.rpartition('.')[2]))}")
    return getattr(import_module(module), name)


@cache
def extensions() -> tuple[Extension, ...]:
    """Return the extensions of this package, then those of other packages, each in alphabetical order."""
    names = {one.name for one in _all_extensions()}
    return tuple(one for one in _all_extensions() if names.issuperset(one.needs))


@cache
def _all_extensions() -> tuple[Extension, ...]:
    folders = iter_modules([str(Path(__file__).with_name("extensions"))])
    addresses = [(extension.name, f"laufruhe.extensions.{extension.name}:EXTENSION") for extension in folders]
    addresses += sorted((point.name, point.value) for point in entry_points(group=GROUP))
    loaded = []
    for name, address in addresses:
        extension = _imported(name, address)
        if not isinstance(extension, Extension):
            raise ModelError(f"extension '{name}': {address} is no laufruhe.extension.Extension; correct the address")
        loaded.append(extension)
    return tuple(loaded)


class Table(Mapping[str, Any]):
    """Mapping of names to objects that is filled at first use.

    So a module of an extension and the module of the table may import each other.
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
    table: Tables, kind: Any, core_objects: Iterable[Any], name_of: Callable[[Any], str] = lambda entry: str(entry.name)
) -> Table:
    """Return a table by names: objects or classes of the core, then those of extensions.

    Parameters
    ----------
    table
        Name of the table in `Extension`.
    kind
        Class of the objects, or base of the classes.
    core_objects
        Objects of the core.
    name_of
        Function that returns the name of an object in the table.

    Raises
    ------
    ModelError
        At first use of the table, if an object cannot be imported, is of another class, or has the name of another one.
    """

    def filled() -> dict[str, Any]:
        entries = {name_of(entry): entry for entry in core_objects}
        for extension in extensions():
            for address, entry in objects(extension, table):
                if not (issubclass(entry, kind) if isinstance(entry, type) else isinstance(entry, kind)):
                    raise ModelError(f"extension '{extension.name}': {address} is no {kind.__name__}; correct it")
                if (name := name_of(entry)) in entries:
                    rule = f"{table} have '{name}' already; give it another name"
                    raise ModelError(f"extension '{extension.name}': {rule}")
                entries[name] = entry
        return entries

    return Table(filled)


def objects(extension: Extension, table: Tables) -> Iterator[tuple[str, Any]]:
    """Yield (address, object) of all objects that an extension adds to a table."""
    for address in getattr(extension, table):
        yield address, _imported(extension.name, address)


def in_order(table: Tables, kind: Any, core_objects: Sequence[Any]) -> tuple[Any, ...]:
    """Return the objects of a table in order: an object of an extension comes before the one that it names, or last.

    Parameters
    ----------
    table
        Name of the table in `Extension`.
    kind
        Class of the objects.
    core_objects
        Objects of the core, in order.

    Raises
    ------
    ModelError
        If an object names a missing one.
    """
    entries = list(core_objects)
    for entry in [*extended(table, kind, core_objects).values()][len(core_objects) :]:
        names = [existing.name for existing in entries]
        if entry.before and entry.before not in names:
            raise ModelError(f"{table}: '{entry.name}' names '{entry.before}', which does not exist; correct `before`")
        entries.insert(names.index(entry.before) if entry.before else len(entries), entry)
    return tuple(entries)


def _imported(name: str, address: str) -> Any:
    module, _, attribute = address.partition(":")
    try:
        return getattr(import_module(module), attribute)
    except (ImportError, AttributeError) as error:
        raise ModelError(
            f"extension '{name}': {address} cannot be imported ({error}); repair or uninstall it"
        ) from error
