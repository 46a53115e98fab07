"""A declared instrument that sets one quantity: a bath, a chamber, a calibrator, a controller of flow or pressure.

Every setpoint is read back before the output is switched on. One that has been off since it was prepared is not
switched on.
"""

from __future__ import annotations

import contextlib
import math
from collections.abc import Callable
from typing import Any

from rig.contracts.declared.roles import Source
from rig.drivers.declared.base import Declared
from rig.drivers.errors import BadReply, DriverError, LimitError, NotReady
from rig.drivers.roles import SourceState

_MOST_READINGS = 10_000  # that a hook is given; chosen
_AGAIN_S = 0.05  # chosen: until the newest message is looked at again
_ON, _OFF = {"1", "ON"}, {"0", "OFF"}


class DeclaredSource(Declared):
    """It satisfies `rig.drivers.roles.Source` and `SelfChecking`."""

    def _begin(self) -> None:
        super()._begin()
        assert self.table.source is not None
        self._source: Source = self.table.source.model_copy(update=self._own())
        self._near_since: float | None = None  # begin of the time within tolerance
        self._set_at = self._clock.now()
        self._readings: list[tuple[float, float]] = []  # since it was set, for the hook
        self._told: float | None = None  # the last setpoint, for one that cannot be asked

    def _own(self) -> dict[str, Any]:
        """Values that the bench file gives instead of those of the file."""
        keys = ("low", "high", "tolerance", "dwell_s", "safe_value", "rest")
        return {key: one for key in keys if (one := getattr(self._options, key, None)) is not None}

    def prepare(self) -> None:
        """Prepare it, and look whether its setpoint is ours (`ready`). Raises `NotReady` too."""
        super().prepare()
        self._require_ready()

    def _require_ready(self) -> None:
        if said := self._unlike(self.table.ready):
            raise NotReady(f"{self._where}: {'; '.join(said)}")

    def unit(self) -> str:
        """Its unit as at the end of column names ("V", "kN", "degC"); a factor that it sets has the same unit."""
        return self._source.unit or ""

    def limits(self) -> tuple[float, float]:
        """Lowest and highest accepted setpoint, in its unit."""
        assert self._source.low is not None
        assert self._source.high is not None
        return self._source.low, self._source.high

    def set(self, value: float) -> None:
        """Command a setpoint with the output on.

        Raises:
            LimitError: outside the limits, or not a number.
            NotReady: it has been switched off since it was prepared, or its setpoint is not ours (`ready`).
            InstrumentError: it refuses.
            BadReply: setpoint or output read back differently; the output has been switched off again.
        """
        low, high = self.limits()
        if not low <= value <= high:
            raise LimitError(f"{self._where}: {value:g} {self.unit()} is outside {low:g} to {high:g}")
        if self._lost():  # its ranges and limits are those of power-on, not those of `prepare`
            raise NotReady(f"{self._where} has been switched off since it was prepared, and is not switched on")
        self._require_ready()
        self._talk.forget_errors()
        self._near_since, self._set_at = None, self._clock.now()
        if self.table.can and self._told is None and self._source.on and self._state() == "on":  # by an earlier session
            self._talk.assume(self._source.on)
        try:
            self._command(value)
            if self._source.on and self._state() != "on":
                for command in self._source.on:
                    self._talk.tell(command)
                if not self._in_time(lambda: self._state() == "on"):
                    raise BadReply(f"{self._where}: the output does not switch on")
        except BadReply:
            self._shut()
            raise
        self._set_at = self._clock.now()

    def _command(self, value: float) -> None:
        """Send a setpoint and read it back. Raises `InstrumentError`, `BadReply`."""
        for command in self._source.set:
            self._talk.tell(command, {"value": command.shown(value)})
        self._told = value
        if self._source.setpoint is None:
            return
        ask, found = self._source.setpoint, math.nan

        def right() -> bool:
            nonlocal found
            found = self._talk.number(ask)
            return abs(found - value) <= self._source.nearness

        if not self._in_time(right):
            raise BadReply(f"{self._where}: {self._source.setpoint.said} should answer {value:g} and answers {found:g}")

    def _in_time(self, right: Callable[[], bool]) -> bool:
        """Whether something is so; with messages, which may show a command late, within the longest wait for one."""
        end = self._clock.now() + self.table.wire.timeout_s + self._clock.grace()
        while not right():
            if not self.table.can or self._clock.now() >= end:
                return False
            self._clock.sleep(_AGAIN_S)
        return True

    def _state(self) -> str:
        """One of "on", "off" and "vent"; one that cannot be switched is always on. Raises `BadReply`."""
        ask = self._source.output
        if ask is None:
            return "on"
        found = self._talk.ask(ask)
        if found.meaning in ("on", "off", "vent"):
            return found.meaning
        word = found.printed.upper().lstrip("+")
        if word not in _ON | _OFF:
            raise self._talk.bad(ask, found.printed, "a word for on, off or vent")
        return "on" if word in _ON else "off"

    def _setpoint(self) -> float:
        if self._source.setpoint is not None:
            return self._talk.number(self._source.setpoint)
        return (
            self._told if self._told is not None else self._talk.number(self._source.read) if self._source.read else 0.0
        )

    def read(self) -> SourceState:
        """Read its state."""
        source = self._source
        setpoint = self._setpoint()
        state = self._state()
        value = setpoint
        if source.read is not None and (state == "on" or source.read_off):
            value = self._talk.number(source.read)
        settled = state == "on" and self._settled(setpoint, value)
        at_safe = source.safe_value is not None and abs(setpoint - source.safe_value) <= source.nearness
        low, high = source.rest or (-math.inf, math.inf)  # a vent takes time, and pressure may be trapped
        safe = state != "on" and low <= value <= high if source.off else at_safe
        return SourceState(setpoint, value, settled, state == "on", safe, self._unlike(self.table.healthy))

    def _settled(self, setpoint: float, value: float) -> bool:
        """Whether it has arrived: by its own word, by its reading, or by the time since it was set."""
        source, now = self._source, self._clock.now()
        if "settled" in self._hooks:
            return self._by_hook(setpoint, value)
        if source.settled is not None:
            found = self._talk.ask(source.settled)
            near = source.tolerance is None or abs(value - setpoint) <= source.tolerance
            near = near and now - self._set_at >= source.settled_after_s
            return near and (found.meaning in ("stable", "on") or (not found.meaning and found.printed in _ON))
        if source.tolerance is None:
            return now - self._set_at >= source.dwell_s
        if abs(value - setpoint) > source.tolerance:
            self._near_since = None
            return False
        if self._near_since is None:
            self._near_since = now
        return now - self._near_since >= source.dwell_s

    def _by_hook(self, setpoint: float, value: float) -> bool:
        """Whether the hook says that it has arrived. Raises `BadReply` if it says nothing."""
        seconds = self._clock.now() - self._set_at
        if self._readings and self._readings[-1][0] > seconds:  # it has been set since
            self._readings.clear()
        self._readings = [*self._readings[-_MOST_READINGS:], (seconds, value)]
        try:
            found = self._hooks["settled"](setpoint, list(self._readings))
        except Exception as error:  # whatever somebody's code raises
            raise BadReply(
                f"{self._where}: settled in {self.table.hook} fails ({type(error).__name__}: {error}) at {value:g}"
            ) from None
        if not isinstance(found, bool):
            raise BadReply(f"{self._where}: settled in {self.table.hook} gives {found!r}, neither True nor False")
        return found

    def stop(self) -> None:
        """Hold the present value: it becomes the setpoint. Raises `NotReady` if the setpoint is not ours (`ready`)."""
        state = self.read()
        if not state.output or state.settled:
            return
        self._require_ready()
        if self._source.hold:
            for command in self._source.hold:
                self._talk.tell(command)
        else:
            low, high = self.limits()
            self._command(min(max(state.value, low), high))
        self._set_at = self._clock.now()

    def make_safe(self) -> None:
        """The safe state: the safe value if there is one, then the output off; both are read back. One that vents is
        not told again.

        Raises:
            NotReady: it is not in its safe state, or has not come to rest yet.
        """
        super().make_safe()
        self._talk.forget_errors()
        if not self._vents():
            self._shut()
        if self._in_time(lambda: self.read().safe):
            return
        state, (low, high) = self.read(), self._source.rest or (-math.inf, math.inf)
        if state.output or low <= state.value <= high:
            raise NotReady(f"{self._where} is not in its safe state: switch it off by hand")
        raise NotReady(
            f"{self._where} is off and still at {state.value:g} {self.unit()}, not {low:g} to {high:g}: if it stays, "
            f"pressure may be trapped; open the line by hand before disconnecting anything"
        )

    def _vents(self) -> bool:
        """Whether it is on its way to rest, and is not to be told again."""
        try:
            return self._source.rest is not None and self._state() == "vent"
        except DriverError:
            return False

    def _shut(self) -> None:
        """Send the safe value and switch off; a step that fails does not prevent the next. Its state is read later."""
        if self._source.safe_value is not None:
            with contextlib.suppress(DriverError):
                self._command(self._source.safe_value)
        for command in self._source.off:
            with contextlib.suppress(DriverError):
                self._talk.tell(command)
