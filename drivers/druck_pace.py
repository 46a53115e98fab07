"""Druck PACE5000 and PACE6000 pressure controllers, on serial or TCP (`socket://host:5025`).

Commands are from the SCPI manual K0472, issue 1 and revision A. Identity, errors, mark and answers are those of a file,
`druck_pace.toml`; `rig.drivers.druck_measures` interprets the numbers.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any, ClassVar

from rig.drivers.clock import Clock
from rig.drivers.druck_measures import Measures, Scale
from rig.drivers.druck_options import FILE, PaceOptions
from rig.drivers.druck_scpi import PaceScpi
from rig.drivers.errors import BadReply, InstrumentError, LimitError, NotReady, WrongInstrument
from rig.drivers.kept import not_kept
from rig.drivers.numbers import decimal
from rig.drivers.roles import Identity, PressureState
from rig.drivers.scpi import PREPARED
from rig.drivers.wires import Wires

_READBACK = 1e-5  # relative: settings are sent with seven digits
_PRESSURE_READBACK_PSI = 2e-5  # chosen: some of the last printed digits of a setpoint
_SATURATED_PCT = 95.0  # control effort of a valve that is fully open, but for noise; chosen
_AT_AMBIENT_PSI = 0.3  # here the valve to the atmosphere may open without a shock
_VENTED_PSI = 0.5  # a larger difference from the atmosphere after a vent is trapped pressure
_ACTIVE = ("ACT", "ACTIVE")  # controls to the setpoint; in its other modes it may only measure
_VENT_S = 60.0  # for the vent itself, in addition to the slew
_POLL_S = 1.0  # chosen; a vent takes a minute


class DruckPACE(FILE):  # type: ignore[misc]  # made of its file
    """One control module of the controller; satisfies `rig.drivers.roles.PressureController`, `Restartable` and
    `SelfChecking`.

    Args:
        name: the bench's name for it.
        address: serial address, or `socket://host:5025`.
        options: see `Options`.
        wires: where to open it.
        clock: bench time.

    Raises:
        Unreachable: the address cannot be opened.

    """

    speaks_unasked: ClassVar[bool] = False
    Options = PaceOptions

    def __init__(self, name: str, address: str, options: PaceOptions, wires: Wires, clock: Clock) -> None:
        wire = FILE.table.wire.model_copy(update={"timeout_s": options.timeout_s})
        self.table: Any = FILE.table.model_copy(update={"wire": wire})
        super().__init__(name, address, options, wires, clock)
        self._pace, self._line = PaceScpi(self._talk), self._talk.line
        self._measures = Measures(self._pace, self._line.where, options)
        self._source, self._sense = self._measures.source, self._measures.sense
        self._output, self._mode = (f":OUTP{'' if options.module == 1 else 2}:{what}" for what in ("STAT", "MODE"))
        self._vent = f"{self._source}:LEV:IMM:AMPL:VENT"
        self._in_limits_from = -math.inf  # no setpoint can be reached before this time
        self._vent_by: float | None = None  # on the way to the atmosphere; the latest time at which the valve opens
        self._vent_started = False
        self._left_behind: tuple[str, ...] = ()
        self._kept: dict[str, float | str] = {}  # settings of this driver, by question

    def limits(self) -> tuple[float, float]:
        """Lowest and highest accepted setpoint, psi absolute."""
        return self._options.low_psia, self._options.high_psia

    def identify(self) -> Identity:
        """Ask for the identity. Raises `WrongInstrument` for another model, `NoReply` without an answer."""
        found: Identity = super().identify()
        if self._options.module == 2 and found.model == "PACE5000":
            raise WrongInstrument(f"{self._line.where} is a PACE5000, which has no module 2")
        return found

    def prepare(self) -> None:
        """Set unit, slew and in-limits band, and read them back. A controlled pressure does not change.

        Raises:
            InstrumentError: a setting was refused.
            BadReply: a setting reads back differently, the reference of pressures is not that of the bench, or control
                range, barometer and pressure contradict its unit.
        """
        options, source = self._options, self._source
        self._talk.forget_errors()
        self._set_unit()
        if options.control_range is not None:
            self._pace.send(f'{source}:RANG "{options.control_range}"')
        settings = {
            "SLEW": options.slew_psi_per_s,
            "SLEW:OVER": 0,
            "INL": options.in_limits_pct_fs,
            "INL:TIME": options.in_limits_s,
        }
        self._set(settings)
        self._pace.send(f"{self._mode} ACT")
        if (answer := self._pace.ask(f"{self._mode}?")).upper() not in _ACTIVE:
            raise BadReply(f"{self._line.where}: {self._mode}? should answer ACT and answers {answer!r}")
        self._kept[f"{self._mode}?"] = answer
        self._kept[f"{source}:RANG?"] = self._measures.accept_range()
        self._pace.send(f"*ESE {PREPARED}")
        self._pace.check("*ESE?", PREPARED, 0.0)

    def wrong(self) -> Sequence[str]:
        """Settings that are not as declared: unit, control range, slew, in-limits band, setpoint, mode of control and
        whether it is on, as this driver set them.
        """
        found = []
        for question, wanted, answer in not_kept(self._kept, self._pace.ask, _as_set):
            found.append(f"{question} answers {answer}, not {wanted if isinstance(wanted, str) else f'{wanted:.7g}'}")
            if question.startswith(self._measures.unit):
                break  # the others are numbers in it
        return found

    def set_pressure(self, psia: float) -> None:
        """Command a setpoint with control on. Cancels a vent.

        Raises:
            LimitError: outside the limits, or not a number.
            InstrumentError: the controller refuses it.
            BadReply: unit, control range, slew or setpoint are not as wanted; or control does not switch on, or has
                switched off after the setpoint.
        """
        low, high = self.limits()
        if not low <= psia <= high:
            raise LimitError(f"{self._line.where}: {psia:g} psia is outside {low:g} to {high:g}")
        self._control(psia, self._options.slew_psi_per_s, checked=True)

    def read(self) -> PressureState:
        """Read its state.

        On the way to the atmosphere this also opens the vent valve once the pressure is near enough. Pressures are
        converted from the controller's present unit.

        Raises:
            BadReply: the controller is set to an unknown unit or to another control range than when it was prepared, an
                answer makes no sense, or the pressure is below zero.
        """
        state = self._state(self._measures.checked_scale())
        self._measures.refuse_below_vacuum(state.pressure_psia)
        return state

    def _state(self, scale: Scale) -> PressureState:
        setpoint = scale.psia(self._pace.number(f"{self._source}?"))
        reading, flag = self._in_limits()
        pressure = scale.psia(reading)
        controlling = self._pace.flag(f"{self._output}?")
        effort = self._pace.number(f"{self._source}:EFF?") if controlling else 0.0
        if self._vent_by is not None and self._may_open(pressure):
            self._start_vent()
            controlling, effort = False, 0.0
        venting = self._vent_by is not None or (not controlling and self._vent_status() == 1)
        if self._vent_started and not venting:
            self._vent_started = False
            self._left_behind = self._trapped(pressure)
        lost = self._lost_source(setpoint, effort, scale) if abs(effort) >= _SATURATED_PCT else ()
        settled = flag and controlling and not venting and self._clock.now() >= self._in_limits_from
        return PressureState(
            setpoint,
            pressure,
            settled,
            controlling,
            venting,
            effort,
            faults=(*lost, *self._left_behind, *self._measures.no_air),
        )

    def stop(self) -> None:
        """Hold the present pressure: it becomes the setpoint. A running vent is cancelled too; a line without control
        stays without control.
        """
        state = self._state(self._measures.scale())
        if state.controlling or state.venting:
            self._control(max(state.pressure_psia, 0.0), self._options.slew_psi_per_s)

    def vent(self) -> None:
        """Vent: to the atmosphere at `vent_psi_per_s` under control, then the valve opens."""
        state = self._state(self._measures.scale())
        if state.venting:
            return
        atmosphere = self._measures.atmosphere()
        away, slew = abs(state.pressure_psia - atmosphere), self._options.vent_psi_per_s
        if away > _AT_AMBIENT_PSI:
            try:
                self._control(atmosphere, slew)
            except InstrumentError:  # the control range ends below the atmosphere: only the valve can vent
                self._start_vent()
            else:
                self._vent_by = self._clock.now() + 1.5 * away / slew + _VENT_S / 2.0
        else:
            self._start_vent()

    def make_safe(self) -> None:
        """The safe state: the line goes to the atmosphere at the vent's slew, then control is off.

        It takes at most one and a half times the duration at that slew, plus two minutes. If a source is lost and the
        slew does not arrive, the valve to the atmosphere is opened nevertheless. A control range changed by hand is
        interpreted by its name.

        Raises:
            NotReady: pressure is trapped in the line.
        """
        self._talk.forget_errors()
        self._pace.send(f"{self._measures.unit} PSI")  # this is valid in every setting
        self.vent()
        state = self._state(self._measures.scale())
        away = abs(state.pressure_psia - self._measures.atmosphere())
        end = self._clock.now() + 1.5 * away / self._options.vent_psi_per_s + 2.0 * _VENT_S
        while state.venting and self._clock.now() < end:
            self._clock.sleep(_POLL_S)
            state = self._state(self._measures.scale())
        self._control_off()
        for words in self._trapped(state.pressure_psia):
            raise NotReady(f"{self._line.where}: {words}")

    # Control

    def _set(self, settings: Mapping[str, float]) -> None:
        """Send the linear slew mode and settings of the source, and read all of them back."""
        source = self._source
        self._pace.send(f"{source}:SLEW:MODE LIN")
        for setting, value in settings.items():
            self._pace.send(f"{source}:{setting} {value:.7g}")
        if (answer := self._pace.ask(f"{source}:SLEW:MODE?")).upper() != "LIN":
            raise BadReply(f"{self._line.where}: {source}:SLEW:MODE? should answer LIN and answers {answer!r}")
        for setting, value in settings.items():
            self._pace.check(f"{source}:{setting}?", float(value), _READBACK * value)
        self._kept |= {f"{source}:SLEW:MODE?": "LIN", **{f"{source}:{s}?": float(v) for s, v in settings.items()}}

    def _set_unit(self) -> None:
        self._measures.set_unit()
        self._kept[f"{self._measures.unit}?"] = "PSI"

    def _control(self, psia: float, slew_psi_per_s: float, *, checked: bool = False) -> None:
        """Set unit and slew, then the setpoint; switch on control only if all of them are correct.

        Settings of `prepare` are not trusted: after a power cut the fastest slew would be in force. Only steps to the
        safe state may use another control range than the prepared one (`checked` false).
        """
        self._end_vent()
        self._set_unit()
        scale = self._measures.checked_scale() if checked else self._measures.scale()
        if checked:
            self._measures.refuse_unknown_zero()
        self._set({"SLEW": slew_psi_per_s, "SLEW:OVER": 0})
        setpoint = psia - scale.zero_psia
        self._pace.send(f"{self._source} {setpoint:.7f}")
        try:
            self._pace.check(f"{self._source}?", setpoint, _PRESSURE_READBACK_PSI)
            self._measures.check_unit()  # after a change by hand, slew and setpoint are numbers in another unit
            if (name := self._measures.selected_range()) != scale.range:
                raise BadReply(
                    f"{self._line.where}: the control range was {scale.range!r} and is {name!r} after the setpoint"
                )
        except BadReply:  # a controlled pressure is already on its way
            self._control_off()
            raise
        self._kept[f"{self._source}?"] = setpoint
        # Until then the flag may still be that of the last setpoint.
        self._in_limits_from = self._clock.now() + self._options.in_limits_s
        self._pace.send(f"{self._output} 1")
        self._kept[f"{self._output}?"] = 1.0

    def _control_off(self) -> None:
        self._kept.pop(f"{self._output}?", None)
        self._pace.send(f"{self._output} 0")

    def _start_vent(self) -> None:
        self._kept.pop(f"{self._output}?", None)
        self._pace.send(f"{self._vent} 1")
        self._vent_by = None
        self._vent_started = True

    def _end_vent(self) -> None:
        self._vent_by = None
        self._vent_started = False
        self._left_behind = ()
        if self._vent_status() == 1:
            self._pace.send(f"{self._vent} 0")

    def _may_open(self, pressure_psia: float) -> bool:
        """Whether the valve to the atmosphere may open: the pressure is near, or the time to get near has passed."""
        near = abs(pressure_psia - self._measures.atmosphere()) <= _AT_AMBIENT_PSI
        return near or (self._vent_by is not None and self._clock.now() >= self._vent_by)

    def _vent_status(self) -> int:
        """0 idle, 1 under way, 2 completed. Newer firmware has further final states; the pressure distinguishes
        them.
        """
        return round(self._pace.number(f"{self._vent}?"))

    # Judgement

    def _lost_source(self, setpoint_psia: float, effort_pct: float, scale: Scale) -> tuple[str, ...]:
        """Whether a valve is fully open because its source pressure is wrong."""
        which, sign = (1, 1.0) if effort_pct > 0 else (2, -1.0)
        source = scale.psia(self._pace.number(f"{self._source}:COMP{which}?"))
        if sign * (source - setpoint_psia) > 0:
            return ()
        told = f"{source:.3f} psia and the setpoint is {setpoint_psia:.3f} psia (control effort {effort_pct:.0f} %)"
        if which == 1:
            return (f"supply pressure lost: the supply port reads {told}; check gas bottle, regulator and hose",)
        return (f"vacuum lost: the vacuum port reads {told}; check vacuum pump, its valve and hose",)

    def _trapped(self, pressure_psia: float) -> tuple[str, ...]:
        if abs(pressure_psia - self._measures.atmosphere()) <= _VENTED_PSI:
            return ()
        return (
            f"the vent has ended and the line is still at {pressure_psia:.3f} psia: pressure may be trapped; "
            f"open the line by hand before disconnecting anything",
        )

    def _in_limits(self) -> tuple[float, bool]:
        question = f"{self._sense}:INL?"
        answer = self._pace.ask(question)
        pressure, _, flag = answer.partition(",")
        if flag.strip() not in ("0", "1"):
            raise self._line.bad_reply(question, answer, "a pressure and 0 or 1")
        return self._pace.as_number(question, pressure), flag.strip() == "1"


def _as_set(answer: str, wanted: float | str) -> bool:
    """Whether a setting is as it was set; numbers but for their last printed digits."""
    if isinstance(wanted, str):
        return answer.strip('"').upper() == wanted.upper()
    try:
        return abs(decimal(answer) - wanted) <= max(_READBACK * abs(wanted), _PRESSURE_READBACK_PSI)
    except ValueError:
        return False
