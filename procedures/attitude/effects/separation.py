"""The measurement that would separate two effects: from the catalogue's entry of the pair, or by their kinds.

Every pair has a valid answer: on unusual designs effects are confounded that no entry lists.
"""

from __future__ import annotations

from rig.procedures.attitude.effects.effect import Effect

_SIDES = "visit some points twice in one replication, once from each side: only backlash changes with the side"
_ORDER = (
    "repeat some points much later in the run: an effect of attitude stays with the point, one of time, temperature or "
    "an interruption does not"
)
_SAME_CAUSE = (
    "visit points with no gravity along the sensor and with 1 g: the offset shows at both alike, the sensitivity only "
    "with gravity"
)
_TIME = "repeat a few points at another enclosure temperature, at the same time of day"
_STEP = "go on for some hours without an interruption: a step stays as it is, a drift or the temperature goes on"
_AXES = (
    "hold one axis of the head and move the other alone: an error of a scale or a backlash is of the axis that moves"
)
_HEAD = "remount the package turned by a known angle: an error of the head stays with the head, others turn along"
_PADS = "lock the pads and repeat a few points: a deflection of the pads disappears, the sensor's own errors stay"
_POWERS = "compare points with +1 g and -1 g along the sensor: a square is the same at both, a cube changes sign"
_PRODUCT = (
    "hold gravity along the sensor and change it across: a product of the components changes, a power of the one "
    "along the sensor does not"
)
_STANDARD = "read a voltage standard on a spare channel: an error of the voltmeter shows there, no other does"
_WAIT = "wait twice as long before reading at some points: an error of settling disappears, others stay"
_SAME_MOVE = "reach some points by steps of another size from the same side: a lag grows with the step"
_LAG = "step the enclosure's temperature once and read one point until nothing changes: a lag decays, the rest stays"
_AUTOCOLLIMATOR = (
    "read an autocollimator on the package at one command before and after: a package or a head that moved shows there"
)
_EVEN = (
    "visit points where gravity along the sensor is the same but the angles are not: an error of the head differs there"
)
_SAME_RANGE = "read a voltage standard at several voltages on a fixed range, in the evening and in the morning"
_AT_REST = {"settling-pitch", "settling-roll", "creep"}
_SIDES_OR_TIME = "visit some points from both sides within the same hour: an effect of the side shows, a drift does not"
_BETWEEN_POINTS = {
    frozenset(
        {"pitch axis"}
    ): "go beyond +-30 deg of pitch, and between the pitches of the design: other periods differ there",
    frozenset(
        {"roll axis"}
    ): "go beyond +-30 deg of roll, and between the rolls of the design: other periods differ there",
    frozenset({"pitch axis", "roll axis"}): _AXES,
    frozenset({"pitch axis", "package"}): _HEAD,
    frozenset({"pitch axis", "sensor"}): _HEAD,
    frozenset({"roll axis", "package"}): _HEAD,
    frozenset({"roll axis", "sensor"}): _HEAD,
    frozenset({"package", "sensor"}): _PADS,
    frozenset({"sensor"}): _POWERS,
}
_WITH_TIME = {
    frozenset({"temperature"}): _SAME_CAUSE,
    frozenset({"time"}): _SAME_CAUSE,
    frozenset({"temperature", "time"}): _TIME,
    frozenset({"pitch axis", "roll axis"}): _AXES,
    frozenset({"pitch axis"}): _SAME_MOVE,
    frozenset({"roll axis"}): _SAME_MOVE,
    frozenset({"sensor"}): _SAME_MOVE,
    frozenset({"sensor", "pitch axis"}): _EVEN,
    frozenset({"sensor", "roll axis"}): _EVEN,
}


def separate(effect: Effect, alias: Effect) -> str:
    """The measurement that would separate `effect` from `alias`, in a few words.

    Without an entry of the catalogue or a rule for the pair, the alias's own experiment.
    """
    if alias.name in effect.known_aliases:
        return effect.known_aliases[alias.name].separate_by
    if effect.name in alias.known_aliases:
        return alias.known_aliases[effect.name].separate_by
    if effect.own or alias.own:
        return effect.separate_by if effect.own else alias.separate_by
    sources, strata = frozenset({effect.source, alias.source}), {effect.stratum, alias.stratum}
    names = {effect.name, alias.name}
    if "voltmeter" in sources:
        return _SAME_RANGE if len(sources) == 1 else _STANDARD
    if any(one.stratum == "replication" or one.name == "index-shift" for one in (effect, alias)):
        return _AUTOCOLLIMATOR
    if len([one for one in (effect, alias) if one.name.startswith("backlash")]) == 1 and names & _AT_REST:
        return _SAME_MOVE
    if len([one for one in (effect, alias) if one.name.startswith("backlash")]) == 1:
        return _SIDES
    if len(names & _AT_REST) == 1:
        return _WAIT
    if names & {"thermal-lag", "thermal-gradient"} and sources <= {"temperature"}:
        return _LAG
    if "between-point" in strata and len(strata) == 2:
        return _ORDER
    if strata == {"between-point"}:
        across = "cross-axis" in names and sources == {"sensor"}
        return _PRODUCT if across else _BETWEEN_POINTS.get(sources, alias.separate_by)
    if "interruption" in sources:
        return _STEP
    return _WITH_TIME.get(sources, _SIDES_OR_TIME)
