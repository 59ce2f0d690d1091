"""Ready problems and the engine catalogue as tables."""

from __future__ import annotations

from typing import TYPE_CHECKING

from laufruhe.files import catalogue
from laufruhe.files.ready import ready

if TYPE_CHECKING:
    import pandas as pd


def examples() -> pd.DataFrame:
    """Return the ready problems and studies by name, as a table of title, use and kind [pandas].

    `laufruhe.load` accepts the name of a problem, `laufruhe.study` that of a study.
    """
    import pandas as pd

    rows = {name: (entry.title, entry.use, "study" if entry.is_study else "problem") for name, entry in ready().items()}
    return pd.DataFrame.from_dict(rows, orient="index", columns=["title", "use", "kind"]).rename_axis("name")


def engines() -> pd.DataFrame:
    """Return the engines of the catalogue by key, as a table of name, numbers as published, and source [pandas].

    `laufruhe.engine` accepts the key.
    """
    import pandas as pd

    numbers = ("layout", "cylinders", "bore", "stroke")
    rows = {
        key: [entry.name, *(entry.engine.get(number) for number in numbers), entry.displacement, entry.source]
        for key, entry in catalogue.engines().items()
    }
    columns = ["name", *numbers, "displacement", "source"]
    return pd.DataFrame.from_dict(rows, orient="index", columns=columns).rename_axis("engine")
