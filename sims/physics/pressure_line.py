"""A pressure controller and its line, in closed form: slew, settling, overshoot, leak, vent, lost sources.

The state is the gas pressure at the transducers. Between two commands it is a chain of intervals; in each, a
first-order system follows a straight line. So pressures and their means over a window are closed-form functions of
time, and do not depend on the number of queries. Pressures are absolute, psi; rates are in psi/s.
"""

from __future__ import annotations

import itertools
from dataclasses import dataclass, field
from math import e, exp, inf, log, pi, sin, sqrt

from rig.sims.noise import event_at, normal, uniform
from rig.sims.physics.fields import Number, accepts, quantity
from rig.sims.physics.pressure_stretch import Stretch
from rig.sims.physics.told import Told

ATMOSPHERE_PSIA = 14.695949
"""Standard atmosphere."""

_HEAD_PER_M = 0.0280134 * 9.80665 / (8.314463 * 296.15)  # barometric formula, nitrogen at 23 degrees Celsius
_AT_AMBIENT_PSI = 0.01  # maximum distance from the atmosphere at the end of a vent
_REMEMBERED_S = 3600.0
_DAY_S = 86400.0
_Outage = tuple[float, float, float | None]  # from, until (virtual seconds), remaining pressure of the source (psia)
_PERIODS_S = (40.0, 21.4, 11.4, 6.11, 3.27, 1.75, 0.935, 0.5)  # of the control noise


@dataclass(frozen=True)
class LineTruth:
    """Parameters of a pressure controller and its line: `[pressure_line]`.

    Attributes:
        supply_psia: pressure of the supply.
        vacuum_psia: pressure of the vacuum pump.
        supply_lost_h: hours after the world's start at which the supply is lost; never if not given.
        supply_back_h: end of that loss, hours; never if not given.
        vacuum_lost_h: hours after the world's start at which the vacuum pump is lost; never if not given.
        vacuum_back_h: end of that loss, hours; never if not given.
        ambient_psia: pressure of the atmosphere, for vents.
        start_psia: pressure in the line at the start of the world, with control off.
        surroundings_psia: pressure around the line, to which it leaks: the atmosphere, or a chamber's vacuum.
        leak_time_constant_s: time constant of the leak of an uncontrolled line (volume over conductance).
        restriction_s: pressure drop between controller and transducers per psi/s of leak.
        control_time_constant_s: time constant of control near its setpoint, after the slew.
        valve_psi_per_s: rate of change with a valve fully open.
        overshoot_fraction: overshoot as a fraction of the step, if overshoot is permitted.
        control_noise_psi: standard deviation of the controlled pressure, with periods of 0.5 s to 40 s.
        height_m: height of the transducers above the controller's reference level.
        reference_gain_ppm: relative error of the controller's own sensor.
        reference_offset_psi: its error at zero.
        reference_drift_psi_per_day: drift of that error.
        reference_noise_psi: standard deviation of one reading of it.
    """

    supply_psia: float = quantity(45.0, 0.0, 10_000.0)
    vacuum_psia: float = quantity(0.002, 0.0, 14.0)
    supply_lost_h: float | None = field(default=None, metadata=accepts(Number(0.0)))
    supply_back_h: float | None = field(default=None, metadata=accepts(Number(0.0)))
    vacuum_lost_h: float | None = field(default=None, metadata=accepts(Number(0.0)))
    vacuum_back_h: float | None = field(default=None, metadata=accepts(Number(0.0)))
    ambient_psia: float = quantity(ATMOSPHERE_PSIA, 0.0, 20.0)
    start_psia: float = quantity(ATMOSPHERE_PSIA, 0.0, 10_000.0)
    surroundings_psia: float = quantity(ATMOSPHERE_PSIA, 0.0, 20.0)
    leak_time_constant_s: float = quantity(2e6, 10.0, 1e12)
    restriction_s: float = quantity(0.0, 0.0, 1e4)
    control_time_constant_s: float = quantity(1.5, 1e-2, 1e3)
    valve_psi_per_s: float = quantity(5.0, 1e-3, 1e4)
    overshoot_fraction: float = quantity(0.01, 0.0, 0.5)
    control_noise_psi: float = quantity(2e-6, 0.0, 10.0)
    height_m: float = quantity(0.0, -100.0, 100.0)
    reference_gain_ppm: float = quantity(0.0, -1e5, 1e5)
    reference_offset_psi: float = quantity(0.0, -10.0, 10.0)
    reference_drift_psi_per_day: float = quantity(0.0, -10.0, 10.0)
    reference_noise_psi: float = quantity(2e-6, 0.0, 10.0)


class PressureLine:
    """The line under a controller's commands. It starts uncontrolled.

    Args:
        truth: its parameters.
        name: the controller's name on the bench, the key of its noise.
        seed: the world's seed.
        start: virtual time of its first known state, seconds.

    Attributes:
        setpoint_psia: last commanded setpoint.
        controlling: whether the control loop is closed.
        told: called with every command.
    """

    def __init__(self, truth: LineTruth, name: str, seed: int, start: float = 0.0) -> None:
        self.truth = truth
        self.setpoint_psia = truth.start_psia
        self.controlling = False
        self._seed = seed
        self._channel = f"{name}/reference"
        # Difference of pressure between the controller's port and the transducers: weight of the gas column, flow of
        # the leak.
        self._column = exp(_HEAD_PER_M * truth.height_m)
        self._flow = truth.restriction_s / truth.leak_time_constant_s
        self._gain = 1.0 + truth.reference_gain_ppm * 1e-6
        self._drift = truth.reference_drift_psi_per_day / _DAY_S
        self._vent_over: float | None = None
        self.told: Told | None = None
        self._ripple_size = truth.control_noise_psi * sqrt(2.0 / len(_PERIODS_S))
        phases = (2.0 * pi * uniform(seed, f"{name}/control", k) for k in itertools.count())
        self._tones = tuple((2.0 * pi / period, phase) for period, phase in zip(_PERIODS_S, phases, strict=False))
        self._outages = {
            "supply": [_outage(truth.supply_lost_h, truth.supply_back_h)],
            "vacuum": [_outage(truth.vacuum_lost_h, truth.vacuum_back_h)],
        }
        self._slew, self._overshoot = truth.valve_psi_per_s, False
        self._controlled_from: list[tuple[float, bool]] = [(start, False)]
        self._stretches = [self._leaking(start, truth.start_psia)]

    # Commands

    def command(self, now: float, setpoint_psia: float, slew_psi_per_s: float, *, overshoot: bool = False) -> None:
        """Control to a setpoint of the controller's own reading.

        Args:
            now: virtual time.
            setpoint_psia: the setpoint.
            slew_psi_per_s: maximum rate; `inf` for the valves' own.
            overshoot: whether the pressure may overshoot.
        """
        self._begin(now, controlling=True)
        self.setpoint_psia = setpoint_psia
        self._slew, self._overshoot = min(slew_psi_per_s, self.truth.valve_psi_per_s), overshoot
        self._plan_from(now)
        if self.told is not None:
            self.told("vent", "off")
            self.told("slew_psi_per_s", self._slew)
            self.told("setpoint_psia", setpoint_psia)
            self.told("control", "on")

    def control_off(self, now: float) -> None:
        """Close all valves; only the leak acts on the line. Also ends a vent."""
        if self.told is not None:
            self.told("control", "off")
            self.told("vent", "off")
        here = self.pressure_psia(now)
        self._begin(now, controlling=False)
        self._stretches.append(self._leaking(now, here))

    def vent(self, now: float, rate_psi_per_s: float) -> None:
        """Vent the line to the atmosphere at this maximum rate; the vent stays open until the next command."""
        truth, here = self.truth, self.pressure_psia(now)
        self._begin(now, controlling=False)
        away = truth.ambient_psia - here
        rate = min(rate_psi_per_s, truth.valve_psi_per_s)
        ends = now + abs(away) / rate
        tau = truth.control_time_constant_s
        self._stretches.append(Stretch(now, here, rate if away > 0 else -rate, tau, here))
        left = self._stretches[-1].at(ends) - truth.ambient_psia
        self._stretches.append(Stretch(ends, truth.ambient_psia, 0.0, tau, truth.ambient_psia + left))
        self._vent_over = ends + tau * log(max(1.0, abs(left) / _AT_AMBIENT_PSI))
        if self.told is not None:
            self.told("control", "off")
            self.told("vent", "open")
            self.told("vent", "complete", self._vent_over - now)

    def lose(self, now: float, source: str, until: float, to_psia: float | None = None) -> None:
        """A source fails.

        Args:
            now: virtual time.
            source: "supply" or "vacuum".
            until: end of the failure.
            to_psia: its pressure meanwhile; the atmosphere if None.
        """
        self._outages[source].append((now, until, to_psia))
        if self.controlling:
            self._plan_from(now)

    # State

    def pressure_psia(self, t: float) -> float:
        """The true pressure at the transducers, psia."""
        return self._smooth(t) + (self._ripple(t) if self._under_control(t) else 0.0)

    def mean_psia(self, t0: float, t1: float) -> float:
        """The mean of the true pressure over a window of positive length, psia."""
        stretch = self._stretch(t1)
        if stretch.start <= t0:  # the most frequent case
            ripple = self._ripple_integral(t0, t1) if self._under_control(t0) else 0.0
            return (stretch.integral(t0, t1) + ripple) / (t1 - t0)
        starts = [s.start for s in self._stretches]
        edges = [t0, *(s for s in starts if t0 < s < t1), t1]
        pieces = list(itertools.pairwise(edges))
        total = sum(self._stretch(a).integral(a, b) for a, b in pieces)
        total += sum(self._ripple_integral(a, b) for a, b in pieces if self._under_control(a))
        return total / (t1 - t0)

    def reading_psia(self, t: float) -> float:
        """Reading of the controller's own sensor, psia; the same for all queries at one time."""
        noise = self.truth.reference_noise_psi * normal(self._seed, self._channel, event_at(t))
        ripple = self._ripple(t) if self._under_control(t) else 0.0
        return self._read(self._smooth(t), t) + ripple + noise

    def supply_psia(self, t: float) -> float:
        """Pressure of the positive source."""
        return self._source_psia("supply", t)

    def vacuum_psia(self, t: float) -> float:
        """Pressure of the negative source."""
        return self._source_psia("vacuum", t)

    def ambient_psia(self, t: float) -> float:
        """Pressure of the atmosphere."""
        return self.truth.ambient_psia

    def venting(self, t: float) -> bool:
        """Whether a vent is under way."""
        return self._vent_over is not None and t < self._vent_over

    def vented(self, t: float) -> bool:
        """Whether a vent has been completed and nothing has been commanded since."""
        return self._vent_over is not None and t >= self._vent_over

    def effort_pct(self, t: float) -> float:
        """Opening of the valves, percent: positive lets gas in, negative out, 100 is fully open; 0 uncontrolled."""
        if not self._under_control(t):
            return 0.0
        stretch = self._stretch(t)
        here = stretch.at(t)
        if stretch.saturated:
            return 100.0 if self.setpoint_psia > self._read(here, t) else -100.0
        flow = stretch.rate(t) - (self.truth.surroundings_psia - here) / self.truth.leak_time_constant_s
        return 100.0 * max(-1.0, min(1.0, flow / self.truth.valve_psi_per_s))

    def settled_since(self, t: float, band_psi: float, back_to: float = -inf) -> float | None:
        """Time since which the controller's reading, without noise, has been within a band about the setpoint.

        Args:
            t: virtual time, not before the last command.
            band_psi: half width of the band.
            back_to: stands for all earlier times, which need not be found.

        Returns:
            Virtual seconds, not before the last command; None if it is outside at `t` or uncontrolled.
        """
        if not self._under_control(t) or abs(self._error(t)) > band_psi:
            return None
        commanded = self._controlled_from[-1][0]
        end = t
        for stretch in reversed([s for s in self._stretches if commanded <= s.start <= t]):
            for outside in self._farthest(stretch, end):
                if abs(self._error(outside)) > band_psi:
                    in_band = outside < back_to and abs(self._error(back_to)) <= band_psi
                    return back_to if in_band else self._entered(outside, end, band_psi)
            end = stretch.start
        return commanded

    # Internals

    def _begin(self, now: float, *, controlling: bool) -> None:
        """Discard intervals after `now`, and those too old for any query."""
        kept = [s for s in self._stretches if s.start <= now]
        old = max((i for i, s in enumerate(kept) if s.start < now - _REMEMBERED_S), default=0)
        self._stretches = kept[old:]
        since = [c for c in self._controlled_from if c[0] <= now]
        old = max((i for i, c in enumerate(since) if c[0] < now - _REMEMBERED_S), default=0)
        self._controlled_from = [*since[old:], (now, controlling)]
        self.controlling = controlling
        self._vent_over = None

    def _plan_from(self, now: float) -> None:
        """Plan the control from `now` on, with a new plan at each loss or return of a source."""
        edges = (at for outages in self._outages.values() for begin, end, _ in outages for at in (begin, end))
        for at in (now, *sorted(at for at in edges if now < at < inf)):
            self._plan(at, self._slew, overshoot=self._overshoot)

    def _plan(self, at: float, slew: float, *, overshoot: bool) -> None:
        """Append the control from `at` on, within the limits of the sources at that time."""
        self._stretches = [s for s in self._stretches if s.start <= at]
        truth, here = self.truth, self._smooth(at)
        supply = self._source_psia("supply", at)
        up, down = self._available("supply", at, here), self._available("vacuum", at, here)
        reachable = min(self.setpoint_psia, supply if up else inf)
        reachable = max(reachable, truth.vacuum_psia if down else -inf)
        goal = self._line_for(reachable, at)
        surroundings = truth.surroundings_psia
        away = goal - here
        arrival = at
        if away and (up if away > 0 else down):
            arrival = at + abs(away) / slew
            slope = (slew if away > 0 else -slew) + self._goal_slope
            self._stretches.append(Stretch(at, here, slope, truth.control_time_constant_s, here))
        elif away:
            self._stretches.append(self._leaking(at, here, saturated=True))
            ratio = (goal - surroundings) / (here - surroundings) if here != surroundings else inf
            if not 0.0 < ratio < 1.0:
                return  # the leak does not lead to the setpoint
            arrival = at - truth.leak_time_constant_s * log(ratio)
        begin, tau = self._smooth(arrival), truth.control_time_constant_s
        settled = self._line_for(reachable, arrival)
        self._stretches.append(
            Stretch(
                arrival,
                settled + self._goal_slope * tau,  # control follows the drift of its reference
                self._goal_slope,
                tau,
                begin,
                truth.overshoot_fraction * away if overshoot else 0.0,
                saturated=reachable != self.setpoint_psia,
            )
        )
        leak = (surroundings - goal) / truth.leak_time_constant_s
        if not (down if leak > 0 else up) and leak:
            # No source acts against the leak: the leak dominates once the approach is slower than it.
            alone = arrival + tau * log(max(1.0, (begin - settled) / tau / -leak))
            self._stretches.append(self._leaking(alone, self._smooth(alone), saturated=True))

    def _leaking(self, at: float, here: float, *, saturated: bool = False) -> Stretch:
        truth = self.truth
        return Stretch(at, truth.surroundings_psia, 0.0, truth.leak_time_constant_s, here, saturated=saturated)

    def _available(self, source: str, t: float, here: float) -> bool:
        """Whether a source moves gas at `t`; a failed one still does while it is above the line."""
        return not any(lost <= t < back and (to is None or to <= here) for lost, back, to in self._outages[source])

    def _source_psia(self, source: str, t: float) -> float:
        """Pressure at a source's port."""
        for lost, back, to_psia in reversed(self._outages[source]):
            if lost <= t < back:
                return self.truth.ambient_psia if to_psia is None else to_psia
        return self.truth.supply_psia if source == "supply" else self.truth.vacuum_psia

    def _read(self, line: float, t: float) -> float:
        """The controller's reading, without noise, at a line pressure."""
        flow = self._flow * (self.truth.surroundings_psia - line) if self._under_control(t) else 0.0
        return self._gain * (self._column * line - flow) + self.truth.reference_offset_psi + self._drift * t

    def _line_for(self, reading: float, t: float) -> float:
        """The line pressure at which the controller reads this while controlling."""
        port = (reading - self.truth.reference_offset_psi - self._drift * t) / self._gain
        return (port + self._flow * self.truth.surroundings_psia) / (self._column + self._flow)

    @property
    def _goal_slope(self) -> float:
        """Rate of the line pressure at a constant reading."""
        return -self._drift / self._gain / (self._column + self._flow)

    def _stretch(self, t: float) -> Stretch:
        for stretch in reversed(self._stretches):
            if stretch.start <= t:
                return stretch
        return self._stretches[0]

    def _smooth(self, t: float) -> float:
        return self._stretch(t).at(t)

    def _under_control(self, t: float) -> bool:
        since, on = self._controlled_from[-1]
        if since <= t:  # the most frequent case
            return on
        return next((on for since, on in reversed(self._controlled_from) if since <= t), False)

    def _ripple(self, t: float) -> float:
        return self._ripple_size * sum([sin(omega * t + phase) for omega, phase in self._tones])

    def _ripple_integral(self, t0: float, t1: float) -> float:
        half, middle = (t1 - t0) / 2.0, (t0 + t1) / 2.0
        waves = [2.0 / omega * sin(omega * half) * sin(omega * middle + phase) for omega, phase in self._tones]
        return self._ripple_size * sum(waves)

    def _error(self, t: float) -> float:
        return self._read(self._smooth(t), t) - self.setpoint_psia

    def _farthest(self, stretch: Stretch, end: float) -> list[float]:
        """Times within an interval at which the reading may be farthest from the setpoint, latest first."""
        if not stretch.bump:
            return [stretch.start]
        top = stretch.start + stretch.tau * (1.0 - stretch.fading / (stretch.bump * e))
        return [top, stretch.start] if stretch.start < top < end else [stretch.start]

    def _entered(self, outside: float, inside: float, band_psi: float) -> float:
        """Time at which the reading entered the band, to a microsecond."""
        while inside - outside > 1e-6:
            middle = (outside + inside) / 2.0
            if abs(self._error(middle)) > band_psi:
                outside = middle
            else:
                inside = middle
        return inside


def _outage(lost_h: float | None, back_h: float | None) -> _Outage:
    """The outage described by a world file's keys."""
    return (inf if lost_h is None else lost_h * 3600.0), (inf if back_h is None else back_h * 3600.0), None
