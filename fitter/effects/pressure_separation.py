"""The measurement that would tell two effects of a pressure calibration apart, true of that pair."""

from __future__ import annotations

from fitter.effects.effect import Entry

_MEMORY = frozenset({"creep", "hysteresis", "carry-over"})
_STEPS = "repeat a pressure after steps of different height and side: what remembers the step differs"
_SECOND_GAUGE = (
    "read a second gauge at the transducers' end of the line: an error of the line shows in both, one of a transducer "
    "does not"
)
_ONE_PAIR = (
    "read more pressures at one pair of temperatures: a response to pressure shows within a whole plot, one of the "
    "offset only between them"
)
_BACK = "repeat temperatures of the beginning at the end of the run: drifts and steps differ then, responses do not"
_SOAK = "soak twice as long at a few temperatures: a lag is gone by then"
_TWICE = "repeat a pressure at the beginning and at the end of a whole plot, and of the run"

_BY_SOURCE = {
    frozenset({"line"}): "close the controller off and watch the line with a second gauge, at several pressures",
    frozenset({"sensor"}): "read more pressures between those of the design, at more temperatures",
    frozenset({"temperature"}): "add temperature pairs off the circle of the design, such as full corners",
    frozenset({"chamber"}): "change one of the two temperatures by itself",
    frozenset({"time"}): "repeat the first whole plots at the end of the run, each pressure at both ends of its range",
    frozenset({"line", "sensor"}): _SECOND_GAUGE,
    frozenset({"line", "temperature"}): _ONE_PAIR,
    frozenset({"line", "chamber"}): _SOAK,
    frozenset({"line", "time"}): _SECOND_GAUGE,
    frozenset({"line", "interruption"}): _SECOND_GAUGE,
    frozenset({"sensor", "temperature"}): _ONE_PAIR,
    frozenset({"sensor", "chamber"}): _SOAK,
    frozenset({"sensor", "time"}): _TWICE,
    frozenset({"sensor", "interruption"}): _TWICE,
    frozenset({"temperature", "chamber"}): _SOAK,
    frozenset({"temperature", "time"}): _BACK,
    frozenset({"temperature", "interruption"}): _BACK,
    frozenset({"chamber", "time"}): _SOAK,
    frozenset({"chamber", "interruption"}): _SOAK,
    frozenset({"time", "interruption"}): "go on for some hours without an interruption: a step stays, a drift goes on",
}


def separate_pressure(effect: Entry, alias: Entry) -> str:
    """The measurement that would tell `effect` from `alias`, in a few words."""
    for one, other in ((effect, alias), (alias, effect)):
        if other.name in one.known_aliases:
            return one.known_aliases[other.name].separate_by
    if len(_MEMORY & {effect.name, alias.name}) == 1:
        return _STEPS
    return _BY_SOURCE.get(frozenset({effect.source, alias.source}), alias.separate_by)
