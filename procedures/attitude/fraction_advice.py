"""Cost and information of a fraction of a run, in sentences for a plan."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from rig.procedures.present.words import significant

_AS_GOOD = 1.02
"""Limit of the ratio of standard errors of all data, with a fraction's and with their own coefficients; the paper has
1.002 to 1.01.
"""

_TOO_FEW_INSIDE = 0.9
"""Share of the readings within 95 % intervals below which there is a remark."""

_MUCH = 3.0
"""Differences between a coefficient of the fraction and of the whole run, in standard errors, above which there is a
remark.
"""

_FINDINGS = {"T_bias": "lack of fit", "T_b": "offset drift", "T_S": "sensitivity drift"}
_P = {"T_bias": "p_bias", "T_b": "p_b", "T_S": "p_S"}
_ALPHA = 0.05
"""Probability of a false positive over all tests of all sensors, for effects that a fraction must find."""


def advised(full: Mapping[str, Any], fractions: Sequence[Mapping[str, Any]]) -> tuple[Mapping[str, Any], str]:
    """The smallest fraction that fits all data and finds the effects of the whole run, with the reason.

    If none finds the drift too, the smallest that finds every lack of fit; if none does, the largest.

    Args:
        full: the whole run, from `compare_fractions`.
        fractions: the same for each fraction.
    """
    for tests, what in ((tuple(_FINDINGS), "what"), (("T_bias",), "every lack of fit that")):
        good = [part for part in fractions if _as_good(full, part, tests)]
        if good:
            best = min(good, key=lambda part: int(part["points"]))
            return best, f"is the smallest that finds {what} the whole run finds and fits all of its readings"
    largest = max(fractions, key=lambda part: int(part["points"]))
    return largest, "is the largest; none finds every lack of fit that the whole run finds and fits all of its readings"


def _as_good(full: Mapping[str, Any], part: Mapping[str, Any], tests: Sequence[str]) -> bool:
    chance = _ALPHA / (len(_FINDINGS) * len(full["sensors"]))
    for name, whole in full["sensors"].items():
        own = part["sensors"][name]
        wanted = [test for test in tests if significant(whole, test) and whole[_P[test]] <= chance]
        if own["residual_deg"] > _AS_GOOD * whole["residual_deg"] or not all(significant(own, test) for test in wanted):
            return False
    return True


def sentence(full: Mapping[str, Any], part: Mapping[str, Any]) -> str:
    """Costs and losses of these points in place of all."""
    sensors = part["sensors"]
    ratios = [s["interval_ratio"] for s in sensors.values() if s["interval_ratio"] is not None]
    said = [f"calibration interval {_span(ratios)} times as wide" if ratios else "no calibration interval at all"]
    more = 100.0 * (max(s["residual_deg"] / full["sensors"][name]["residual_deg"] for name, s in sensors.items()) - 1.0)
    said.append(f"residuals of the whole run {'no' if more < 0.05 else f'up to {more:.1f} %'} larger")
    inside = [s["coverage95"] for s in sensors.values() if s["coverage95"] is not None]
    if inside and min(inside) < _TOO_FEW_INSIDE:
        said.append(f"its 95 % prediction intervals hold only {100.0 * min(inside):.0f} % of the readings")
    said += _shifted(sensors)
    for test, what in _FINDINGS.items():
        said += _found(full, part, test, what)
    share = f"{part['points']} of {full['points']} points ({100.0 * part['share']:.0f} % of the time)"
    return f"{share} would have cost: {'; '.join(said)}"


def _shifted(sensors: Mapping[str, Any]) -> list[str]:
    largest = {
        name: max((abs(v) for v in s["shift"].values() if v is not None), default=0.0) for name, s in sensors.items()
    }
    worst = max(largest, key=lambda name: largest[name])
    if largest[worst] < _MUCH:
        return []
    return [f"a coefficient of {worst} off by {largest[worst]:.1f} of its standard errors"]


def _found(full: Mapping[str, Any], part: Mapping[str, Any], test: str, what: str) -> list[str]:
    before = {name for name, sensor in full["sensors"].items() if significant(sensor, test)}
    after = {name for name, sensor in part["sensors"].items() if significant(sensor, test)}
    cases = (
        ("still found", before & after),
        ("no longer found", before - after),
        ("found by these alone", after - before),
    )
    return [f"{what} {how}{_on(names, full)}" for how, names in cases if names]


def _on(names: set[str], full: Mapping[str, Any]) -> str:
    every = list(full["sensors"])
    return "" if len(names) == len(every) else f" on {', '.join(name for name in every if name in names)}"


def _span(values: Sequence[float]) -> str:
    low, high = f"{min(values):.1f}", f"{max(values):.1f}"
    return low if low == high else f"{low} to {high}"


def settings(part: Mapping[str, Any]) -> str:
    """The lines of a procedure's [design] for this fraction."""
    pitch, roll = part["pitch_deg"], part["roll_deg"]
    if part["name"] in ("T4", "T6"):
        return f'type = "{part["name"]}"'
    every = f"fraction = {{ pitch_every = {part['K_alpha']}, roll_every = {part['K_R']} }}"
    decimated = [every] if part["K_alpha"] > 1 else []
    if _uniform(pitch, pitch[-1]) and pitch[-1] > 0 and _uniform(roll, 180.0):
        lines = ['type = "D1"', f"pitch_max_deg = {pitch[-1]:g}", f"pitch_count = {len(pitch)}"]
        return "\n".join([*lines, f"roll_count = {len(roll)}", *decimated])
    return "\n".join(['type = "D"', f"pitch_deg = {_listed(pitch)}", f"roll_deg = {_listed(roll)}", *decimated])


def _uniform(angles_deg: Sequence[float], end_deg: float) -> bool:
    return len(angles_deg) > 1 and bool(np.allclose(angles_deg, np.linspace(-end_deg, end_deg, len(angles_deg))))


def _listed(angles_deg: Sequence[float]) -> str:
    return f"[{', '.join(f'{angle:g}' for angle in angles_deg)}]"
