"""Smooth variation of the remainder: with pressure, with a temperature, with time; and its order."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
from numpy.polynomial.legendre import legvander

from rig.fitter.arrays import FloatArray
from rig.fitter.linear import orthonormal
from rig.fitter.quantiles import f_tail
from rig.fitter.trace.found import Unnamed
from rig.procedures.pressure.data import WholePlotData
from rig.procedures.pressure.trace.neighbours import neighbours
from rig.procedures.pressure.trace.problem import Problem
from rig.procedures.pressure.trace.score import beside
from rig.procedures.pressure.trace.strata import Level

HIGHEST = 6
"""Maximum order of the tried polynomials."""
ADDS = 0.02
"""Minimum remaining share of a term's length beside the others."""
SLOPE = "pressure times "
_WHERE: dict[Level, str] = {"subplot": "within whole plots", "whole-plot": "between whole plots"}


def smoothest(
    problem: Problem,
    chosen: tuple[int, ...],
    data: WholePlotData,
    i: int,
    level: Level,
    among_slopes: Callable[[FloatArray], float],
) -> tuple[Unnamed, float]:
    """The variable and order with the most significant part of the remainder in a stratum of transducer `i`.

    Args:
        problem: the run.
        chosen: candidates in the model.
        data: its observations.
        i: the transducer.
        level: the stratum.
        among_slopes: probability of a basis (n, q) beside whole plots' slopes, where these scatter.

    Returns:
        Its place and its share of the remainder, and the probability of such a part by chance, over all orders of all
        variables; one without variables.
    """
    stratum, strata = beside(problem, level, chosen, ()), problem.strata[i]
    left, df = stratum.white.outputs[i], float(stratum.df[i])
    total, here = float(left @ left), problem.within(level, chosen)
    taken = problem.at[level].columns[i][:, here]
    tried, best, alike = 0, (1.0, "", 0.0), neighbours(problem, chosen)
    for name, columns in _variables(data, level):
        length = np.linalg.norm(strata.whiten(columns), axis=0) if level == "subplot" else _length(problem, i, columns)
        own = strata.leave(columns, level)
        for order in range(1, columns.shape[1] + 1):
            known = orthonormal(taken, problem.length_at[level][i, here], ADDS)
            part = own[:, :order] - known @ (known.T @ own[:, :order])
            basis = orthonormal(part, length[:order], ADDS)
            q = basis.shape[1]
            if q == 0 or df - q < 2:
                continue
            tried += 1
            held = float(np.sum((basis.T @ left) ** 2))
            p = f_tail(held / q / max((total - held) / (df - q), np.finfo(float).tiny), q, df - q)
            if level == "whole-plot" and p < best[0]:
                p = max(p, alike.p_of_block(i, basis, left))
            elif name.startswith(SLOPE) and p < best[0]:
                p = max(p, among_slopes(basis))
            if p < best[0]:
                best = p, f"{_WHERE[level]}, with {name}, to order {order}", held / total
    return Unnamed(best[1], best[2]), min(best[0] * max(tried, 1), 1.0)


def _variables(data: WholePlotData, level: Level) -> Sequence[tuple[str, FloatArray]]:
    """Names, and polynomials from the first order on, of the possible variables of a stratum."""
    p, sensor, sse = (_orders(v) for v in (data.pressure_psia, data.sensor_temperature_degC, data.sse_temperature_degC))
    if level == "whole-plot":
        return (
            ("the transducer's temperature", sensor),
            ("the electronics' temperature", sse),
            ("time", _orders(data.elapsed_s)),
        )
    slope = p[:, :1]
    return (
        ("pressure", p),
        (f"{SLOPE}the transducer's temperature", slope * sensor[:, :4]),
        (f"{SLOPE}the electronics' temperature", slope * sse[:, :4]),
        ("time since a whole plot began", _orders(data.since_s)[:, :4]),
        (f"{SLOPE}the time of the run", slope * _orders(data.elapsed_s)[:, :4]),
    )


def _orders(value: FloatArray) -> FloatArray:
    """(n, HIGHEST) Legendre polynomials over the range of a variable."""
    low, high = float(value.min()), float(value.max())
    x = (2.0 * value - low - high) / (high - low) if high > low else np.zeros_like(value)
    return np.asarray(legvander(x, HIGHEST)[:, 1:])


def _length(problem: Problem, i: int, columns: FloatArray) -> FloatArray:
    strata = problem.strata[i]
    return np.asarray(np.linalg.norm(strata.means(columns) * strata.precision[:, None], axis=0))
