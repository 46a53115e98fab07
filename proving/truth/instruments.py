"""Tables with what instruments do to a measurement, each written from the physical events.

Nothing here is shared with the effects that are to be found. Every effect is scaled to an rms of so many sd of the
noise beside the declared model; `rms` 0 is a clean table.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

Columns = dict[str, Any]
Rng = np.random.Generator
Make = Callable[[Rng], tuple[Columns, Any, Any]]
"""Recorded columns, (n, k) columns of the declared model, and (n,) the effect up to its size."""


@dataclass(frozen=True)
class Cause:
    """A cause that the declared model lacks.

    Attributes:
        make: the table.
        response: its name.
        formula: the declared model.
        named: beginning of the name by which it is rightly reported.
        told: roles of columns that a user would say.
    """

    make: Make
    formula: str
    named: str
    response: str = "y_V"
    told: Mapping[str, Any] = field(default_factory=dict)

    def table(self, seed: int, rms: float = 1.0) -> Columns:
        """The table, with noise of one sd."""
        rng = np.random.default_rng([41, seed])
        columns, model, effect = self.make(rng)
        scale = np.max(np.abs(model), axis=0)
        left = effect - model @ (np.linalg.lstsq(model / scale, effect, rcond=None)[0] / scale)
        size = rms / float(np.sqrt(np.mean(left**2)))
        noise = rng.standard_normal(len(effect))
        return {**columns, self.response: 40.0 * (model / scale) @ np.ones(model.shape[1]) + size * effect + noise}

    def options(self) -> dict[str, Any]:
        """What a user would say of the columns."""
        return {"response": self.response, "formula": self.formula, **self.told}


def _straight(x: Any) -> Any:
    return np.column_stack([np.ones_like(x), x])


def _self_heating(rng: Rng) -> tuple[Columns, Any, Any]:
    """The voltage of a platinum wire whose own power warms it."""
    bath = np.repeat(rng.permutation([0.0, 20.0, 40.0, 60.0, 80.0, 100.0]), 8)
    milliamperes = np.concatenate([rng.permutation([0.5, 0.5, 1.0, 1.0, 1.4, 1.4, 2.0, 2.0]) for _ in range(6)])
    amperes = milliamperes / 1000.0
    cold = 100.0 * (1.0 + 0.00385 * bath)
    warmer = 40.0 * amperes**2 * cold * 1000.0  # 40 K/W, times a thousand to be seen
    columns = {"bath_degC": bath, "current_A": amperes, "t_s": np.arange(48) * 90.0}
    return columns, np.column_stack([amperes, amperes * bath]), amperes * 0.385 * warmer


def _creep(rng: Rng) -> tuple[Columns, Any, Any]:
    """A spring that goes on giving way, minutes after each weight was put on or taken off."""
    loads = np.tile(np.concatenate([np.arange(0.0, 11.0), np.arange(9.0, -1.0, -1.0)]), 4)
    put, wait = 20.0, 60.0
    still, before, given = 0.0, 0.0, []
    for load in loads:
        for second in range(int(wait)):
            if second == put:
                still += load - before
                before = load
            still -= still / 200.0
        given.append(-still)
    columns = {"force_kN": loads, "t_s": wait * (1.0 + np.arange(len(loads))) + rng.uniform(0.0, 1.0, len(loads))}
    return columns, _straight(loads), np.array(given)


def _loading(rng: Rng) -> tuple[Columns, Any, Any]:
    """A source behind resistors, read by a meter of 10 megohms."""
    volts = rng.permutation(np.repeat(np.linspace(0.0, 10.0, 10), 6))
    ohms = rng.choice([1e3, 1e4, 1e5], len(volts))
    return {"volts_V": volts, "source_ohm": ohms}, _straight(volts), -volts * ohms / (ohms + 1e7)


def _over_decades(rng: Rng) -> Any:
    sizes = [0.005, 0.01, 0.05, 0.1, 0.5, 1.0, 5.0, 10.0, 50.0, 100.0, 500.0, 1000.0]
    return rng.permutation(np.tile([0.0, *sizes, *(-size for size in sizes)], 3))


def _divider_offset(rng: Rng) -> tuple[Columns, Any, Any]:
    """Ranges of 100 V and 1000 V of a meter come through an amplifier with an offset."""
    volts = _over_decades(rng)
    ranges = [next(top for top in (0.01, 0.1, 1.0, 10.0, 100.0, 1000.0) if abs(v) <= 1.2 * top) for v in volts]
    return {"input_V": volts}, _straight(volts), np.array([1.0 if top > 10.0 else 0.0 for top in ranges])


def _divider_gain(rng: Rng) -> tuple[Columns, Any, Any]:
    """The range of 1000 V has a gain of its own."""
    volts = np.where(np.abs(_over_decades(rng)) == 500.0, 300.0, _over_decades(rng))
    return {"input_V": volts}, _straight(volts), np.array([v if abs(v) > 120.0 else 0.0 for v in volts])


def _days(rng: Rng) -> tuple[Columns, Any, Any]:
    """Five mornings, each set up anew."""
    x, day = rng.permutation(np.linspace(0.0, 10.0, 60)), np.arange(60) // 12
    return {"x_V": x, "day": day.astype(float)}, _straight(x), rng.standard_normal(5)[day]


def _operators(rng: Rng) -> tuple[Columns, Any, Any]:
    """Three people read a scale, each from another side."""
    x = rng.permutation(np.linspace(0.0, 10.0, 60))
    who = rng.permutation(np.arange(60) % 3)
    names = np.array(["ada", "ben", "eve"])[who]
    return {"x_V": x, "operator": names}, _straight(x), np.array([-1.0, 0.2, 1.1])[who]


def _room(rng: Rng) -> tuple[Columns, Any, Any]:
    """The room warms up and cools down while points are taken in random order."""
    x = rng.permutation(np.linspace(0.0, 10.0, 80))
    hours = np.arange(80) / 10.0
    room = 21.0 + 1.5 * np.sin(hours * 1.1) + 0.3 * rng.standard_normal(80)
    return {"x_V": x, "room_degC": room}, _straight(x), 3.0 * (room - 21.0)


def _bent_reference(rng: Rng) -> tuple[Columns, Any, Any]:
    """A force machine is right; the standard that reads it bends by a cube, and the cell follows the force."""
    force = rng.permutation(np.tile(np.arange(0.0, 10.5, 0.5), 3))
    seen = force + 0.004 * (force - 5.0) ** 3 - 0.06 * (force - 5.0) + 0.004 * rng.standard_normal(len(force))
    return {"force_kN": seen, "force_set_kN": force}, _straight(seen), force - seen


def _next_channel(rng: Rng) -> tuple[Columns, Any, Any]:
    """A scanner leaves a part of the channel before it on the input."""
    x = rng.permutation(np.linspace(0.0, 10.0, 60))
    other = 5.0 + 3.0 * rng.standard_normal(60)
    return {"x_V": x, "cell_1_V": other}, _straight(x), other


CAUSES: Mapping[str, Cause] = {
    "self-heating": Cause(
        _self_heating, "0 + current_A + current_A:bath_degC", "self-heating:current_A", told={"time": "t_s"}
    ),
    "creep": Cause(_creep, "1 + force_kN", "creep:force_kN", told={"time": "t_s"}),
    "loading": Cause(_loading, "1 + volts_V", "loading:source_ohm,volts_V"),
    "range step": Cause(_divider_offset, "1 + input_V", "range-step:input_V"),
    "range gain": Cause(_divider_gain, "1 + input_V", "range-gain:input_V"),
    "day": Cause(_days, "1 + x_V", "group-offset:day", told={"group": ("day",)}),
    "operator": Cause(_operators, "1 + x_V", "group-offset:operator", told={"group": ("operator",)}),
    "room": Cause(_room, "1 + x_V", "temperature:room_degC"),
    "reference": Cause(_bent_reference, "1 + force_kN", "reference-nonlinearity:force_kN"),
    "cross-talk": Cause(_next_channel, "1 + x_V", "cross-talk:cell_1_V", response="cell_2_V"),
}
"""Each a cause of the catalogue of general runs that `MISSING` of proving/truth/table.py does not have."""
