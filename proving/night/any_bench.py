"""Benches drawn at random from every instrument that a file declares, supplied or in `instruments`, and some in Python.

One or two instruments set something, one to three others read something that depends on it. What a night does with them
is that of any example laboratory of the kind general (`any_laboratory.py`).
"""

from __future__ import annotations

import random
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

from proving.night.any_laboratory import AnyLaboratory
from rig.bench.contract_files import with_hook
from rig.bench.plugins import declared
from rig.contracts.declared.instrument import parse
from rig.files.toml_text import toml_text

LAB = "any-bench"
_HERE = Path(__file__).parent / "instruments"
_SET = {"degC": (5.0, 60.0), "V": (-8.0, 8.0), "psia": (1.0, 5.0), "deg": (-40.0, 40.0)}
"""Where settings lie, by unit, within what the instrument takes."""
_READ = {"V": (-8.0, 8.0), "degC": (5.0, 60.0), "pct": (5.0, 95.0), "g": (5.0, 150.0), "ohm": (20.0, 300.0)}
"""Where readings lie, by unit."""
_OTHERS = (10.0, 90.0)
_NOISY = 3.0
"""Scatter of readings from which on they are noisy, in that of one: a spike beyond six is not to hide in it."""
_ADDRESSES: Mapping[str, tuple[str, ...]] = {
    "serial": ("/dev/rig/{name}", "socket://192.0.2.{n}:5025", "visa://GPIB0::{n}::INSTR"),
    "stream": ("/dev/rig/{name}", "socket://192.0.2.{n}:5025"),
    "modbus": (
        "modbus-tcp://192.0.2.{n}/1",
        "modbus-rtu:///dev/rig/line/{n}",
        "modbus-rtu://socket://192.0.2.9:4001/{n}",
    ),
    "can": ("can:socketcan/can0",),
}


@dataclass(frozen=True)
class _Kind:
    """An instrument that may be drawn.

    Attributes:
        driver: as in the bench file.
        wire: which addresses it takes.
        options: in the bench file.
        sets: unit, lowest and highest setting, and the nearest band; None if it sets nothing.
        reads: unit of each channel.
        step: of its readings, 0 if they are finer than their noise.
        span: how much of `_READ` it takes.
        reading_s: time of a reading, as far as its scatter is concerned.
        tells: whether it tells when it has arrived, or reads where it is.
    """

    driver: str
    wire: str
    options: Mapping[str, Any]
    sets: tuple[str, float, float, float] | None
    reads: Mapping[str, str]
    step: float = 0.0
    span: float = 1.0
    reading_s: float = 0.1
    tells: bool = True


_HEAD = "newport-esp301"
_PYTHON = (
    _Kind("can-daq", "can", {}, None, {"spare_voltage": "V"}, span=0.5),
    _Kind("druck-pace", "serial", {"high_psia": 6.0}, ("psia", 1.0, 5.0, 0.002), {}),
    _Kind(_HEAD, "serial", {}, ("deg", -40.0, 40.0, 0.002), {}),
)


@cache
def texts() -> Mapping[str, str]:
    """Files of instruments made up for nights, by the driver's name in a bench file."""
    return {
        f"./{path.name}": with_hook(path.read_text(encoding="utf-8"), path) for path in sorted(_HERE.glob("*.toml"))
    }


@cache
def kinds() -> tuple[_Kind, ...]:
    """All instruments that may be drawn."""
    return (*_PYTHON, *(_of_file(driver, text) for driver, text in {**declared(), **texts()}.items()))


def _of_file(driver: str, text: str) -> _Kind:
    table = parse(text)
    scanned: dict[str, Any] = {"channels": table.scan.first(2)} if table.scan is not None else {}
    table = table.chosen(scanned)
    reader, source, options, sets = table.reader, table.source, scanned, None
    if source is not None and source.unit is not None:
        assert source.low is not None
        assert source.high is not None
        low, high = _SET.get(source.unit, (source.low, source.high))
        margin = 0.05 * (source.high - source.low)
        near = max(3.0 * (source.tolerance or 0.0), 5.0 * source.nearness)
        sets = source.unit, max(low, source.low + margin), min(high, source.high - margin), near
        options = {"dwell_s": min(source.dwell_s, 10.0), "time_constant_s": min(source.time_constant_s or 0.5, 5.0)}
    channels = reader.channels if reader is not None else {}
    unit = (reader.unit if reader is not None else None) or "V"
    reads = {name: one.unit or unit for name, one in channels.items()} or ({"input": unit} if reader else {})
    step = min(table.step, 0.1) if reader is not None else 0.0  # where a register says its decimals there is one
    tells = source is None or source.tolerance is not None or source.settled is not None
    wire = table.wire.protocol.replace("text", "serial")
    reading_s = (reader.reading_s if reader is not None else 0.0) or 0.1
    return _Kind(driver, wire, options, sets, reads, step, reading_s=reading_s, tells=tells)


def drawn(rng: random.Random) -> tuple[AnyLaboratory, dict[str, str]]:
    """A laboratory on a bench of its own, and the documents of that bench."""
    setters = rng.sample([kind for kind in kinds() if kind.sets], rng.choice((1, 1, 2)))
    if any(kind.driver == _HEAD for kind in setters):  # a temperature beside it would be of a whole plot, too
        setters = [kind for kind in setters if kind.sets and kind.sets[0] != "degC"]
    readers = rng.sample([kind for kind in kinds() if kind.reads], rng.choice((1, 2, 3)))
    instruments: dict[str, dict[str, Any]] = {}
    factors: dict[str, str] = {}
    sensors: dict[str, dict[str, str]] = {}
    limits: dict[str, list[float]] = {}
    example: dict[str, Any] = {"factors": {}, "measure": {"max_sd": {}}}
    truth: dict[str, Any] = {"sensors": {}, "sources": {}}
    numbers = iter(range(1, 9))
    for kind in setters:
        assert kind.sets is not None
        unit, low, high, near = kind.sets
        name = f"setter_{next(numbers)}"
        factor = "pitch_deg" if kind.driver == _HEAD else f"{'ab'[len(factors)]}_{unit}"
        instruments[name] = _instrument(kind, name, rng)
        factors[factor] = name
        step = (high - low) / 5.0
        levels = [float(f"{low + n * step:.3g}") for n in range(6)]
        example["factors"][factor] = {"levels": levels, "band": max(near, 1e-3 * (high - low))}
        rest = {"psia": 16.0, "pct": 0.0}.get(unit, low)  # a vented line is at 14.7 psia; a flow is safe at none
        limits[factor] = [min(low - step / 4, rest), max(high + step / 4, rest)]
        if kind.driver == _HEAD:
            example["factors"][factor] = {"levels": levels, "hard": True, "band": 0.002, "overtravel": 1}
            truth["draws"] = {"seat": {"of": factor, "sd": 10.0}}
        elif unit != "psia":
            truth["sources"][factor] = {"time_constant_s": rng.choice((0.5, 1.0, 2.0)) if kind.tells else 0.1}
    for kind in readers:
        name = f"reader_{next(numbers)}"
        channels = rng.sample(sorted(kind.reads), rng.choice((1, len(kind.reads))))
        instruments[name] = _instrument(kind, name, rng)
        if len(kind.reads) > 1 and kind not in _PYTHON and "channels" not in kind.options:
            instruments[name]["channels"] = sorted(channels)
        for channel in channels:
            unit, sensor = kind.reads[channel], f"s{len(sensors) + 1}"
            sensors[sensor] = {"reader": name, "channel": channel, "unit": unit}
            settings = {f: example["factors"][f]["levels"] for f in factors}
            true = truth["sensors"][sensor] = _output(unit, kind, settings, rng)
            true["formula"] += f" + {true['noise']:.2g}*seat" if "draws" in truth else ""
            example["measure"]["max_sd"][sensor] = _NOISY * true["noise"] / kind.reading_s**0.5
    bench = {"name": LAB, "instruments": instruments, "sensors": sensors, "factors": factors, "limits": limits}
    files = {name: text for name, text in texts().items() if name in {one["driver"] for one in instruments.values()}}
    return AnyLaboratory(example, truth, bench), {"bench.toml": toml_text(bench), **files}


def shows(fault: Mapping[str, Any], drivers: Mapping[str, str]) -> bool:
    """Whether a fault shows in readings: one that hangs and prints coarse steps may be one without noise."""
    coarse = {kind.driver for kind in kinds() if kind.step}
    return fault["kind"] != "frozen-reading" or drivers.get(fault.get("on", "")) not in coarse


def _instrument(kind: _Kind, name: str, rng: random.Random) -> dict[str, Any]:
    shared = "++" in texts().get(kind.driver, "")
    address = "socket://192.0.2.60:1234" if shared else rng.choice(_ADDRESSES[kind.wire])
    return {"driver": kind.driver, "address": address.format(name=name, n=name[-1]), **kind.options}


def _output(unit: str, kind: _Kind, levels: Mapping[str, list[float]], rng: random.Random) -> dict[str, Any]:
    """A sensor whose output is a straight line in every factor, within what its reader takes."""
    low, high = (kind.span * end for end in _READ.get(unit, _OTHERS))
    share = (high - low) / len(levels) * rng.uniform(0.5, 1.0)
    terms = [f"{(low + high) / 2:.6g}"]
    for name, there in levels.items():
        slope = share / (there[-1] - there[0]) * rng.choice((-1.0, 1.0))
        terms.append(f"{slope:.6g}*({name} - {(there[0] + there[-1]) / 2:.6g})")
    noise = max((high - low) * rng.choice((1e-6, 1e-5)), 0.5 * kind.step)
    return {"formula": " + ".join(terms), "noise": float(f"{noise:.2g}")}
