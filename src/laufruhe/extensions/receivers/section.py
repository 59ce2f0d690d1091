"""Report section and picture of receivers: response with and without weighting, and its strongest frequencies."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from laufruhe.extensions.receivers.facts import OrderAmplitudes, amplitudes_of, has_receivers, unit_of, weighting_words
from laufruhe.extensions.receivers.machine import receivers_of
from laufruhe.present.measures import decided_design, designs_with_loads
from laufruhe.present.numbers import figure, number
from laufruhe.present.pictures import ResultPicture
from laufruhe.present.tables import Table
from laufruhe.report.section import Section
from laufruhe.solvers.result import Result

STRONGEST = 3
NEGLIGIBLE = 1e-9


def _tables(result: Result) -> list[Table]:
    rows = []
    for loads in result.final.loads:
        for receiver in receivers_of(result.final.engine):
            unit, answer = unit_of(receiver), amplitudes_of(receiver, loads)
            rows.append((
                loads.point.name, receiver.name, weighting_words(receiver), figure(answer.rms_plain, unit),
                figure(answer.rms, unit), _strongest(answer),
            ))  # fmt: skip
    note = (
        f"Root mean square of the {decided_design(result)} over the cycle, without direction weights of objective and "
        "limits. Strongest: the frequencies with the largest weighted amplitudes."
    )
    head = ("at", "receiver", "weighting", "without weighting", "weighted", "strongest")
    return [Table(head, tuple(rows), title="What receivers feel", left=3, note=note, file="receivers")]


def _strongest(answer: OrderAmplitudes) -> str:
    largest = float(answer.weighted.max(initial=0.0))
    indices = np.argsort(-answer.weighted)[:STRONGEST]
    per_order = answer.frequencies[1] if len(answer.frequencies) > 1 else 1.0
    words = [
        f"{number(float(answer.frequencies[k]), 3)} Hz"
        for k in indices.tolist()
        if per_order and answer.weighted[k] > NEGLIGIBLE * largest
    ]
    return ", ".join(words) or "none"


def _record(result: Result) -> Mapping[str, Any]:
    """Return the response of every receiver of the final design at every operating point [SI]."""
    return {
        receiver.name: {
            "quantity": receiver.quantity,
            "unit": unit_of(receiver),
            "weighting": weighting_words(receiver),
            "points": [
                {"name": loads.point.name, "rms_without_weighting": answer.rms_plain, "rms": answer.rms}
                for loads in result.final.loads
                for answer in [amplitudes_of(receiver, loads)]
            ],
        }
        for receiver in receivers_of(result.final.engine)
    }


def _spectrum(result: Result) -> Table:
    rows: list[list[Any]] = []
    for name, design in designs_with_loads(result).items():
        for loads in design.loads:
            for receiver in receivers_of(design.engine):
                answer = amplitudes_of(receiver, loads)
                for order, frequency, plain, weighted in zip(
                    loads.wrench.orders.tolist(), answer.frequencies.tolist(), answer.plain.tolist(),
                    answer.weighted.tolist(), strict=False,
                ):  # fmt: skip
                    if plain > 0.0:
                        unit = unit_of(receiver)
                        rows.append([name, loads.point.name, receiver.name, unit, order, frequency, plain, weighted])
    head = ["design", "point", "receiver", "unit", "order", "frequency [Hz]", "amplitude", "weighted amplitude"]
    return Table(head, rows)


SECTION = Section(
    "receivers", has_receivers, _tables, _record, ("receivers",), {"receiver-spectrum": (has_receivers, _spectrum)}
)
PICTURE = ResultPicture(
    "receivers",
    "Response at receivers by frequency, with and without weighting, and weighted over crank speed.",
    "laufruhe.extensions.receivers.picture",
)
