"""Temperatures: the laboratory's daily cycle, the enclosure that attenuates it, the package that lags behind.

Enclosure air and package are first-order systems driven by a constant, a ramp and the daily sine. So both have closed
forms between two commands. A command begins a new interval with the present temperatures; nothing is integrated step by
step.
"""

# ruff: noqa: N802  (a quantity's name ends in its unit, and units keep their own case)

from __future__ import annotations

from dataclasses import dataclass
from math import atan, cos, exp, hypot, inf, pi, sin

from rig.sims.physics.told import Told
from rig.sims.physics.truth import EnclosureTruth, LabTruth

DAY_S = 86400.0
OMEGA = 2.0 * pi / DAY_S
_PER_HPA = {"hPa": 1.0, "mbar": 1.0, "kPa": 0.1, "Pa": 100.0, "bar": 1e-3}
"""Units of the air's pressure, each by its number in a hectopascal."""


class Lab:
    """The laboratory's temperature, humidity and pressure.

    Args:
        truth: mean, daily cycle and drift of the temperature; the others are constant.
        epoch_utc: UTC at virtual time zero, seconds since 1970-01-01.

    """

    def __init__(self, truth: LabTruth, epoch_utc: float) -> None:
        self.humidity_pct, self.pressure_hPa = truth.humidity_pct, truth.pressure_hPa
        self.mean = truth.mean_degC
        self.slope = truth.drift_degC_per_day / DAY_S
        self.amplitude = truth.daily_amplitude_degC
        warmest = truth.warmest_hour_utc * 3600.0
        self.phase = OMEGA * ((epoch_utc - warmest) % DAY_S) + pi / 2.0

    def degC(self, t: float) -> float:
        """Temperature at virtual time `t`."""
        return self.mean + self.slope * t + self.amplitude * sin(OMEGA * t + self.phase)

    def air(self, unit: str) -> float:
        """Relative humidity, or pressure, by its unit; infinite in any other."""
        if unit in ("pct", "percent"):
            return self.humidity_pct
        return self.pressure_hPa * _PER_HPA[unit] if unit in _PER_HPA else inf


@dataclass(frozen=True, slots=True)
class _Drive:
    """Input of a first-order system: constant + slope * (t - start) + amplitude * sin(omega t + phase)."""

    constant: float
    slope: float
    amplitude: float
    phase: float

    def lagged(self, tau_s: float) -> _Drive:
        """The steady response of a first-order system with time constant `tau_s`."""
        x = OMEGA * tau_s
        return _Drive(
            self.constant - self.slope * tau_s, self.slope, self.amplitude / hypot(1.0, x), self.phase - atan(x)
        )

    def at(self, t: float, start: float) -> float:
        return self.constant + self.slope * (t - start) + self.amplitude * sin(OMEGA * t + self.phase)

    def rate(self, t: float) -> float:
        return self.slope + self.amplitude * OMEGA * cos(OMEGA * t + self.phase)


class _Stretch:
    """Both temperatures from `start` until the next interval."""

    __slots__ = (
        "_air",
        "_air_tau",
        "_air_transient",
        "_follow",
        "_package",
        "_package_tau",
        "_package_transient",
        "start",
    )

    def __init__(
        self, start: float, drive: _Drive, air_tau: float, package_tau: float, begin: tuple[float, float]
    ) -> None:
        if abs(package_tau - air_tau) < 1e-6 * air_tau:  # the closed form below divides by their difference
            package_tau = air_tau * (1.0 + 1e-6)
        self.start = start
        self._air = drive.lagged(air_tau)
        self._package = self._air.lagged(package_tau)
        self._air_tau = air_tau
        self._package_tau = package_tau
        self._air_transient = begin[0] - self._air.at(start, start)
        self._follow = self._air_transient * air_tau / (air_tau - package_tau)
        self._package_transient = begin[1] - self._package.at(start, start) - self._follow

    def air(self, t: float) -> float:
        return self._air.at(t, self.start) + self._air_transient * exp((self.start - t) / self._air_tau)

    def air_rate(self, t: float) -> float:
        fading = self._air_transient * exp((self.start - t) / self._air_tau)
        return self._air.rate(t) - fading / self._air_tau

    def package(self, t: float) -> float:
        gone = self.start - t
        return (
            self._package.at(t, self.start)
            + self._follow * exp(gone / self._air_tau)
            + self._package_transient * exp(gone / self._package_tau)
        )


@dataclass(frozen=True, slots=True)
class Ramp:
    """Setpoint as a function of time from `start` on: a ramp of `slope` until `end`, then the setpoint."""

    start: float
    begin_degC: float
    slope: float
    end: float
    setpoint_degC: float

    def at(self, t: float) -> float:
        """Setpoint in force at `t`."""
        return self.setpoint_degC if t >= self.end else self.begin_degC + self.slope * (t - self.start)


class Enclosure:
    """An enclosure under closed-loop control, with the package in it.

    Args:
        truth: its true parameters.
        package_tau_s: thermal time constant of the package.
        lab: its surroundings.
        start: virtual time of its first known state, which is steady.

    Attributes:
        told: called with every command.
    """

    def __init__(self, truth: EnclosureTruth, package_tau_s: float, lab: Lab, start: float) -> None:
        self._truth = truth
        self._package_tau = package_tau_s
        self._lab = lab
        self._rate = inf
        self.told: Told | None = None
        self._door_s: float | None = None  # rate at which the air approaches the laboratory's while the door is open
        self.assume_steady(truth.start_setpoint_degC, start, controlled=truth.start_controlled)

    def assume_steady(self, setpoint_degC: float, now: float, *, controlled: bool = True) -> None:
        """Reset the state: at `now` this setpoint has been in force long enough for all transients to have decayed."""
        self.controlled = controlled
        self._command = Ramp(now, setpoint_degC, 0.0, now, setpoint_degC)
        drive, tau = self._drive(setpoint_degC, 0.0, now)
        air = drive.lagged(tau)
        begin = (air.at(now, now), air.lagged(self._package_tau).at(now, now))
        self._stretches = [_Stretch(now, drive, tau, self._package_tau, begin)]

    @property
    def setpoint_degC(self) -> float:
        """The commanded setpoint, also during a ramp to it."""
        return self._command.setpoint_degC

    def active_setpoint_degC(self, t: float) -> float:
        """The setpoint in force at `t`; on the ramp during a ramp."""
        return self._command.at(t)

    def command(
        self, now: float, setpoint_degC: float, *, controlled: bool = True, ramp_degC_per_min: float = inf
    ) -> None:
        """Command a setpoint, with control on or off, from `now` on.

        Args:
            now: virtual time.
            setpoint_degC: the new setpoint.
            controlled: whether the control loop is closed; open, the air follows the laboratory.
            ramp_degC_per_min: maximum rate; None for the enclosure's own slew.
        """
        if self.told is not None:
            self.told("setpoint_degC", setpoint_degC)
            self.told("control", "on" if controlled else "off")
        begin = self._command.at(now) if self.controlled and self._door_s is None else self.air_degC(now)
        self._rate = ramp_degC_per_min
        slew = min(ramp_degC_per_min, self._truth.slew_degC_per_min) / 60.0
        away = setpoint_degC - begin
        slope = slew if away > 0 else -slew
        end = now + abs(away) / slew if controlled and self._door_s is None else now
        self.controlled = controlled
        self._command = Ramp(now, begin, slope, end, setpoint_degC)
        self._cut(now)
        if end > now:
            self._append(now, begin, slope)
        self._append(end, setpoint_degC, 0.0)

    def open_door(self, now: float, time_constant_s: float) -> None:
        """Open its door: control stops, and the air approaches the laboratory's at this rate."""
        if self.told is not None:
            self.told("door", "open")
        self._door_s = time_constant_s
        self._again(now)

    def close_door(self, now: float) -> None:
        """Close its door: the last command is in force again, from the present air temperature."""
        if self.told is not None:
            self.told("door", "closed")
        air = self.air_degC(now)
        self._door_s = None
        ramp = self._command
        self._command = Ramp(now, air, 0.0, now, air)  # the setpoint in force starts at the air temperature
        self.command(now, ramp.setpoint_degC, controlled=self.controlled, ramp_degC_per_min=self._rate)

    def _again(self, now: float) -> None:
        self.command(now, self.setpoint_degC, controlled=self.controlled, ramp_degC_per_min=self._rate)

    def _cut(self, now: float) -> None:
        """Discard intervals after `now`, and those too old for any query."""
        kept = [s for s in self._stretches if s.start <= now]
        old = max((i for i, s in enumerate(kept) if s.start < now - 3600.0), default=0)
        self._stretches = kept[old:]

    def _append(self, at: float, constant: float, slope: float) -> None:
        drive, tau = self._drive(constant, slope, at)
        last = self._stretches[-1]
        self._stretches.append(_Stretch(at, drive, tau, self._package_tau, (last.air(at), last.package(at))))

    def _drive(self, constant: float, slope: float, at: float) -> tuple[_Drive, float]:
        """The input of the air from `at` on, and its time constant."""
        lab, truth = self._lab, self._truth
        if not self.controlled or self._door_s is not None:
            free_s = truth.free_time_constant_s if self._door_s is None else self._door_s
            return _Drive(lab.mean + lab.slope * at, lab.slope, lab.amplitude, lab.phase), free_s
        leak = truth.leak
        drift = leak * lab.slope
        return _Drive(constant + drift * at, slope + drift, leak * lab.amplitude, lab.phase), truth.time_constant_s

    def _stretch(self, t: float) -> _Stretch:
        last = self._stretches[-1]
        if last.start <= t:  # nearly always
            return last
        for stretch in reversed(self._stretches):
            if stretch.start <= t:
                return stretch
        return self._stretches[0]

    def air_degC(self, t: float) -> float:
        """Temperature of the enclosure's air, as seen by the controller's sensor."""
        return self._stretch(t).air(t)

    def package_degC(self, t: float) -> float:
        """Temperature of the package and the sensors in it."""
        return self._stretch(t).package(t)

    def power_pct(self, t: float) -> float:
        """Control output from the heat balance, percent: full heating 100, full cooling -100, 0 when control is off."""
        if not self.controlled or self._door_s is not None:
            return 0.0
        stretch = self._stretch(t)
        excess = stretch.air(t) - self._lab.degC(t) + self._truth.free_time_constant_s * stretch.air_rate(t)
        return min(100.0, max(-100.0, 100.0 * excess / self._truth.authority_degC))
