"""The loads of a live page as a page of Dash, for `bench_live_page.py`: run by a Python that has Dash.

Arguments: a file of NumPy's with V0 (points, angles, mounts, 2), B (columns, points, angles, mounts, 2) and the start,
and a port. Less is drawn than on the live page: no orders.
"""

from __future__ import annotations

import sys
from typing import Any


def main(path: str, port: int) -> None:
    """Serve until killed."""
    import numpy as np
    from dash import Dash, Input, Output, dcc, html

    model = np.load(path)
    fixed, columns, start = model["fixed"], model["columns"], model["start"]
    degrees = np.linspace(0.0, 720.0, fixed.shape[1], endpoint=False)
    app = Dash("live", serve_locally=True)
    ranges = [
        dcc.Input(id=f"x{k}", type="range", value=float(value), min=0, max=0.05, step="any")
        for k, value in enumerate(start)
    ]
    graphs = [dcc.Graph(id=name) for name in ("angle", "polar", "bars")]
    app.layout = html.Div([html.Div(id="value"), *ranges, *graphs])

    @app.callback(
        *(Output(graph.id, "figure") for graph in graphs), Output("value", "children"),
        *(Input(slider.id, "value") for slider in ranges),
    )  # fmt: skip
    def drawn(*x: Any) -> Any:
        forces = fixed + np.tensordot(np.asarray(x, dtype=float), columns, axes=1)
        sizes = np.linalg.norm(forces, axis=-1)
        mounts = range(fixed.shape[2])
        angle = {"data": [{"x": degrees, "y": sizes[0, :, k], "mode": "lines"} for k in mounts]}
        polar = {"data": [{"x": forces[0, :, k, 0], "y": forces[0, :, k, 1], "mode": "lines"} for k in mounts]}
        bars = {"data": [{"y": sizes[0].mean(axis=0), "type": "bar"}, {"y": sizes[0].max(axis=0), "type": "bar"}]}
        return angle, polar, bars, f"{sizes.mean():.9g} N"

    app.run(host="127.0.0.1", port=port, debug=False)


if __name__ == "__main__":
    main(sys.argv[1], int(sys.argv[2]))
