"""Physics of what a transducer or a line keeps of earlier pressures, temperatures and hours."""

from __future__ import annotations

from itertools import pairwise

import numpy as np

from rig.fitter.arrays import FloatArray
from rig.procedures.pressure.effects.scene import ROOM_K, PressureScene

_BOLTZMANN_EV = 8.617e-5
"""eV/K."""
_TINY = float(np.finfo(float).tiny)
LOWEST = 1e-3
"""Share of the highest pressure below which gas counts as if it were there: a vacuum has no logarithm."""


def _of_gas(scene: PressureScene) -> tuple[FloatArray, FloatArray]:
    """(n,) pressures of the gas, and of the settings before, psia."""
    least = max(LOWEST * float(np.max(scene.p)), _TINY)
    return np.maximum(scene.p, least), np.maximum(scene.p - scene.change_psia, least)


def in_a_tube(scene: PressureScene, tau_h: float) -> FloatArray:
    """(n,) what gas in a tube still lacks of the pressure, psi.

    It flows by the difference of the squares of the pressures at its ends.

    Of one temperature and viscous: dp/dt = (P^2 - p^2) / (2 P0 tau), so that (p - P) / (p + P) fades with exp(-t P
    / (P0 tau)) (Poiseuille's law for gas): slower at low pressure.

    Args:
        tau_h: at P0, the lowest pressure of the run, h.
    """
    index, (p, before) = scene.data.whole_plot_index, _of_gas(scene)
    fading = np.exp(-np.maximum(scene.waited_h, 0.0) * p / (float(p.min()) * tau_h))
    inside, executed = p.copy(), np.lexsort((scene.data.order, index))
    for last, row in pairwise([-1, *executed.tolist()]):
        begin = last < 0 or index[last] != index[row]
        from_p = before[row] if begin else inside[last]
        ratio = (from_p - p[row]) / (from_p + p[row]) * fading[row]
        inside[row] = p[row] * (1.0 + ratio) / (1.0 - ratio)
    return np.asarray(inside - p)


def dragged(scene: PressureScene, share: float) -> FloatArray:
    """(n,) what friction holds of the pressure's way, -1 to 1, turned after some share of the range (Dahl 1968).

    It goes on from one whole plot to the next, as it does not fade.
    """
    data, span = scene.data, share * max(float(np.ptp(scene.p)), _TINY)
    executed = np.argsort(data.order, kind="stable")
    path = np.column_stack([data.previous_pressure_psia, scene.p])[executed].ravel()
    known = ~np.isnan(path)
    out = np.empty(len(data))
    out[executed] = held_back(path[known], span)[np.cumsum(known)[1::2] - 1]
    return out


def dragged_by(scene: PressureScene, temperature: FloatArray, share: float) -> FloatArray:
    """(n,) the same of a temperature's way, from whole plot to whole plot."""
    each, in_time = scene.in_turn(temperature)
    return held_back(each, share * max(float(np.ptp(each)), _TINY))[in_time]


def compressed(scene: PressureScene, tau_h: float) -> FloatArray:
    """(n,) part of the absolute temperature by which gas is still warmer after steps of the pressure.

    A step adds ln(P / before), as without exchange of heat and for a small exponent; it fades with `tau_h`.
    """
    index, (p, before) = scene.data.whole_plot_index, _of_gas(scene)
    added = np.log(p / before)
    fading = np.exp(-np.maximum(scene.waited_h, 0.0) / tau_h)
    warm, executed = added * fading, np.lexsort((scene.data.order, index))
    for last, row in pairwise(executed.tolist()):
        if index[last] == index[row]:
            warm[row] = (warm[last] + added[row]) * fading[row]
    return np.asarray(warm * scene.kelvin / ROOM_K)


def aged(scene: PressureScene, activation_eV: float) -> FloatArray:
    """(n,) time in the run, h, that counts more while the transducer is warm (Arrhenius); zero in its middle."""
    rate = np.exp(activation_eV / _BOLTZMANN_EV * (1.0 / float(np.mean(scene.kelvin)) - 1.0 / scene.kelvin))
    executed, out = np.argsort(scene.hours, kind="stable"), np.empty(len(scene.data))
    steps = np.diff(scene.hours[executed], prepend=scene.hours[executed][0])
    out[executed] = np.cumsum(steps * rate[executed])
    return np.asarray((out - out.mean()) / max(float(rate.mean()), _TINY))


def held_back(values: FloatArray, span: float) -> FloatArray:
    """(n,) -1 to 1: the side from which values (n,) came, as far as they have moved since they turned, over `span`.

    Zero at the first: Dahl, "A solid friction model", Aerospace Corporation TOR-0158 (1968).
    """
    out = np.zeros(len(values))
    for k, step in enumerate(np.diff(values), 1):
        side = np.sign(step)
        out[k] = side + (out[k - 1] - side) * np.exp(-abs(step) / span)
    return out
