"""The measurement that would separate two effects of a pressure calibration, valid for that pair."""

from __future__ import annotations

from rig.fitter.effects.entry import Entry
from rig.procedures.pressure.effects.scene import SECOND_GAUGE, SOAK

_MEMORY = frozenset({"creep", "hysteresis", "carry-over"})
_STEPS = "repeat a pressure after steps of different height and side: an effect of the step differs"
_ONE_PAIR = (
    "read more pressures at one pair of temperatures: a response to pressure shows within a whole plot, one of the "
    "offset only between them"
)
_BACK = "repeat temperatures of the beginning at the end of the run: drifts and steps differ then, responses do not"
_SUPPLY = "record the supply's voltage through the run, and read a fixed bridge with the transducers"
_TWICE = "repeat a pressure at the beginning and at the end of a whole plot, and of the run"

_BY_SOURCE = {
    frozenset({"line"}): "close the controller off and watch the line with a second gauge, at several pressures",
    frozenset({"interruption"}): "repeat a few whole plots, each pressure, of before and after both moments",
    frozenset({"sensor"}): "read more pressures between those of the design, at more temperatures",
    frozenset({"temperature"}): "add temperature pairs off the circle of the design, such as full corners",
    frozenset({"chamber"}): "change one of the two temperatures by itself",
    frozenset({"time"}): "repeat the first whole plots at the end of the run, each pressure at both ends of its range",
    frozenset({"line", "sensor"}): SECOND_GAUGE,
    frozenset({"line", "temperature"}): _ONE_PAIR,
    frozenset({"line", "chamber"}): SOAK,
    frozenset({"line", "time"}): SECOND_GAUGE,
    frozenset({"line", "interruption"}): SECOND_GAUGE,
    frozenset({"sensor", "temperature"}): _ONE_PAIR,
    frozenset({"sensor", "chamber"}): SOAK,
    frozenset({"sensor", "time"}): _TWICE,
    frozenset({"sensor", "interruption"}): _TWICE,
    frozenset({"temperature", "chamber"}): SOAK,
    frozenset({"temperature", "time"}): _BACK,
    frozenset({"temperature", "interruption"}): _BACK,
    frozenset({"chamber", "time"}): SOAK,
    frozenset({"chamber", "interruption"}): SOAK,
    frozenset({"time", "interruption"}): "go on for some hours without an interruption: a step stays, a drift goes on",
}


def separate_pressure(effect: Entry, alias: Entry) -> str:
    """The measurement that would separate `effect` from `alias`, in a few words."""
    for one, other in ((effect, alias), (alias, effect)):
        if other.name in one.known_aliases:
            return one.known_aliases[other.name].separate_by
    if "voltmeter" in (effect.source, alias.source):
        return _SUPPLY
    if len(_MEMORY & {effect.name, alias.name}) == 1:
        return _STEPS
    return _BY_SOURCE.get(frozenset({effect.source, alias.source}), alias.separate_by)
