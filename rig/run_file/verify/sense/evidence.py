"""Consistency of evidence: whether the required evidence is present and supports its record."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence, Set
from statistics import median
from typing import Any

from rig.procedures.plan.fault_policies import ACCEPT, step_at
from rig.procedures.plan.run_list import Factor, Settle
from rig.run_file.chain import Record
from rig.run_file.events.bench import (
    AsFound,
    EnvironmentSettled,
    EnvironmentStands,
    Fault,
    Prepared,
    Recovered,
    Warned,
)
from rig.run_file.events.event import Event
from rig.run_file.events.points import CONTRADICTORY, MISSING, Observed, Skipped, WholePlotBegan, WholePlotLost
from rig.run_file.events.sessions import SessionBegan
from rig.run_file.state.state import RunState
from rig.run_file.verify.sense.recorded_run import NOTED, RecordedRun
from rig.run_file.verify.sense.settled import SettlingCriteria, unsettled

_STRAY_SDS, _SDS_OF_MAD = 6.0, 1.4826
"""Same factor as in the controller's search for an outlier among readbacks of a reference."""
_BEYOND = 2.0
"""Number of overtravels, plus one unit, by which an axis may be found beyond its limits."""
_SETPOINT_STANDS = 0.1
_RE_HOME = "re-home"
_CLASS_OF = {
    "noisy": "noisy",
    CONTRADICTORY: "noisy",
    "frozen": "frozen",
    "temperature": "temperature_left",
    "reference": "reference",
    MISSING: "channel",
}
"""Flags, and the class of fault that the procedure accepts with each."""
_OF_THE_RUN = "temperature_left"
_ROUNDING = 1e-9


class Evidence:
    """Checks evidence of settling, flags against policies, references, and outputs that hang.

    Args:
        case: the run.

    Attributes:
        doubts: remarks that are possible in an honest run too, but should be looked at.

    """

    def __init__(self, case: RecordedRun) -> None:
        self.doubts: list[str] = []
        self._case = case
        self._writes_all = False
        self._chambers: set[str] = set()
        self._settled = self._homes_again = False
        self._failures: dict[str, dict[str, int]] = {}
        self._last: tuple[Sequence[float], Observed] | None = None
        self._read_s: list[float] = []
        self._session_s = 0.0
        self._off: dict[str, tuple[int, str]] = {}
        self._waited_for: set[str] = set()

    def look(self, record: Record, event: Event, fold: RunState) -> Iterator[str]:
        """Defects of a record: ends of sentences that begin with the record's name."""
        if isinstance(event, SessionBegan):
            self._writes_all = event.writes_all
            self._homes_again = False
            self._session_s = event.elapsed_s
            self._failures.clear()
        if self._writes_all and not isinstance(event, NOTED):
            yield from self._look(record, event)
            if not isinstance(event, Warned | Observed):
                self._last = None

    def _look(self, record: Record, event: Event) -> Iterator[str]:
        match event:
            case AsFound():
                self._chambers = set(event.chambers)
            case EnvironmentSettled():
                self._settled = True
                yield from self._environment(event.chambers)
            case EnvironmentStands():
                self._settled = True
                yield from self._stands(event.chambers)
            case Prepared():
                yield from self._prepared()
            case WholePlotBegan():
                self._read_s.clear()
                yield from self._soak(event)
            case WholePlotLost():
                yield from self._lost(record, event)
            case Fault():
                self._homes_again |= event.decision == _RE_HOME
                if event.fault is not None and event.failure is not None:
                    place = "run" if event.fault == _OF_THE_RUN else f"point {record.run_index}"
                    self._failures.setdefault(place, {})[event.fault] = event.failure
            case Skipped():
                self._failures.pop(f"point {record.run_index}", None)
            case Recovered():
                self._failures.pop(event.place, None)
            case Observed():
                yield from self._observed(record, event)

    # --- temperatures ------------------------------------------------------------------------------------------------

    def _prepared(self) -> Iterator[str]:
        wanted = self._case.environment is not None and self._case.soak is None
        if wanted and not self._settled and not self._homes_again:
            yield "nothing says that its environment had settled, which the procedure asks for"
        self._settled = self._homes_again = False

    def _environment(self, chambers: Mapping[str, Any]) -> Iterator[str]:
        wanted = self._case.environment
        if wanted is None:
            return
        if missing := sorted(self._chambers - chambers.keys()):
            yield f"it does not say how {', '.join(missing)} settled"
        drift = wanted.drift_degC_per_h / 3600.0
        for name, evidence in chambers.items():
            asked = SettlingCriteria(wanted.setpoint_degC, wanted.tolerance_degC, wanted.dwell_s, drift)
            yield from unsettled(name, evidence, asked)

    def _stands(self, chambers: Mapping[str, Any]) -> Iterator[str]:
        wanted = self._case.environment
        if wanted is None:
            return
        if missing := sorted(self._chambers - chambers.keys()):
            yield f"it does not say how {', '.join(missing)} stood"
        for name, state in chambers.items():
            at, setpoint = state["temperature_degC"], state.get("setpoint_degC", wanted.setpoint_degC)
            if not state.get("running", True) or abs(setpoint - wanted.setpoint_degC) > _SETPOINT_STANDS:
                yield f"{name} did not control at {wanted.setpoint_degC:g} degC"
            elif abs(at - wanted.setpoint_degC) > wanted.tolerance_degC:
                yield f"{name} was at {at:g} degC, not within {wanted.tolerance_degC:g} of {wanted.setpoint_degC:g}"

    def _soak(self, event: WholePlotBegan) -> Iterator[str]:
        soak, bench = self._case.soak, self._case.bench
        if soak is None or bench is None:
            return
        self._waited_for |= event.settling.keys()
        first, _ = self._case.run_list.points.span(event.planned)
        point, drift = self._case.run_list.points[first], soak.drift_degC_per_h / 3600.0
        for factor, target in zip(self._case.run_list.factors, point.setpoints, strict=True):
            if not factor.hard:
                continue
            asked = {}
            if self._case.soaks(factor):
                asked[bench.factors.get(factor.name, "")] = SettlingCriteria(
                    target, soak.tolerance_degC, soak.dwell_s, drift
                )
                within = SettlingCriteria(target, soak.sensor_tolerance_degC, soak.dwell_s, drift)
                # until 2026-11-25 a soak waited for the thermometer with the name of its factor only
                every = bench.thermometers(factor.name)
                asked |= {name: within for name in every if name == factor.name or name in self._waited_for}
            elif factor.name not in self._case.by_hand and self._case.conduct is not None:
                settle = self._case.conduct.settled(factor.axis)
                asked[factor.axis] = SettlingCriteria(target, settle.band, settle.dwell_s, settle.drift_per_s)
            for name, of in asked.items():
                evidence = event.settling.get(name)
                if evidence is None:
                    yield f"it does not say how {name} settled"
                else:
                    yield from unsettled(name, evidence, of)

    def _lost(self, record: Record, event: WholePlotLost) -> Iterator[str]:
        """Check that the number of readings in doubt agrees with the start of the doubt."""
        if (event.doubted_s is None) is not (event.doubted is None):
            yield "it says how many readings are in doubt and not since when, or the other way round"
        elif event.doubted_s is not None:
            doubted = sum(at >= event.doubted_s for at in self._read_s)
            if doubted != event.doubted:
                yield f"{event.doubted} readings are said to be in doubt since {event.doubted_s:.3f} s: it is {doubted}"
            if not self._session_s <= event.doubted_s <= record.elapsed_s:
                yield f"its readings are in doubt since {event.doubted_s:.3f} s, when its session did not look at them"

    # --- observations ------------------------------------------------------------------------------------------------

    def _observed(self, record: Record, event: Observed) -> Iterator[str]:
        last, self._last = self._last, None
        if not event.accepted:
            return
        self._read_s.append(record.elapsed_s)
        index = record.run_index
        assert index is not None
        setpoints = self._case.run_list.points[index].setpoints
        if last is not None and not event.rejected and "frozen" not in event.flags:
            moved = tuple(last[0]) != tuple(setpoints)
            yield from _hanging(event, last[1], self._case.may_repeat, moved=moved)
        self._last = setpoints, event
        yield from self._marks(record, event)
        self._note_chambers(event)
        conduct = self._case.conduct
        for factor, target in zip(self._case.run_list.factors, setpoints, strict=True):
            if not factor.hard and conduct is not None:
                yield from self._axis(factor, target, conduct.settled(factor.axis), event)

    def _axis(self, factor: Factor, target: float, settle: Settle, event: Observed) -> Iterator[str]:
        evidence = event.settling.get(factor.axis)
        if evidence is not None:
            asked = SettlingCriteria(target, settle.band, settle.dwell_s, settle.drift_per_s)
            yield from unsettled(factor.axis, evidence, asked)
        reference = event.references.get(factor.name)
        if not factor.stays and reference is not None:
            middle = median(reference["readings"])
            scatter = _SDS_OF_MAD * median(abs(r - middle) for r in reference["readings"])
            worst = max(reference["readings"], key=lambda r: abs(r - target))
            if abs(worst - target) > max(settle.band, _STRAY_SDS * scatter) + _ROUNDING:
                yield f"{factor.name} read {worst:g} once, too far off its setpoint {target:g} to be accepted"
        limits = None if self._case.bench is None else self._case.bench.limits.get(factor.name)
        came = event.approach.get(factor.axis)
        if limits is not None and came is not None:
            beyond = _BEYOND * factor.overtravel + 1.0
            if not limits[0] - beyond <= came[1] <= limits[1] + beyond:
                yield f"{factor.axis} came from {came[1]:g}, where the limits of the bench let nothing go"

    def _marks(self, record: Record, event: Observed) -> Iterator[str]:
        """Check that flagged observations were accepted by a policy, after the number of failures it requires."""
        if len(set(event.flags)) < len(event.flags):
            yield f"it is marked twice: {', '.join(event.flags)}"
        conduct = self._case.conduct
        for flag in dict.fromkeys(event.flags):
            fault = _CLASS_OF.get(flag)
            if fault is None or conduct is None:
                continue
            if flag == "temperature" and self._case.environment is None:
                yield "it is marked for its temperature, and the procedure asks for none"
            elif fault in conduct.faults.classes():
                told = self._failures.get("run" if fault == _OF_THE_RUN else f"point {record.run_index}", {})
                if step_at(conduct.faults.plan(fault), told.get(fault, 0) + 1)[0] != ACCEPT:
                    yield f"it is marked as {flag}, and the procedure does not accept that here"

    def _note_chambers(self, event: Observed) -> None:
        """Check chambers: one that somebody sets or switches off stays near its temperature for a while."""
        wanted = self._case.environment
        if wanted is None or self._case.soak is not None:
            return
        for name, state in event.environment.items():
            setpoint, running = state.get("setpoint_degC"), state.get("running", True)
            if not running:
                words = "was not controlling"
            elif setpoint is not None and abs(setpoint - wanted.setpoint_degC) > _SETPOINT_STANDS:
                words = f"was set to {setpoint:g} degC, not to {wanted.setpoint_degC:g}"
            else:
                continue
            count, first = self._off.get(name, (0, words))
            self._off[name] = count + 1, first
            self.doubts = [f"{chamber} {what} at {n} observation(s)" for chamber, (n, what) in self._off.items()]


def _hanging(event: Observed, before: Observed, coarse: Set[str], *, moved: bool) -> Iterator[str]:
    """Check that an output that repeats its previous reading to the last digit is flagged, or not accepted. That of a
    coarse display may.
    """
    for name, channel in event.outputs.items():
        if name in coarse:
            continue
        then = before.outputs.get(name, {}).get("readings")
        if then and set(channel["readings"]) == {then[-1]} and (moved or len(set(then)) > 1):
            yield f"{name} repeats its reading of the observation before, to the last digit, and is not marked"
