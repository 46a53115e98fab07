"""The safe state: motion stopped, pressure vented, chambers at ambient; reached in a stated time and read back.

Heads are stopped first. Vents are started next, because they take longest; chambers follow. Nothing waits for an
instrument that fails. A failed step is repeated until its time is up. Instruments that cannot be shown to be safe are
named.
"""

from __future__ import annotations

import contextlib
from collections.abc import Collection
from typing import Any

from rig.bench.protection import SafetyConfig
from rig.drivers.clock import Clock
from rig.drivers.roles import Chamber, Head, Instrument, PressureController, Reader, Source
from rig.instruments.opening import Bench
from rig.run_file.events.bench import MadeSafe
from rig.run_file.events.event import EMPTY
from rig.units.of_instruments import PRESSURE

_POLL_S = 0.5
_LONGEST_POLL_S = 5.0
"""First and longest pause between attempts, seconds; each is half as long again as the one before: chosen."""
_SLEW_OVER_S = 2.0
"""Time over which a rate of change is taken, seconds: over less, noise of two readings would be a rate."""
_UNDER_WAY = "under way"


class _Task:
    """One instrument on its way to its safe state.

    Args:
        name: the bench's name for it.
        instrument: opened.

    Attributes:
        problem: the present problem, "" once it is safe.
        told: whether the problem says what was read back.
        found: readbacks.

    """

    harmless = False

    def __init__(self, name: str, instrument: Any, safety: SafetyConfig, clock: Clock) -> None:
        self.name, self.problem, self.told = name, "not tried yet", False
        self.found: dict[str, Any] = {}
        self.instrument, self._safety, self._clock = instrument, safety, clock
        self._tried = False

    def begin(self) -> None:
        """Start at once what takes time."""
        self.go_on(last=False)

    def go_on(self, *, last: bool) -> None:
        """Command the safe state and read it back. No command is sent if an earlier one has succeeded by now.

        Args:
            last: whether this is the last attempt.

        """
        self.told = True
        try:
            self.problem = self._read_back(last) if self._tried else "not tried yet"
        except Exception as error:  # nothing that goes wrong here may keep the others from their safe state
            self.problem = str(error) or repr(error)
        if not self.problem or self.problem == _UNDER_WAY:
            return
        self._tried = True
        try:
            self.instrument.make_safe()
            self.problem = ""  # no readback is possible here; what can be read back is checked
            self.problem = self._read_back(last)
        except Exception as error:  # nothing that goes wrong here may keep the others from their safe state
            self.problem, self.told = str(error) or repr(error), False

    def _read_back(self, last: bool) -> str:
        """The problem by readback, "" if none."""
        return self.problem


class _Reader(_Task):
    harmless = True  # it puts nothing out: its silence does not make a bench unsafe


class _Head(_Task):
    def _read_back(self, last: bool) -> str:
        axes = self.instrument.read()
        self.found |= {f"{axis}_deg": state.position_deg for axis, state in axes.items()}
        moving = [axis for axis, state in axes.items() if state.moving]
        return f"{' and '.join(moving)} still moving; press the emergency stop" if moving else ""


class _Chamber(_Task):
    def _read_back(self, last: bool) -> str:
        state = self.instrument.read()
        self.found |= {"setpoint_degC": state.setpoint_degC, "temperature_degC": state.temperature_degC}
        self.found |= {"running": state.running}
        low, high = self._safety.ambient_degC
        if low <= state.setpoint_degC <= high:
            return ""
        return f"its setpoint reads {state.setpoint_degC:g} degC, not ambient ({low:g} to {high:g}); set it by hand"


class _PressureController(_Task):
    """A pressure controller: it vents while the other instruments are commanded; its rate of change is watched."""

    _before: tuple[float, float] | None = None
    _venting = False

    def begin(self) -> None:
        """Start venting. A failure here is repeated and reported by `go_on`."""
        try:
            self.instrument.vent()
            self._venting = self._tried = True
        except Exception as error:  # nothing that goes wrong here may keep the others from their safe state
            self.problem = str(error) or repr(error)

    def _read_back(self, last: bool) -> str:
        state = self.instrument.read()
        self.found |= {PRESSURE: state.pressure_psia, "controlling": state.controlling}
        self._watch_slew(state.pressure_psia)
        if self._venting:
            if state.venting and not last:
                return _UNDER_WAY
            self._venting = False
            return "control is to be switched off"
        low, high = self._safety.ambient_psia
        if state.controlling:
            return "it still controls pressure; vent it at its panel"
        if low <= state.pressure_psia <= high:
            return ""
        return (
            f"the line is still at {state.pressure_psia:.3f} psia, not vented ({low:g} to {high:g} psia): pressure may "
            f"be trapped; open the line by hand before disconnecting anything"
        )

    def _watch_slew(self, psia: float) -> None:
        now = self._clock.now()
        if self._before is None:
            self._before = (now, psia)
        elif now - self._before[0] >= _SLEW_OVER_S:
            slew = abs(psia - self._before[1]) / (now - self._before[0])
            self.found["fastest_psi_per_s"] = round(max(slew, self.found.get("fastest_psi_per_s", 0.0)), 4)
            self._before = (now, psia)


class _Source(_Task):
    def _read_back(self, last: bool) -> str:
        state = self.instrument.read()
        self.found |= {"setpoint": state.setpoint, "value": state.value, "output": state.output, "safe": state.safe}
        unit = self.instrument.unit()
        if state.safe or state.output:
            return "" if state.safe else f"it still puts out {state.value:g} {unit}; switch it off at its panel"
        return f"it is off and still at {state.value:g} {unit}: let it off by hand before disconnecting anything"


_TASKS: tuple[tuple[type, type[_Task]], ...] = (
    (Head, _Head),
    (PressureController, _PressureController),
    (Source, _Source),
    (Chamber, _Chamber),
    (Reader, _Reader),
    (Instrument, _Task),
)
"""Order of instruments, and how each is brought to its safe state."""


def make_safe(bench: Bench, clock: Clock, only: Collection[str] | None = None) -> MadeSafe:
    """Bring every instrument, or `only` those of these names, to its safe state, also after errors, and verify it by
    readback.
    """
    safety, began = bench.config.safety, clock.now()
    end = began + safety.within_s
    tasks = [
        kind(name, instrument, safety, clock)
        for role, kind in _TASKS
        for name, instrument in bench.instruments.items()
        if _role(instrument) is role and (only is None or name in only)
    ]
    for task in tasks:  # all of them before any is waited for
        task.begin()
    pause = _POLL_S
    while any(task.problem for task in tasks):
        left = end - clock.now()
        with contextlib.suppress(Exception):  # for example out of memory: the remaining instruments are still commanded
            clock.sleep(min(pause, max(left, 0.0)))
        pause = min(1.5 * pause, _LONGEST_POLL_S)
        for task in tasks:
            if task.problem:
                task.go_on(last=left <= 0)
        if left <= 0:
            break
    failed = [task for task in tasks if task.problem]
    return MadeSafe(
        seconds=round(clock.now() - began, 3),
        within_s=safety.within_s,
        unsafe=tuple(_not_safe(task, safety) for task in failed if not task.harmless),
        silent=tuple(f"{task.name}: {task.problem}" for task in failed if task.harmless),
        found={task.name: task.found for task in tasks if task.found},
        only=EMPTY if only is None else tuple(task.name for task in tasks),
    )


def _not_safe(task: _Task, safety: SafetyConfig) -> str:
    """The problem of an instrument, with the value at which it is still on if the problem does not say it."""
    on = "" if task.told else _output(task.instrument, safety)
    return f"{task.name}: {task.problem}{on and f'; it {on}'}"


def outputs_on(bench: Bench, names: Collection[str]) -> list[str]:
    """Outputs of these instruments that are on, each with its value: "calibrator stays on at 1000 V". Commands nothing.

    An instrument that does not answer may be on, and is named.
    """
    told = ((name, _output(bench.instruments[name], bench.config.safety)) for name in names)
    return [f"{name} {words}" for name, words in told if words]


def _output(instrument: Any, safety: SafetyConfig) -> str:
    """An output that is on, with its value: "stays on at 1000 V"; "" for none."""
    role = _role(instrument)
    if role not in (Source, PressureController, Chamber):
        return ""
    try:
        state = instrument.read()
        if role is Source:
            now = f"at {state.value:g} {instrument.unit()}"
            return "" if state.safe else f"stays on {now}" if state.output else f"is off, and still {now}"
        if role is Chamber:
            now = f"{state.setpoint_degC:g} degC, now {state.temperature_degC:.4g} degC"
            return f"stays on at a setpoint of {now}" if state.running else ""
        now, (low, high) = f"{state.pressure_psia:.5g} psia", safety.ambient_psia
        if state.venting:
            return f"is venting, now at {now}"
        if state.controlling:
            return f"keeps control at {now}, setpoint {state.setpoint_psia:.5g} psia"
        return "" if low <= state.pressure_psia <= high else f"is off, and its line stays at {now}"
    except Exception as error:  # an ending is said in any case
        return f"may be on, it was not read: {str(error) or repr(error)}"


_roles: dict[type, type] = {}


def _role(instrument: Any) -> type:
    kind = type(instrument)
    if kind not in _roles:  # an isinstance check against a protocol is slow
        _roles[kind] = next(role for role, _ in _TASKS if role is Instrument or isinstance(instrument, role))
    return _roles[kind]
