"""Any laboratory: factors that sources, a head and people set, and sensors whose output is a formula of them.

Variables of formulas are true values of the bench's factors, such as `force_kN`; `force_side`, the direction of its
last change (1, -1 or 0); `force_for_s`, the time since then; the lags of the world file; `elapsed_h`, the world's
time; `lab_degC`; and `meter_swapped`, the number of such changes by a person (`rig.sims.physics.by_hand`). Pure
functions of virtual time between commands.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace
from functools import partial
from itertools import pairwise
from math import sqrt
from typing import Any

from rig.sims.noise import event_at, normal
from rig.sims.physics.by_hand import CHANGES
from rig.sims.physics.chamber import Chamber
from rig.sims.physics.expression import Formula
from rig.sims.physics.fields import WorldError, known_keys
from rig.sims.physics.head import Axis
from rig.sims.physics.laboratory_truth import AnySensorTruth, SourceTruth, StandardTruth
from rig.sims.physics.steps import Steps
from rig.sims.physics.thermal import Lab
from rig.sims.physics.told import Told
from rig.sims.physics.truth import Truth

_POWERS = {"p": -12, "n": -9, "u": -6, "m": -3, "k": 3, "M": 6, "G": 9}


_FULL, _USUAL = 0.01, 100.0
"""Largest output of a sensor without a formula, in its unit, and sum of factors at which it is three quarters of it: no
meter is beyond its range.
"""
_STEPS, _NEAR = 60, 1e-12
_NEW_STAY_DEGC = 0.5
"""Change of a bath's temperature from which on it is another stay."""


def _solved(formula: Formula, value: float) -> float:
    """The reading at which a formula of it has a value, by secants. Raises `WorldError` if none is found."""
    a, b = 0.5, 1.0
    at_a, at_b = (formula.value({"reading": x}) - value for x in (a, b))
    for _ in range(_STEPS):
        if abs(at_b) <= _NEAR * max(1.0, abs(value)) or at_a == at_b:
            break
        a, at_a, b = b, at_b, b - at_b * (b - a) / (at_b - at_a)
        at_b = formula.value({"reading": b}) - value
    if abs(at_b) > 1e-6 * max(1.0, abs(value)):
        raise WorldError(f"no reading gives {value:g} by {formula.text!r:.60}: say references.FACTOR.formula")
    return b


def _by_table(standard: Mapping[str, Any], of: str) -> str:
    """Formula of a standard that the world does not describe: its table of approach, or the number of the factor."""
    pairs = sorted(map(tuple, standard.get("approach") or ()))
    if len(pairs) < 2:
        return of
    slopes = [(d - b) / (c - a) for (a, b), (c, d) in pairwise(pairs)]
    knots = zip(pairwise(slopes), pairs[1:-1], strict=True)
    bends = (f"{b - a:+.17g}*max({of} - {x:.17g}, 0)" for (a, b), (x, _) in knots)
    return f"{pairs[0][1]:.17g} + {slopes[0]:.17g}*({of} - {pairs[0][0]:.17g}) " + " ".join(bends)


_QUICK_S, _BATH_S = 0.5, 480.0
"""Time constants of a source and of a bath if nothing is said of them, seconds."""


class Source:
    """One quantity that is set from time to time, and approaches its setting.

    Args:
        truth: of the factor that it sets.
        start: virtual time of its first state: off, at rest.
        where: name of the factor, for messages.
        time_constant_s: of its approach, if its truth has none.
        rest: its value before it is set and with the output off, if its truth has none.

    Attributes:
        on: whether its output is on.
        setpoint: as commanded last.
        told: called with every command.
        settings: history of its true settings.
    """

    def __init__(
        self, truth: SourceTruth, start: float, where: str, *, time_constant_s: float = 0.0, rest: float = 0.0
    ) -> None:
        self.on, self.setpoint = False, 0.0
        self.told: Told | None = None
        self._tau = time_constant_s if truth.time_constant_s is None else truth.time_constant_s
        self._rest = rest if truth.rest is None else truth.rest
        self._true = Formula.parse(truth.formula, f"sources.{where}.formula", {"set"}) if truth.formula else None
        self.settings = Steps(start, self._rest)

    def set(self, now: float, value: float) -> None:
        """Command a value, with the output on."""
        self.on, self.setpoint = True, value
        self.settings.set(now, value if self._true is None else self._true.value({"set": value}))
        if self.told is not None:
            self.told("setpoint", value)

    def off(self, now: float) -> None:
        """Switch the output off: it goes to its rest."""
        self.on = False
        self.settings.set(now, self._rest)
        if self.told is not None:
            self.told("control", "off")

    def value(self, t: float) -> float:
        """The true value."""
        return self.settings.value(t) + (self.settings.behind(t, self._tau) if self._tau else 0.0)

    def reads(self, t: float) -> float:
        """Its own readback, which does not know its error: the approach to the setpoint."""
        true, set_to = self.settings.value(t), self.setpoint if self.on else self._rest
        return self.value(t) - true + set_to

    def settled(self, t: float, within: float) -> bool:
        """Whether it is within this of its setting."""
        return abs(self.value(t) - self.settings.value(t)) <= within


class Laboratory:
    """Factors and sensors of a bench of no particular kind.

    Args:
        truth: the world file.
        bench: the bench file as plain values.
        lab: its surroundings.
        start: virtual time of its first known state.
        angles: axes of the bench's head, by the factors that they set.

    Attributes:
        sensors: by name on the bench; empty on benches of other kinds.
    """

    def __init__(
        self, truth: Truth, bench: Mapping[str, Any], lab: Lab, start: float, angles: Mapping[str, Axis]
    ) -> None:
        self._truth, self._lab, self._start = truth, lab, start
        self._angles = angles
        self._factors = dict.fromkeys(angles, "") | {n: str(i) for n, i in bench.get("factors", {}).items()}
        self._options = bench.get("instruments", {})
        self._sources: dict[str, Source] = {}
        self._chambers: dict[str, Chamber] = {}
        self._others: dict[str, Callable[[float], float]] = {}
        self._by_hand: dict[str, Source] = {}
        self._changes = dict.fromkeys(CHANGES.values(), 0)
        self.sensors = {n: s for n, s in truth.sensors.items() if isinstance(s, AnySensorTruth)}
        tables = bench.get("sensors", {})
        self._units = {name: str(tables[name].get("unit", "V")) for name in self.sensors}
        self._formulas: dict[str, tuple[Formula, ...]] = {}
        self._standards: dict[str, Formula] = {}
        self._errors: dict[str, Formula] = {}
        self._undone: dict[str, Formula] = {}
        self._quantities: dict[str, Formula] = {}
        self._set_by: dict[str, str] = {}
        if self.sensors:
            self._read_formulas(bench)

    def _read_formulas(self, bench: Mapping[str, Any]) -> None:
        known = [*self._factors, *self._truth.lags, *self._truth.draws, *CHANGES.values(), "elapsed_h", "lab_degC"]
        stems = [_stem(factor) for factor in self._factors]
        known += [f"{stem}{what}" for stem in stems for what in ("_side", "_for_s")]
        standards = bench.get("references", {})
        self._set_by |= {name: str(of) for name, table in standards.items() if (of := table.get("of"))}
        for name, of in self._set_by.items():
            text = self._truth.references.get(name, StandardTruth()).formula or _by_table(standards[name], of)
            self._quantities[name] = Formula.parse(text, f"references.{name}.formula", known)
        known += self._quantities
        for name, sensor in self.sensors.items():
            formula = sensor.formula or f"{_FULL:g}*tanh(({' + '.join(self._factors) or '0'})/{_USUAL:g})"
            parts = {"formula": formula, "hidden": sensor.hidden}
            self._formulas[name] = tuple(
                Formula.parse(text, f"sensors.{name}.{key}", known) for key, text in parts.items() if text
            )
        for where, given in (("sources", self._truth.sources), ("references", self._truth.references)):
            named = [*self._factors, *self._quantities] if where == "references" else list(self._factors)
            known_keys(given, named, where, "factors of this bench")
        for key, tables in (("lags", self._truth.lags), ("draws", self._truth.draws)):
            for name, table in tables.items():
                if table.of not in self._factors and not (key == "lags" and table.of in self._set_by):
                    known = [*self._factors, *(self._set_by if key == "lags" else ())]
                    raise WorldError(f"{key}.{name}.of = {table.of!r} is none of this bench: {', '.join(known)}")
        for factor, table in standards.items():
            text, of_bench = self._truth.references.get(factor, StandardTruth()).formula, table.get("formula")
            if factor in self._quantities:
                text = ""
            where = f"references.{factor}.formula"
            if not text and of_bench:
                self._undone[factor] = Formula.parse(str(of_bench), where, {"reading"})
            self._standards[factor] = Formula.parse(text or factor, where, known)
            if error := self._truth.references.get(factor, StandardTruth()).error:
                self._errors[factor] = Formula.parse(error, f"references.{factor}.error", known)

    def source(self, instrument: str) -> Source:
        """The quantity behind a source of the bench."""
        if instrument not in self._sources:
            factor = next((f for f, name in self._factors.items() if name == instrument), instrument)
            truth = self._truth.sources.get(factor, SourceTruth())
            bath = factor.endswith("_degC")
            own = self._options.get(instrument, {})
            said, ends = own.get("time_constant_s"), own.get("rest")
            tau = said if isinstance(said, int | float) else _BATH_S if bath else _QUICK_S
            rest = (ends[0] + ends[1]) / 2.0 if ends else self._truth.lab.mean_degC if bath else 0.0
            self._sources[instrument] = Source(truth, self._start, factor, time_constant_s=tau, rest=rest)
        return self._sources[instrument]

    def chamber(self, instrument: str) -> Chamber | None:
        """The chamber of a temperature controller that sets a factor; None on benches of other kinds."""
        if not self.sensors or instrument not in self._factors.values():
            return None
        if instrument not in self._chambers:
            self._chambers[instrument] = Chamber(self._truth.sensor_chamber, self._lab, self._start)
        return self._chambers[instrument]

    def set_by(self, instrument: str, value: Callable[[float], float]) -> None:
        """Note the true value of what another instrument sets: a pressure line."""
        self._others[instrument] = value

    def by_hand(self, factor: str, value: float, now: float) -> None:
        """A person sets a factor."""
        self._hand(factor).set(now, value)

    def changed(self, change: str) -> None:
        """A person changed a part: formulas know how often."""
        if change in CHANGES:
            self._changes[CHANGES[change]] += 1

    def _hand(self, factor: str) -> Source:
        if factor not in self._by_hand:
            truth = self._truth.sources.get(factor, SourceTruth())
            self._by_hand[factor] = Source(replace(truth, time_constant_s=0.0), self._start, factor)
        return self._by_hand[factor]

    def sets(self, factor: str) -> bool:
        """Whether this is a factor of such a bench, whose true value is known here."""
        return bool(self.sensors) and factor in self._factors

    def true(self, factor: str, t: float) -> float:
        """The true value of a factor."""
        instrument = self._factors[factor]
        if factor in self._angles:
            return self._angles[factor].true_deg(t)
        if instrument in self._sources:
            return self._sources[instrument].value(t)
        if instrument in self._chambers:
            return self._chambers[instrument].package_degC(t)
        if instrument in self._others:
            return self._others[instrument](t)
        return self._hand(factor).value(t)

    def _steps(self, factor: str) -> Steps:
        """History of a factor's settings; without changes if it has none."""
        instrument = self._factors[factor]
        if factor in self._angles:
            return self._angles[factor].turns
        if instrument in self._sources:
            return self._sources[instrument].settings
        if instrument in self._chambers:
            return self._chambers[instrument].temperatures
        return self._hand(factor).settings

    def factors(self, t: float) -> dict[str, float]:
        """True values of all factors."""
        return {factor: self.true(factor, t) for factor in self._factors}

    def sides(self, t: float) -> dict[str, int]:
        """Direction of the last change of every factor."""
        return {factor: self._steps(factor).direction(t) for factor in self._factors}

    def stay(self, t: float) -> int:
        """A number for the stay at the present temperatures of chambers and baths, and settings with a draw."""
        baths = (
            self._sources[instrument].settings.changed(t, _NEW_STAY_DEGC)
            for factor, instrument in self._factors.items()
            if factor.endswith("_degC") and instrument in self._sources
        )
        draws = (self._steps(draw.of).since(t) for draw in self._truth.draws.values())
        chambers = (c.temperatures.since(t) for c in self._chambers.values())
        return event_at(max((*chambers, *baths, *draws), default=self._start))

    def _variables(self, t: float) -> dict[str, float]:
        found = self.factors(t)
        for factor in self._factors:
            stem, steps = _stem(factor), self._steps(factor)
            found[f"{stem}_side"] = float(steps.direction(t))
            found[f"{stem}_for_s"] = max(0.0, t - steps.since(t))
        for name, lag in self._truth.lags.items():
            of = self._set_by.get(lag.of, "")
            function = partial(self._quantity, lag.of, of, dict(found)) if of else None
            found[name] = self._steps(of or lag.of).behind(t, lag.time_constant_s, function)
        for name, draw in self._truth.draws.items():
            found[name] = draw.sd * normal(self._truth.seed, f"draw {name}", event_at(self._steps(draw.of).since(t)))
        found |= self._changes
        found |= {"elapsed_h": t / 3600.0, "lab_degC": self._lab.degC(t)}
        return found | {name: formula.value(found) for name, formula in self._quantities.items()}

    def _quantity(self, name: str, of: str, given: Mapping[str, float], value: float) -> float:
        """A quantity at a value of the factor that sets it, beside other true values."""
        known = {**dict.fromkeys((*CHANGES.values(), *self._truth.lags, *self._truth.draws), 0.0), **given, of: value}
        return self._quantities[name].value({"elapsed_h": 0.0, "lab_degC": 0.0, **known})

    def clean(self, sensor: str, t0: float, t1: float) -> float:
        """Output of a sensor in the middle of a window, without noise, in its unit on the bench."""
        given = self._variables((t0 + t1) / 2.0)
        return sum(formula.value(given) for formula in self._formulas[sensor])

    def noise(self, sensor: str, t0: float, t1: float) -> float:
        """Noise of its mean over a window; a function of the window."""
        return self.sensors[sensor].noise / sqrt(t1 - t0) * normal(self._truth.seed, f"sensor {sensor}", event_at(t0))

    def volts(self, sensor: str, value: float) -> float:
        """An output in volts, for a meter that reads volts. An output in another unit is taken for volts."""
        unit = self._units[sensor]
        return value * 10.0 ** _POWERS[unit[0]] if unit[1:] == "V" and unit[0] in _POWERS else value

    def standard(self, factor: str, t0: float, t1: float, *, noisy: bool) -> float:
        """Reading of the channel of a reference standard over a window."""
        given = self._variables((t0 + t1) / 2.0)
        value = self._standards[factor].value(given)
        if factor in self._errors:
            value += self._errors[factor].value(given)
        if factor in self._undone:
            value = _solved(self._undone[factor], value)
        sd = self._truth.references.get(factor, StandardTruth()).noise
        if not noisy or not sd:
            return value
        return value + sd / sqrt(t1 - t0) * normal(self._truth.seed, f"reference {factor}", event_at(t0))


def _stem(name: str) -> str:
    """A factor's name without its unit, which may have "per"."""
    words = name.split("_")
    return "_".join(words[: -3 if len(words) > 3 and words[-2] == "per" else -1])
