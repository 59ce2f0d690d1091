"""The contract of result.json as a JSON schema, written down a second time on purpose."""

from __future__ import annotations

from typing import Any

NUMBER = {"type": "number"}
MAYBE = {"type": ["number", "null"]}
TEXT = {"type": "string"}


def table(**properties: Any) -> dict[str, Any]:
    """Return an object that has all of these keys; it may have more."""
    return {"type": "object", "properties": properties, "required": list(properties)}


def array(items: Any) -> dict[str, Any]:
    return {"type": "array", "items": items}


ORDERS = array(table(order=NUMBER, amplitude=NUMBER))
MOUNT = table(name=TEXT, mean=NUMBER, max=NUMBER, rms=NUMBER, orders=ORDERS)
SHAKING = table(orders=array(NUMBER), force=array(NUMBER), moment=array(NUMBER), roll=array(NUMBER),
                rocking=array(NUMBER))  # fmt: skip
SERIES = table(angle=array(NUMBER), components=array(TEXT), shaking=array(array(NUMBER)))
POINT = table(name=TEXT, speed=NUMBER, weight=NUMBER)
POINT["properties"]["series"] = SERIES
DECISION = table(value=NUMBER, unit=TEXT, lower=NUMBER, upper=NUMBER, at_bound={"type": "boolean"})
CONSTRAINT = table(
    name=TEXT, value=NUMBER, error_estimate=MAYBE, limit=NUMBER, unit=TEXT, active={"type": "boolean"},
    shadow_price=MAYBE,
    tightening_price=MAYBE,
)  # fmt: skip
SCHEMA = {
    "$schema": "https://json-schema.org/draft/2020-12/schema",
    **table(
        made_by={"const": "laufruhe"},
        problem=TEXT,
        status={"enum": ["optimal", "feasible", "infeasible", "failed"]},
        objective={"anyOf": [{"type": "null"}, table(name=TEXT, value=MAYBE, unit=TEXT, initial=MAYBE)]},
        certificate=table(
            kind={"enum": ["global", "global within gap", "local", "none"]},
            lower_bound=MAYBE,
            gap=MAYBE,
            kkt_residual=MAYBE,
            method=TEXT,
        ),
        decisions={"type": "object", "additionalProperties": DECISION},
        constraints=array(CONSTRAINT),
        mounts=array(MOUNT),
        shaking=SHAKING,
        points=array(POINT),
        balance_factors=array(table(cylinders=array(TEXT), factor=NUMBER)),
        warnings=array(TEXT),
        firing_intervals=array(NUMBER),
        fidelity=table(kinematics=TEXT, samples={"type": "integer"}, error_estimate=MAYBE),
        timing={"type": "object", "additionalProperties": NUMBER},
        versions={"type": "object", "additionalProperties": TEXT},
    ),
}
