"""Druck PACE5000 and PACE6000 pressure controllers, on serial or TCP (`socket://host:5025`).

Commands from the SCPI manual K0472, issue 1 and revision A; how they are sent is `drivers.druck_scpi`'s.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Annotated, Literal, Self

from pydantic import Field, model_validator

from drivers.clock import Clock
from drivers.druck_ranges import full_scale_psi, reference_of
from drivers.druck_scpi import SYNC, PaceScpi
from drivers.errors import BadReply, InstrumentError, LimitError, NotReady, WrongInstrument
from drivers.roles import Identity, PressureState
from drivers.scpi import PREPARED
from drivers.wires import SerialSettings, Wires
from drivers.wires.serial_options import SerialOptions

PASCALS = {
    "PSI": 6894.757293168,
    "BAR": 1e5,
    "MBAR": 100.0,
    "HPA": 100.0,
    "KPA": 1e3,
    "MPA": 1e6,
    "PA": 1.0,
    "TORR": 101325.0 / 760.0,
    "MMHG": 133.322387415,
}
"""Units that a reading may come in, in pascals, should somebody have changed them at the front panel."""

_READBACK = 1e-5
_PRESSURE_READBACK_PSI = 2e-5
_SATURATED_PCT = 95.0
_AT_AMBIENT_PSI = 0.3  # where the valve to the atmosphere may open without a blow
_VENTED_PSI = 0.5  # more than this from the atmosphere after a vent is pressure left behind
_ATMOSPHERE_PSI = (6.5, 16.5)  # from the highest towns to the deepest pits
_BELOW_VACUUM_PSI = -0.5  # a sensor's zero is nowhere as far off
_BEYOND = 1.1  # a range ends a little above its name
_VENT_S = 60.0  # for the vent itself, beyond the slew
_POLL_S = 1.0

Positive = Annotated[float, Field(gt=0)]


@dataclass(frozen=True)
class _Scale:
    """One unit of the controller, psi, the absolute pressure that it calls 0, and the control range's name."""

    unit_psi: float
    zero_psia: float
    range: str

    def psia(self, told: float) -> float:
        return told * self.unit_psi + self.zero_psia


class DruckPACE:
    """One control module of the controller; satisfies `drivers.roles.PressureController` and `Restartable`.

    Args:
        name: the bench's name for it.
        address: serial address, or `socket://host:5025`.
        options: see `Options`.
        wires: where to open it.
        clock: bench time.

    Raises:
        Unreachable: the address cannot be opened.

    """

    wire = "serial"

    class Options(SerialOptions):
        """What the bench file may say about this instrument."""

        slew_psi_per_s: Positive = Field(0.1, description="how fast pressure is changed")
        vent_psi_per_s: Positive = Field(0.2, description="how fast it goes to the atmosphere")
        in_limits_pct_fs: Annotated[float, Field(gt=0, le=100)] = Field(
            0.01, description="band in which it calls the pressure settled, percent of full scale"
        )
        in_limits_s: Annotated[int, Field(ge=2, le=999)] = Field(2, description="and for how long")
        low_psia: float = Field(0.0, ge=0, description="lowest setpoint that may be commanded")
        high_psia: float = Field(15.0, description="highest setpoint that may be commanded")
        reference: Literal["absolute", "gauge"] = Field(
            "absolute", description="what its pressures are counted from; gauge adds the barometer's"
        )
        ambient_psia: Annotated[float, Field(gt=0)] = Field(
            14.7, description="pressure of the atmosphere, where it has no barometer; gauge then needs it said"
        )
        control_range: str | None = Field(None, description="control range by its name; the one selected if not given")
        module: Literal[1, 2] = Field(1, description="control module; 2 only in a PACE6000")
        baud: Literal[2400, 4800, 9600, 19200, 38400, 57600, 115200] = Field(9600, description="symbols per second")
        frame: Literal["8N1", "7E1", "7O1", "8E1", "8O1"] = Field("8N1", description="data bits, parity, stop bits")
        timeout_s: Positive = Field(2.0, description="wait for a reply")

        @model_validator(mode="after")
        def _in_order(self) -> Self:
            if self.low_psia >= self.high_psia:
                raise ValueError("low_psia must be below high_psia")
            return self

    def __init__(self, name: str, address: str, options: Options, wires: Wires, clock: Clock) -> None:
        self.name = name
        self._options = options
        self._clock = clock
        settings = SerialSettings(
            options.baud,
            options.frame,
            options.flow_at(address),
            send_end=options.send_end,
            reply_end=options.reply_end,
            timeout_s=options.timeout_s,
            sync=SYNC,
        )
        self._line = wires.serial(address, settings, name)
        self._pace = PaceScpi(self._line)
        suffix = "" if options.module == 1 else "2"
        self._unit = f":UNIT{suffix}:PRES"
        self._source, self._sense, self._output = f":SOUR{suffix}:PRES", f":SENS{suffix}:PRES", f":OUTP{suffix}:STAT"
        self._vent = f"{self._source}:LEV:IMM:AMPL:VENT"
        self._in_limits_from = -math.inf  # earlier than this no setpoint can have been reached
        self._vent_by: float | None = None  # on the way to the atmosphere; the valve opens at the latest then
        self._vent_started = False
        self._left_behind: tuple[str, ...] = ()
        self._no_air: tuple[str, ...] = ()
        self._has_barometer = False  # it has told an atmosphere
        self._range: str | None = None  # the control range's name when it was prepared

    def limits(self) -> tuple[float, float]:
        """See `PressureController.limits`."""
        return self._options.low_psia, self._options.high_psia

    def identify(self) -> Identity:
        """See `Instrument.identify`."""
        answer = self._pace.ask("*IDN?")
        parts = [part.strip() for part in answer.split(",")]
        model = next((m for m in ("PACE5000", "PACE6000") if len(parts) == 4 and m in parts[1].upper()), None)
        if model is None or "DRUCK" not in parts[0].upper():
            raise WrongInstrument(
                f"{self._line.where} should be a Druck PACE5000 or PACE6000; it answers {answer!r} to *IDN?"
            )
        if self._options.module == 2 and model == "PACE5000":
            raise WrongInstrument(f"{self._line.where} is a PACE5000, which has no module 2")
        return Identity(parts[0], model, parts[2], parts[3])

    def prepare(self) -> None:
        """Set unit, slew and in-limits band, and read them back. A pressure under control stays as it is.

        Raises:
            InstrumentError: a setting was refused.
            BadReply: a setting reads back as something else, pressures are not counted from what the bench says, or
                control range, barometer and pressure contradict the unit that it says it is set to.

        """
        options, source = self._options, self._source
        self._pace.forget_errors()
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
        self._range = self._check_range()
        self._pace.send(f"*ESE {PREPARED}")
        self._pace.check("*ESE?", PREPARED, 0.0)

    def restarted(self) -> bool:
        """See `Restartable.restarted`.

        By the mark that `prepare` leaves: the power-on bit of *ESR? is reserved and always 0 in these instruments.
        """
        return self._pace.number("*ESE?") != PREPARED

    def set_pressure(self, psia: float) -> None:
        """See `PressureController.set_pressure`. Gives up a vent.

        Raises:
            LimitError: outside the limits, or no number.
            InstrumentError: the controller refuses it.
            BadReply: unit, control range, slew or setpoint are not as wanted; control is not switched on, or is
                switched off once the setpoint was sent.

        """
        low, high = self.limits()
        if not low <= psia <= high:
            raise LimitError(f"{self._line.where}: {psia:g} psia is outside {low:g} to {high:g}")
        self._control(psia, self._options.slew_psi_per_s, checked=True)

    def read(self) -> PressureState:
        """See `PressureController.read`.

        On the way to the atmosphere this also opens the vent valve when the pressure has come near enough.
        Pressures are understood in whatever unit the controller is set to.

        Raises:
            BadReply: the controller is set to an unknown unit or to another control range than when it was prepared,
                an answer makes no sense, or the pressure is less than a vacuum's.

        """
        state = self._state(self._checked_scale())
        self._refuse_below_vacuum(state.pressure_psia)
        return state

    def _state(self, scale: _Scale) -> PressureState:
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
            setpoint, pressure, settled, controlling, venting, effort, faults=(*lost, *self._left_behind, *self._no_air)
        )

    def stop(self) -> None:
        """See `PressureController.stop`. A vent under way is given up too; a line that is only measured stays so."""
        state = self._state(self._scale())
        if state.controlling or state.venting:
            self._control(max(state.pressure_psia, 0.0), self._options.slew_psi_per_s)

    def vent(self) -> None:
        """See `PressureController.vent`: to the atmosphere at `vent_psi_per_s` under control, then the valve opens."""
        state = self._state(self._scale())
        if state.venting:
            return
        atmosphere = self._atmosphere()
        away, slew = abs(state.pressure_psia - atmosphere), self._options.vent_psi_per_s
        if away > _AT_AMBIENT_PSI:
            try:
                self._control(atmosphere, slew)
            except InstrumentError:  # a control range that ends below the atmosphere: the valve is all there is
                self._start_vent()
            else:
                self._vent_by = self._clock.now() + 1.5 * away / slew + _VENT_S / 2.0
        else:
            self._start_vent()

    def make_safe(self) -> None:
        """See `Instrument.make_safe`: the line goes to the atmosphere at the vent's slew, then control is off.

        Takes no longer than one and a half times the way at that slew, and two minutes. If a source is lost and the
        slew does not arrive, the valve to the atmosphere is opened nevertheless. A control range changed by hand is
        understood by its name.

        Raises:
            NotReady: pressure is left in the line.

        """
        self._pace.forget_errors()
        self._pace.send(f"{self._unit} PSI")  # whatever it is set to, this can be understood
        self.vent()
        state = self._state(self._scale())
        away = abs(state.pressure_psia - self._atmosphere())
        end = self._clock.now() + 1.5 * away / self._options.vent_psi_per_s + 2.0 * _VENT_S
        while state.venting and self._clock.now() < end:
            self._clock.sleep(_POLL_S)
            state = self._state(self._scale())
        self._pace.send(f"{self._output} 0")
        for words in self._trapped(state.pressure_psia):
            raise NotReady(f"{self._line.where}: {words}")

    def close(self) -> None:
        """See `Instrument.close`."""
        self._line.close()

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

    def _control(self, psia: float, slew_psi_per_s: float, *, checked: bool = False) -> None:
        """Unit and slew, then the setpoint, and control only when all of them are as wanted.

        Nothing is taken for granted of what `prepare` set: a power cut since would have the fastest slew in force.
        Only what makes the line safe may use a control range that is not the one prepared (`checked` false).
        """
        self._end_vent()
        self._set_unit()
        scale = self._checked_scale() if checked else self._scale()
        if checked:
            self._refuse_unknown_zero()
        self._set({"SLEW": slew_psi_per_s, "SLEW:OVER": 0})
        setpoint = psia - scale.zero_psia
        self._pace.send(f"{self._source} {setpoint:.7f}")
        try:
            self._pace.check(f"{self._source}?", setpoint, _PRESSURE_READBACK_PSI)
            self._check_unit()  # changed by hand meanwhile, slew and setpoint are numbers in another one
            if (name := self._selected_range()) != scale.range:
                raise BadReply(
                    f"{self._line.where}: the control range was {scale.range!r} and is {name!r} after the setpoint"
                )
        except BadReply:  # a pressure under control is already on its way to whatever it is
            self._pace.send(f"{self._output} 0")
            raise
        self._in_limits_from = self._clock.now() + self._options.in_limits_s
        self._pace.send(f"{self._output} 1")

    def _set_unit(self) -> None:
        """Set the unit of this module and read it back: slew and setpoints are numbers in it."""
        self._pace.send(f"{self._unit} PSI")
        self._check_unit()

    def _check_unit(self) -> None:
        if (answer := self._pace.ask(f"{self._unit}?")).upper() != "PSI":
            raise BadReply(
                f"{self._line.where}: module {self._options.module} was set to PSI and says {answer!r}; "
                f"{self._unit}? asks for it"
            )

    def _start_vent(self) -> None:
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
        """Whether the valve to the atmosphere may open: the pressure is near, or has had its time to come near."""
        near = abs(pressure_psia - self._atmosphere()) <= _AT_AMBIENT_PSI
        return near or (self._vent_by is not None and self._clock.now() >= self._vent_by)

    def _vent_status(self) -> int:
        """0 idle, 1 under way, 2 completed; newer firmware also has other ends, which the pressure tells apart."""
        return round(self._pace.number(f"{self._vent}?"))

    # Judgement

    def _lost_source(self, setpoint_psia: float, effort_pct: float, scale: _Scale) -> tuple[str, ...]:
        """Whether a valve is fully open because the source behind it is not what it should be."""
        which, sign = (1, 1.0) if effort_pct > 0 else (2, -1.0)
        source = scale.psia(self._pace.number(f"{self._source}:COMP{which}?"))
        if sign * (source - setpoint_psia) > 0:
            return ()
        told = f"{source:.3f} psia and the setpoint is {setpoint_psia:.3f} psia (control effort {effort_pct:.0f} %)"
        if which == 1:
            return (f"supply pressure lost: the supply port reads {told}; check gas bottle, regulator and hose",)
        return (f"vacuum lost: the vacuum port reads {told}; check vacuum pump, its valve and hose",)

    def _trapped(self, pressure_psia: float) -> tuple[str, ...]:
        if abs(pressure_psia - self._atmosphere()) <= _VENTED_PSI:
            return ()
        return (
            f"the vent has ended and the line is still at {pressure_psia:.3f} psia: pressure may be trapped; "
            f"open the line by hand before disconnecting anything",
        )

    def _check_range(self) -> str:
        """The control range's name; one, a barometer or a pressure that contradict bench or unit are refused."""
        where, options = self._line.where, self._options
        name = self._selected_range()
        reference, full_scale = reference_of(name, PASCALS), full_scale_psi(name, PASCALS)
        if reference != options.reference:
            unknown = "" if reference else ", whose name does not end in a (absolute) or g (gauge)"
            raise BadReply(
                f"{where}: the control range is {name!r}{unknown}, but the bench says "
                f"reference = {options.reference!r}; give `control_range`, or correct `reference`"
            )
        if options.control_range is not None and name.upper() != options.control_range.upper():
            raise BadReply(f"{where}: the control range {options.control_range!r} was selected and it says {name!r}")
        air = self._pace.number(f"{self._sense}:BAR?")
        if air and not _ATMOSPHERE_PSI[0] <= air <= _ATMOSPHERE_PSI[1]:
            raise BadReply(
                f"{where}: its barometer reads {air:g} and it says it is set to PSI: that is no atmosphere; "
                f"look at the unit of module {options.module} on its display"
            )
        if not air and options.reference == "gauge" and not self._air_is_given():
            raise BadReply(
                f"{where}: its barometer reads 0, and gauge pressures are counted from the atmosphere; "
                f"give `ambient_psia`, the pressure of the atmosphere where it stands"
            )
        pressure = self._pace.number(f"{self._sense}?")
        if options.reference == "absolute":
            self._refuse_below_vacuum(pressure)
        if full_scale is None:
            return name
        if not -_BEYOND * max(full_scale, _ATMOSPHERE_PSI[1]) <= pressure <= _BEYOND * full_scale + _ATMOSPHERE_PSI[1]:
            raise BadReply(
                f"{where}: it reads {pressure:g} and says it is set to PSI, but its control range {name!r} ends at "
                f"{full_scale:g} psi; look at the unit of module {options.module} on its display"
            )
        highest = full_scale + (self._barometer(1.0) if options.reference == "gauge" else 0.0)
        if options.high_psia > _BEYOND * highest:
            raise BadReply(
                f"{where}: the bench says high_psia = {options.high_psia:g}, but the control range {name!r} ends at "
                f"{highest:.4g} psia; give `control_range`, or correct `high_psia`"
            )
        return name

    # Questions

    def _selected_range(self) -> str:
        """Name of the control range, which says how far it goes and what pressures are counted from."""
        return self._pace.ask(f"{self._source}:RANG?").strip('"')

    def _unit_psi(self) -> float:
        """The unit of this moment: somebody may have changed it at the front panel."""
        name = self._pace.ask(f"{self._unit}?")
        if name.upper() not in PASCALS:
            raise BadReply(f"{self._line.where} is set to the unknown unit {name!r}; set it to PSI")
        return PASCALS[name.upper()] / PASCALS["PSI"]

    def _scale(self) -> _Scale:
        """What the controller's numbers mean at this moment, by its unit and by its control range's name."""
        unit, name = self._unit_psi(), self._selected_range()
        gauge = (reference_of(name, PASCALS) or self._options.reference) == "gauge"
        return _Scale(unit, self._barometer(unit) if gauge else 0.0, name)

    def _refuse_below_vacuum(self, psia: float) -> None:
        if psia < _BELOW_VACUUM_PSI:
            raise BadReply(
                f"{self._line.where}: it reads {psia:.4g} psia, less than a vacuum; look at its sensor, its zero, and "
                f"what the control range counts from"
            )

    def _checked_scale(self) -> _Scale:
        """The same, and refused if the control range is not the one prepared: its limits have been checked there."""
        scale = self._scale()
        told, wanted = reference_of(scale.range, PASCALS), self._options.reference
        if told != wanted or self._range not in (None, scale.range):
            before = "the bench says" if self._range is None else f"it was {self._range!r} when it was prepared,"
            raise BadReply(
                f"{self._line.where}: the control range is {scale.range!r} ({told or 'reference unknown'}); "
                f"{before} reference = {wanted!r}; select the former range again at the front panel"
            )
        return scale

    def _refuse_unknown_zero(self) -> None:
        """Refuse a setpoint that would be counted from an atmosphere that nobody has measured."""
        if self._options.reference == "gauge" and self._no_air:
            raise BadReply(f"{self._line.where}: no gauge pressure is set while {self._no_air[0]}")

    def _atmosphere(self) -> float:
        return self._barometer(self._unit_psi())

    def _barometer(self, unit_psi: float) -> float:
        """Pressure of the atmosphere, psi; by the bench file where there is no barometer, which reads 0.

        One that reads no atmosphere is not believed, and `read` says so; 0 too, if it has told an atmosphere before or
        gauge pressures are counted from it and the bench does not say `ambient_psia`.
        """
        told = self._pace.number(f"{self._sense}:BAR?") * unit_psi
        if _ATMOSPHERE_PSI[0] <= told <= _ATMOSPHERE_PSI[1]:
            self._has_barometer, self._no_air = True, ()
            return told
        needed = self._options.reference == "gauge" and not self._air_is_given()
        self._no_air = (
            (f"the barometer reads {told:.4g} psi, which is no atmosphere; ambient_psia is used instead",)
            if told or self._has_barometer or needed
            else ()
        )
        return self._options.ambient_psia

    def _air_is_given(self) -> bool:
        return "ambient_psia" in self._options.model_fields_set

    def _in_limits(self) -> tuple[float, bool]:
        question = f"{self._sense}:INL?"
        answer = self._pace.ask(question)
        pressure, _, flag = answer.partition(",")
        if flag.strip() not in ("0", "1"):
            raise self._line.bad_reply(question, answer, "a pressure and 0 or 1")
        return self._pace.as_number(question, pressure), flag.strip() == "1"
