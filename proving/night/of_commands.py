"""What must hold of all that was done to the bench, whatever became of it in the run file."""

from __future__ import annotations

from collections.abc import Iterator
from math import inf

from proving.night.judged import Night
from rig.engine.session import Outcome


def within_limits(night: Night) -> Iterator[str]:
    """Nothing was ever told to go beyond the bench's limits."""
    bench = night.played.plan.bench
    driven = {instrument: factor for factor, instrument in bench.factors.items()}
    quantities = {"setpoint_psia": "{driven}", "setpoint": "{driven}", "setpoint_degC": "{instrument}_degC"}
    told: dict[str, list[float]] = {}
    for change in night.tape.changes:
        axis, _, what = change.what.rpartition(" ")
        if what == "target_deg":
            quantity = f"{axis}_deg"
        elif what in quantities:
            quantity = quantities[what].format(driven=driven.get(change.instrument), instrument=change.instrument)
        else:
            continue
        told.setdefault(quantity, []).append(float(change.value))
    for quantity, values in told.items():
        low, high = bench.limits.get(quantity, (-inf, inf))
        if not (low <= min(values) and max(values) <= high):
            yield f"{quantity} was sent to {min(values):g} ... {max(values):g}, outside {low:g} to {high:g}"


def safe(night: Night) -> Iterator[str]:
    """No session left anything unsafe, but one that said so."""
    for ended in night.played.sessions:
        if ended.outcome is not Outcome.UNSAFE and ended.not_safe:
            yield f"the session that ended {ended.how} at {ended.ended_s:.0f} s left it so: {'; '.join(ended.not_safe)}"


def left_alone(night: Night) -> Iterator[str]:
    """Nothing is vented but at the end of a session, or before a new whole plot."""
    edges = [s.ended_s for s in night.played.sessions]
    vents = (change.t_s for change in night.tape.changes if (change.what, change.value) == ("vent", "open"))
    stopped = [(one.at_s, one.options["for_s"]) for one in night.played.scenario.mishaps if one.kind == "suspend"]
    for t in vents:
        end = next((e for e in edges if e >= t - _ON_ITS_WAY_S), None)
        # a controller that is stopped meanwhile ends when it is back
        away_s = sum(for_s for at_s, for_s in stopped if end is not None and t <= at_s <= end)
        if end is None or end - t - away_s > _VENTING_S:
            yield f"the line was vented at {t:.0f} s, in the middle of a session"


_ON_ITS_WAY_S = 0.1
"""A command that was sent before its controller was killed arrives after it: bytes are on the wire for some 30 ms."""
_VENTING_S = 900.0


def heeded(night: Night) -> Iterator[str]:
    """Nothing is accepted while a chamber has been reporting an alarm for longer than interlocks may go unlooked at."""
    alarms = [
        (one.t_s, one.t_s + one.fault.for_s, one.what)
        for one in night.played.bench.sim.faults.happened
        if one.fault.kind == "chamber-alarm"
    ]
    ends = [until for _, until, _ in alarms]  # one that is over takes an earlier one's alarm with it
    for r in night.accepted():
        began, _ = night.measured_s(r)
        for since, until, what in alarms:
            over = min(end for end in ends if end > since)
            if since + _INTERLOCK_S < began < min(until, over):
                yield f"point {r.run_index} was accepted at {began:.0f} s: {what}"


_INTERLOCK_S = 90.0
