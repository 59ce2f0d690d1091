"""Methods of a problem that state it for notebooks and for other libraries: xarray, cvxpy, CasADi and scipy.

The functions are named by their address, because this room imports no solver.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Self

from laufruhe.errors import optional_libraries
from laufruhe.extension import object_at
from laufruhe.problem.measure import Measure

if TYPE_CHECKING:
    import xarray as xr

_FUNCTIONS = {
    "html": "laufruhe.report.notebook:problem_html",
    "affine": "laufruhe.load_models.labelled_rows:labelled_measures",
    "objective_function": "laufruhe.load_models.labelled_rows:objective_function",
    "to_cvxpy": "laufruhe.solvers.cones.cvxpy_program:program_of",
    "to_casadi": "laufruhe.solvers.smooth.statement:smooth_statement",
    "with_objective": "laufruhe.extensions.own_measures.measures:with_objective",
    "with_limit": "laufruhe.extensions.own_measures.measures:with_limit",
}


class Statements:
    """Methods of a problem that state it for other libraries, and that take own measures."""

    def _call(self, name: str, *arguments: Any) -> Any:
        with optional_libraries():
            return object_at(_FUNCTIONS[name])(self, *arguments)

    def _repr_html_(self) -> str:
        return str(self._call("html"))

    def affine(self, angles: int | None = None) -> dict[str, xr.Dataset]:
        """Return the load rows V0 + B x of every term and limit by its name [xarray].

        `constant` is V0 and `slope` is B, both in SI units. `weight` is that of each row in a mean. The dimensions are
        point, mount (or bearing, cylinder), angle, direction and decision. Rows of a mean are samples of the Fourier
        series of a load. A limit has the name that the file gives it.

        Parameters
        ----------
        angles
            Number of samples over the cycle; by default that of the fidelity.

        Raises
        ------
        ModelError
            If loads are not affine in all open numbers.
        """
        data: dict[str, xr.Dataset] = self._call("affine", angles)
        return data

    def to_cvxpy(self, angles: int | None = None) -> Any:
        """Return the problem as a `cvxpy.Problem`, to be solved, or to be extended by own constraints.

        `decisions` has its variables by name [SI]: shape (1,), or real and imaginary part of an unbalance with an open
        angle. `terms` and `limits` have `rows` (forces as affine expressions, shape (k, d)), `at(mount=..., angle=...)`
        and `value` (an expression above the norm, equal to it where it is minimised or its limit binds). After a solve
        `values` and `multipliers` suit `laufruhe.certify`.

        Parameters
        ----------
        angles
            Number of samples over the cycle; by default that of the fidelity. Peaks between samples may exceed limits.

        Raises
        ------
        ModelError
            If loads are not affine in all open numbers, or a norm has no cones.
        """
        return self._call("to_cvxpy", angles)

    def to_casadi(self) -> dict[str, Any]:
        """Return the smooth program of open mounts and unbalances, for `casadi.nlpsol`.

        `nlp` has the symbols x, f and g, `bounds` has lbx, ubx, lbg and ubg, `x0` is the initial design. `names` and
        `constraints` have a name for each x and g. `values(x)` returns the open numbers by the names of results. Norms
        are rounded by 1e-7 of the initial objective where they have a kink (N3).

        Raises
        ------
        ModelError
            If the smooth program lacks one of the open numbers or measures.
        """
        program: dict[str, Any] = self._call("to_casadi")
        return program

    def objective_function(self) -> Any:
        """Return the objective as a function of the decision vector, which returns the value [SI] and the gradient.

        The function has `names`, `start` and `bounds` of its vector, and `values(x)`, the open numbers by the names
        of results: `scipy.optimize.minimize(f, f.start, jac=True, bounds=f.bounds, constraints=f.constraints)`.
        Methods with absolute tolerances, such as SLSQP, need value and gradient divided by `f(f.start)[0]`.

        Raises
        ------
        ModelError
            If loads are not affine in all open numbers.
        """
        return self._call("objective_function")

    def with_objective(self, measure: Measure, weight: float = 1.0) -> Self:
        """Return the problem that minimises a measure of `laufruhe.own_measure` in place of its objective.

        Raises
        ------
        InputError
            If the function of the measure breaks the curvature that is declared.
        """
        problem: Self = self._call("with_objective", measure, weight)
        return problem

    def with_limit(self, measure: Measure, maximum: float, name: str = "") -> Self:
        """Return the problem with one more limit [SI] on a measure of `laufruhe.own_measure`.

        Raises
        ------
        InputError
            If the function of the measure breaks the curvature that is declared.
        """
        problem: Self = self._call("with_limit", measure, maximum, name)
        return problem
