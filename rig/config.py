"""Reading bench, procedure and world files: TOML in, checked objects out, one clear message if not.

A message names the file, the place in it, what is wrong, and what would be right.
"""

from __future__ import annotations

import json
import re
import tomllib
from collections.abc import Mapping
from datetime import date
from math import isfinite
from pathlib import Path
from typing import Any, Literal, Self, TypeVar, cast

from pydantic import BaseModel, ConfigDict, Field, ValidationError, model_validator

from procedures.kind import Procedure, kinds
from procedures.settings import Name
from procedures.table import UNITS
from rig.errors import ConfigurationError
from rig.explained import explain
from rig.protection import InterlockConfig, SafetyConfig
from rig.regular import read_regular_text

Model = TypeVar("Model", bound=BaseModel)


class _Strict(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True)


class InstrumentConfig(BaseModel):
    """One `[instruments.NAME]` table. What is not listed here goes to the driver, which checks it."""

    model_config = ConfigDict(extra="allow", frozen=True)

    driver: str
    address: str = Field(min_length=1)
    asset: str = Field("", description="your asset number, for instruments that do not tell their serial number")
    due: date | None = Field(None, description="when its own calibration is due")
    serial: str = Field("", description="expected serial number; another one is refused")

    @property
    def options(self) -> dict[str, Any]:
        """What the driver is to check."""
        return dict(self.model_extra or {})


class SensorConfig(_Strict):
    """One `[sensors.NAME]` table: a sensor under calibration, its output recorded as `NAME_UNIT`."""

    axis: Literal["x", "y", "z"] | None = Field(
        None, description="nominal axis in the package, for kinds of procedures that ask for it"
    )
    unit: Literal["V", "mV"] = Field("V", description="in which its output is recorded; the reader measures volts")
    reader: str = Field(description="which instrument reads it")
    channel: str = Field("input", description="on which channel")
    asset: str = ""


FOLLOWS_S = 480.0
"""Time constant with which sensors are taken to follow their chamber where the bench file does not say."""


class TemperatureConfig(_Strict):
    """One `[temperatures.NAME]` table; NAME is the column it is recorded in and ends in `_degC`."""

    reader: str
    channel: str
    place: Literal["package", "enclosure", "sensors", "sse", "lab"] = Field(
        "package", description="where the thermometer sits; the simulation reads it"
    )
    follows_s: float | None = Field(
        None,
        ge=1,
        le=1e6,
        description="time constant with which it follows its chamber; how long soaks are forecast to take rests on it",
    )


class LiveConfig(_Strict):
    """Written by `rig sim`: how this bench's time runs."""

    speed: float = Field(gt=0)
    epoch_utc: float
    started_utc: float


class BenchConfig(_Strict):
    """A whole `bench.toml`."""

    name: Name
    simulated: bool = False
    instruments: dict[Name, InstrumentConfig] = Field(min_length=1)
    sensors: dict[Name, SensorConfig] = Field(min_length=1)
    temperatures: dict[Name, TemperatureConfig] = Field(default_factory=dict)
    factors: dict[str, str] = Field(
        default_factory=dict,
        description="which instrument sets which factor, for kinds of procedures that leave it to the bench",
    )
    limits: dict[str, tuple[float, float]] = Field(default_factory=dict)
    interlocks: dict[str, InterlockConfig] = Field(default_factory=dict)
    safety: SafetyConfig = SafetyConfig()
    live: LiveConfig | None = None

    @model_validator(mode="after")
    def _names_meet(self) -> Self:
        read = {f"sensors.{name}": (s.reader, s.channel) for name, s in self.sensors.items()}
        read |= {f"temperatures.{name}": (t.reader, t.channel) for name, t in self.temperatures.items()}
        taken: dict[tuple[str, str], str] = {}
        for name, (reader, channel) in read.items():
            if reader not in self.instruments:
                known = ", ".join(sorted(self.instruments))
                raise ValueError(f"{name}.reader = {reader!r} is no instrument here (there are {known})")
            other = taken.setdefault((reader, channel), name)
            if other != name:
                raise ValueError(f"{other} and {name} are both on channel {channel} of {reader}")
        for name, instrument in self.factors.items():
            known_factors = [factor for kind in kinds().values() for factor in kind.bench_factors]
            if name not in known_factors:
                raise ValueError(f"factors.{name} is no factor of any procedure; known: {', '.join(known_factors)}")
            if instrument not in self.instruments:
                known = ", ".join(sorted(self.instruments))
                raise ValueError(f"factors.{name} = {instrument!r} is no instrument here (there are {known})")
        for name in self.temperatures:
            if not name.endswith("_degC"):
                raise ValueError(f"temperatures.{name}: the name is a column and must end in its unit, _degC")
        for name in UNITS.keys() & self.sensors.keys():
            raise ValueError(f"sensors.{name}: a table has {name}_{UNITS[name]} already; name the sensor otherwise")
        for name, (low, high) in self.limits.items():
            if not low < high:
                raise ValueError(f"limits.{name}: {low:g} is not below {high:g}")
            if not (isfinite(low) and isfinite(high)):
                raise ValueError(f"limits.{name}: {low:g} to {high:g} limits nothing; give two numbers")
        return self


def parse_toml(text: str, where: str) -> dict[str, Any]:
    """TOML text to plain values; raises `ConfigurationError` naming `where`, line and column."""
    if _DEEP_KEY.search(text):
        raise ConfigurationError(f"{where} is nested too deeply to be a file of ours")
    try:
        values = tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        raise ConfigurationError(f"{where} is not valid TOML: {error}") from error
    except ValueError:  # Python converts no text of more than 4300 digits to a whole number
        raise ConfigurationError(f"{where} has a whole number of thousands of digits; TOML's have 64 bits") from None
    except RecursionError:
        raise ConfigurationError(f"{where} is nested too deeply to be a file of ours") from None
    _check_values(values, where)
    return values


_DEEPEST = 50
_DEEP_KEY = re.compile(rf"""(?<![\w-])(?:(?:[\w-]++|"[^"\n]*+"|'[^'\n]*+')[ \t]*+\.[ \t]*+){{{_DEEPEST}}}""", re.ASCII)
"""A dotted key that tomllib would take time for that grows with the square of its length."""


def _check_values(values: dict[str, Any], where: str) -> None:
    """Refuse what is valid text, and more than anything of ours can hold. Raises `ConfigurationError`."""
    level: list[Any] = [values]
    for _ in range(_DEEPEST):
        inner: list[Any] = []
        for value in level:
            if isinstance(value, dict | list):
                inner += value.values() if isinstance(value, dict) else value
            elif isinstance(value, int) and not -(2**63) <= value < 2**63:
                raise ConfigurationError(f"{where} has a whole number that needs more than 64 bits, TOML's most")
        if not inner:
            return
        level = inner
    raise ConfigurationError(f"{where} is nested too deeply to be a file of ours")


_MOST_TEXT = 4 << 20


def read_text(path: Path, what: str) -> str:
    """A configuration file's text; raises `ConfigurationError` if it cannot be read."""
    try:
        return read_regular_text(path, _MOST_TEXT)
    except FileNotFoundError:
        raise ConfigurationError(f"there is no {what} file {path}") from None
    except IsADirectoryError:
        raise ConfigurationError(f"{path} is a folder; name the {what} file in it") from None
    except UnicodeDecodeError as error:
        raise ConfigurationError(f"{path} is not UTF-8 text (byte {error.start})") from error
    except OSError as error:
        raise ConfigurationError(f"{path} cannot be read: {error.strerror}") from error


def parse_bench(text: str, where: str, *, strict: bool = True) -> BenchConfig:
    """Check the text of a bench file; `strict` as in `validated`."""
    return validated(BenchConfig, parse_toml(text, where), where, strict=strict)


def parse_procedure(text: str, where: str, *, strict: bool = True) -> Procedure:
    """Check the text of a procedure file; `strict` as in `validated`."""
    values = parse_toml(text, where)
    kind = values.get("kind")
    known = {name: one.settings for name, one in kinds().items() if one.settings is not None}
    if not isinstance(kind, str) or kind not in known:
        names = ", ".join(f'"{name}"' for name in known)
        raise ConfigurationError(f"{where}: kind = {kind!r:.80} is not a kind of procedure; known: {names}")
    return cast(Procedure, validated(known[kind], values, where, strict=strict))


def validated(
    model: type[Model], values: Mapping[str, Any], where: str, *, strict: bool = True, shown: bool = True
) -> Model:
    """An instance of `model`; raises `ConfigurationError` listing everything that is wrong.

    Strictly, as JSON has it: a list is a tuple and a text a path, but "yes" is no truth, "3" no number, 3.0 no count.
    What a run file holds is read otherwise: versions that took these began runs that are to be finished. Models see
    that in their validation context, as `stored`. Values that may be secrets are not `shown`.
    """
    try:
        return model.model_validate_json(json.dumps(values, default=str), strict=strict, context={"stored": not strict})
    except ValidationError as error:
        raise ConfigurationError(explain(error, where, model, shown=shown)) from (error if shown else None)
