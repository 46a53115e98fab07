"""Reading bench, procedure and world files: from TOML to checked objects, or one clear message.

A message gives the file, the place in it, the defect, and permitted values.
"""

from __future__ import annotations

import json
import re
import tomllib
from collections.abc import Iterator, Mapping
from datetime import date
from math import isfinite
from pathlib import Path
from types import MappingProxyType
from typing import Any, Literal, Self, TypeVar, cast

from pydantic import BaseModel, ConfigDict, Field, ValidationError, model_validator

from rig.bench.approach import Approach
from rig.bench.bridges import with_bridges
from rig.bench.protection import InterlockConfig, SafetyConfig
from rig.bench.toml_defects import in_words
from rig.errors import ConfigurationError
from rig.files.explained import explain
from rig.files.regular import read_regular_text
from rig.procedures.column_names import stem_of, unit_of
from rig.procedures.kind import Procedure
from rig.procedures.kinds import kinds
from rig.procedures.plan.settings import Name
from rig.procedures.present.meant import meant
from rig.procedures.tables.table import UNITS

Model = TypeVar("Model", bound=BaseModel)

ADDRESSES = (
    "where it is connected: a serial line or network socket, `/dev/ttyUSB0` (or `COM4`), `socket://HOST:5025`, "
    "`rfc2217://HOST:4001`, `visa://GPIB0::9::INSTR`; Modbus, `modbus-tcp://HOST:502/UNIT`, "
    "`modbus-rtu:///dev/ttyUSB0/UNIT?baud=9600&frame=8N1`, `modbus-rtu://socket://HOST:4001/UNIT`; CAN, "
    "`can:socketcan/can0`, `can:slcan//dev/ttyACM0?bitrate=500000`, `can:virtual/NAME`; only a person has none "
    "([instruments](instruments.md))"
)


class _Strict(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True, defer_build=True)


class InstrumentConfig(BaseModel):
    """One `[instruments.NAME]` table. Other keys are options of the driver, which checks them."""

    model_config = ConfigDict(extra="allow", frozen=True)

    driver: str = Field(description="its driver: `rig explain instruments` lists them, with their options")
    address: str = Field("", description=ADDRESSES)
    asset: str = Field("", description="your asset number, for instruments that do not report their serial number")
    due: date | None = Field(None, description="due date of its own calibration")
    serial: str = Field("", description="expected serial number; a different one is refused")
    coarse: bool = Field(
        False,
        description="its readings may repeat to the last digit, as a balance's or a coarse display's do: it is never "
        "said to hang",
    )

    @property
    def by_hand(self) -> bool:
        """Whether it is a person."""
        return self.driver == "person"

    @property
    def options(self) -> dict[str, Any]:
        """Options of the driver."""
        return dict(self.model_extra or {})


class SensorConfig(_Strict):
    """One `[sensors.NAME]` table: a sensor under calibration, its output recorded as `NAME_UNIT`."""

    axis: Literal["x", "y", "z"] | None = Field(
        None, description="nominal axis in the package, for kinds of procedures that need it"
    )
    unit: str = Field(
        "V",
        pattern=r"^[A-Za-z][A-Za-z0-9]*(_per_[A-Za-z][A-Za-z0-9]*)?$",
        description="unit of the recorded output, such as V or L_per_min: that of the reader's channel, mostly volts, "
        "with any prefix",
    )
    reader: str = Field(description="instrument that reads it")
    channel: str = Field("input", description="channel of the reader")
    asset: str = Field("", description="your asset number of it, by which the register has it")


ROOM = "lab"
"""The place of what stands in the room."""
PLACES = ("package", "enclosure", "sensors", "sse", ROOM)
_FACTOR = r"[A-Za-z][A-Za-z0-9_]*_[A-Za-z][A-Za-z0-9]*"
FOLLOWS_S = 480.0
"""Assumed time constant of sensors relative to their chamber if the bench file has none, seconds."""


class TemperatureConfig(_Strict):
    """One `[temperatures.NAME]` table; NAME is its column in tables and ends in `_degC`.

    A hygrometer or barometer of the room is one, too, with `place = "lab"`: `[temperatures.humidity_pct]`.
    """

    reader: str = Field(description="instrument that reads it")
    channel: str = Field(description="channel of the reader")
    place: str = Field(
        "package",
        description="place of the thermometer, used by the simulation: package, enclosure, sensors, sse, lab (the "
        "room, for which conditions of certificates are checked), or the name of a factor in degC that it measures too "
        "(a second thermometer in a bath); a soak of that factor waits for this thermometer, too",
    )
    asset: str = Field("", description="your asset number of the thermometer, if it is not the reader's")
    follows_s: float | None = Field(
        None,
        ge=1,
        le=1e6,
        description="time constant relative to its chamber; forecasts of soaks use it",
    )


class ReferenceConfig(_Strict):
    """One `[references.FACTOR]` table: a reference standard, whose reading of a factor replaces its setpoint."""

    reader: str = Field(description="instrument that reads it")
    channel: str = Field("input", description="channel of the reader")
    formula: str | None = Field(
        None,
        min_length=1,
        max_length=2000,
        description="the factor in its unit, from `reading` in that of the channel: `0.0012 + 2.50031 * reading`; left "
        "out: the reading",
    )
    of: str = Field(
        "",
        description="the factor that sets this quantity, in another unit: a valve in V, whose flow the standard reads. "
        "Models are of this quantity then, in its unit",
    )
    approach: list[tuple[float, float]] | None = Field(
        None,
        description="with `of`: pairs of its setting and what the standard reads there, so that a procedure may have "
        "levels of this quantity: `[[1, 0.49], [5.5, 2.39], [10, 3.8]]`",
    )
    asset: str = Field("", description="your asset number of it, by which the register has it")
    due: date | None = Field(None, description="due date of its own calibration")


class LiveConfig(_Strict):
    """Written by `rig sim`: relation of bench time to real time."""

    speed: float = Field(gt=0, description="bench seconds in a real second")
    epoch_utc: float = Field(description="UTC of the bench at its start, seconds since 1970")
    started_utc: float = Field(description="real UTC at its start, seconds since 1970")
    world: str | None = Field(None, description="text of its world file; empty for the default world")
    by_hand: str = Field("", description="where it is told what a person has done")


class BenchConfig(_Strict):
    """A whole `bench.toml`."""

    name: Name = Field(description="name of the bench, for people")
    simulated: bool = Field(False, description="whether its instruments are simulated, also without --dry")
    approval: bool = Field(
        False,
        description="whether a real run begins only if somebody else than its proposer approved exactly its files "
        "([two keys](../how_to/people_and_server.md#two-keys))",
    )
    equipment: str = Field(
        "",
        description="[register of equipment](../how_to/register.md), a file beside this one; "
        "without it `equipment.toml`, if there is one",
    )
    instruments: dict[Name, InstrumentConfig] = Field(min_length=1)
    sensors: dict[Name, SensorConfig] = Field(min_length=1)
    temperatures: dict[Name, TemperatureConfig] = Field(default_factory=dict)
    factors: dict[str, str] = Field(
        default_factory=dict,
        description="instrument that sets each factor, for kinds of procedures that leave it to the bench",
    )
    references: dict[str, ReferenceConfig] = Field(
        default_factory=dict, description="reference standards, by the factor that they read"
    )
    limits: dict[str, tuple[float, float]] = Field(
        default_factory=dict,
        description="lowest and highest value of commands and readbacks, by factor: `force_kN = [0, 10]`; of their "
        "rates of change, too: `pressure_psi_per_s = [-0.3, 0.3]`",
    )
    interlocks: dict[str, InterlockConfig] = Field(default_factory=dict)
    safety: SafetyConfig = SafetyConfig()
    live: LiveConfig | None = None

    def thermometers(self, factor: str) -> tuple[str, ...]:
        """Temperature columns that are recorded in what sets a factor: of its name, or with it as their place.

        One that a person reads is not among them: a soak cannot wait for it.
        """
        every = ((name, one) for name, one in self.temperatures.items() if name not in self.typed)
        return tuple(name for name, one in every if factor in (name, one.place))

    @property
    def typed(self) -> Mapping[str, tuple[str, str]]:
        """Columns that a person reads and types: outputs, reference standards, thermometers, to (person, channel)."""
        read = {f"{name}_{one.unit}": (one.reader, one.channel) for name, one in self.sensors.items()}
        read |= {name: (one.reader, one.channel) for name, one in self.references.items()}
        read |= {name: (one.reader, one.channel) for name, one in self.temperatures.items()}
        return {name: by for name, by in read.items() if self.instruments[by[0]].by_hand}

    @property
    def read_only(self) -> Mapping[str, str]:
        """Quantities that are read and that no factor is, each with the factor that sets it in another unit; "" for
        temperatures.
        """
        set_by = {name: one.of for name, one in self.references.items() if one.of}
        return {**dict.fromkeys(self.temperatures, ""), **set_by}

    @property
    def steered(self) -> Mapping[str, str]:
        """Quantities that may have levels, and the factor that sets each: see `ReferenceConfig.approach`."""
        return {name: one.of for name, one in self.references.items() if one.approach is not None}

    @property
    def setters(self) -> Mapping[str, str]:
        """What sets each factor: `factors`, and what sets those of `steered`."""
        return {**self.factors, **{name: self.factors[of] for name, of in self.steered.items()}}

    @model_validator(mode="after")
    def _names_meet(self) -> Self:
        read = {f"sensors.{name}": (s.reader, s.channel) for name, s in self.sensors.items()}
        read |= {f"temperatures.{name}": (t.reader, t.channel) for name, t in self.temperatures.items()}
        read |= {f"references.{name}": (r.reader, r.channel) for name, r in self.references.items()}
        taken: dict[tuple[str, str], str] = {}
        for name, (reader, channel) in read.items():
            if reader not in self.instruments:
                known = f"(known: {', '.join(sorted(self.instruments))}){meant(reader, self.instruments)}"
                raise ValueError(f"{name}.reader = {reader!r} is not an instrument here {known}")
            other = taken.setdefault((reader, channel), name)
            if other != name:
                raise ValueError(f"{other} and {name} are both on channel {channel} of {reader}")
        for name, instrument in self.factors.items():
            if not re.fullmatch(_FACTOR, name):
                own = [factor for kind in kinds().values() for factor in kind.bench_factors]
                if name not in own:
                    raise ValueError(
                        f"factors.{name}: the name is a column and must end in its unit, such as force_kN; factors of "
                        f"kinds with their own: {', '.join(own)}"
                    )
            if instrument not in self.instruments:
                known = f"(known: {', '.join(sorted(self.instruments))}){meant(instrument, self.instruments)}"
                raise ValueError(f"factors.{name} = {instrument!r} is not an instrument here {known}")
        for name in self.references:
            if name not in self.factors and not re.fullmatch(_FACTOR, name):
                raise ValueError(f"references.{name}: the name is that of a factor and ends in its unit: force_kN")
        for name, standard in self.references.items():
            if standard.of and standard.of not in self.factors:
                known = f"(known: {', '.join(self.factors) or 'none'}){meant(standard.of, self.factors)}"
                raise ValueError(f"references.{name}.of = {standard.of!r} is not a factor here {known}")
            if standard.approach is not None:
                if not standard.of:
                    raise ValueError(f"references.{name}.approach needs `of`, the factor whose settings it has")
                try:
                    Approach.of(standard.approach)
                except ValueError as error:
                    raise ValueError(f"references.{name}.approach: {error}") from None
            if standard.of and name in self.factors:
                raise ValueError(
                    f"references.{name}.of = {standard.of!r}, and factors.{name} sets it itself: leave out one of them"
                )
        for name, one in self.temperatures.items():
            if not name.endswith("_degC") and (one.place != ROOM or not re.fullmatch(_FACTOR, name)):
                raise ValueError(
                    f"temperatures.{name}: the name is a column and must end in its unit, _degC; a hygrometer or "
                    'barometer of the room ends in its own, such as humidity_pct, and has place = "lab"'
                )
            if not name.endswith("_degC") and name in self.factors:
                raise ValueError(f"temperatures.{name} is of the room, and factors.{name} is set: rename one of them")
        for name, one in self.temperatures.items():
            places = [*PLACES, *(factor for factor in self.factors if factor.endswith("_degC"))]
            if one.place in self.factors and one.place not in places:
                raise ValueError(
                    f"temperatures.{name}.place = {one.place!r} is a factor in {unit_of(one.place)}; a thermometer "
                    f"reads degC: call the factor {stem_of(one.place)}_degC, here and in the procedure"
                )
            if one.place not in places:
                raise ValueError(f"temperatures.{name}.place = {one.place!r} is unknown; known: {', '.join(places)}")
        for name in UNITS.keys() & self.sensors.keys():
            raise ValueError(f"sensors.{name}: a table has {name}_{UNITS[name]} already; rename the sensor")
        for name, (low, high) in self.limits.items():
            if not low < high:
                raise ValueError(f"limits.{name}: {low:g} is not below {high:g}")
            if not (isfinite(low) and isfinite(high)):
                raise ValueError(f"limits.{name}: {low:g} to {high:g} does not limit anything; give two numbers")
        return self


def parse_toml(text: str, where: str, *, shown: bool = True) -> dict[str, Any]:
    """Plain values from TOML text. Raises `ConfigurationError` with `where`, and with the line if it may be `shown`."""
    if _DEEP_KEY.search(text):
        raise ConfigurationError(f"{where} is nested too deeply for a file of rig")
    try:
        values = tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        raise ConfigurationError(
            f"{where} is not valid TOML: {error}{in_words(text, str(error), shown=shown)}"
        ) from error
    except ValueError:  # Python refuses to convert a text of more than 4300 digits to an integer
        raise ConfigurationError(f"{where} has a whole number of thousands of digits; TOML permits 64 bits") from None
    except RecursionError:
        raise ConfigurationError(f"{where} is nested too deeply for a file of rig") from None
    _check_values(values, where)
    return values


_DEEPEST = 50
_DEEP_KEY = re.compile(rf"""(?<![\w-])(?:(?:[\w-]++|"[^"\n]*+"|'[^'\n]*+')[ \t]*+\.[ \t]*+){{{_DEEPEST}}}""", re.ASCII)
"""Maximum length of a dotted key: tomllib's time grows with its square."""


def _check_values(values: dict[str, Any], where: str) -> None:
    """Refuse valid TOML that is too large for any of our files. Raises `ConfigurationError`."""
    level: list[Any] = [values]
    for _ in range(_DEEPEST):
        inner: list[Any] = []
        for value in level:
            if isinstance(value, dict | list):
                inner += value.values() if isinstance(value, dict) else value
            elif isinstance(value, int) and not -(2**63) <= value < 2**63:
                raise ConfigurationError(f"{where} has a whole number of more than 64 bits, the maximum of TOML")
        if not inner:
            return
        level = inner
    raise ConfigurationError(f"{where} is nested too deeply for a file of rig")


_MOST_TEXT = 4 << 20


def read_text(path: Path, what: str) -> str:
    """Text of a configuration file. Raises `ConfigurationError` if it cannot be read."""
    try:
        return read_regular_text(path, _MOST_TEXT)
    except FileNotFoundError:
        raise ConfigurationError(f"{what} file {path} does not exist") from None
    except IsADirectoryError:
        raise ConfigurationError(f"{path} is a folder; name the {what} file in it") from None
    except UnicodeDecodeError as error:
        raise ConfigurationError(f"{path} is not UTF-8 text (byte {error.start}); save it as UTF-8") from error
    except OSError as error:
        raise ConfigurationError(f"{path} cannot be read: {error.strerror}") from error


def parse_bench(text: str, where: str, *, strict: bool = True) -> BenchConfig:
    """Check the text of a bench file; `strict` as in `validated`."""
    values = parse_toml(text, where)
    if "kind" in values:
        raise ConfigurationError(f"{where} is a procedure, because it has a kind; name the bench file here")
    return validated(BenchConfig, with_bridges(values, where), where, strict=strict)


def parse_procedure(text: str, where: str, *, strict: bool = True) -> Procedure:
    """Check the text of a procedure file; `strict` as in `validated`."""
    values = parse_toml(text, where)
    kind = values.get("kind")
    if kind is None and "instruments" in values:
        raise ConfigurationError(f"{where} is a bench file, because it has instruments; name the procedure here")
    settings = kinds()[kind].settings if isinstance(kind, str) and kind in kinds() else None
    if settings is None:
        names = ", ".join(f'"{name}"' for name, one in kinds().items() if one.settings is not None)
        raise ConfigurationError(f"{where}: kind = {kind!r:.80} is not a kind of procedure; known: {names}")
    return cast(Procedure, validated(settings, values, where, strict=strict))


def validated(
    model: type[Model], values: Mapping[str, Any], where: str, *, strict: bool = True, shown: bool = True
) -> Model:
    """An instance of `model`. Raises `ConfigurationError` with all defects.

    In strict mode, as for JSON: a list is a tuple and a text a path, but "yes" is not a boolean, "3" not a number, 3.0
    not an integer. Run files are read without it, because earlier versions accepted such values and their runs must be
    resumable. Models see that in their validation context, as `stored`. Possible secrets are not `shown`.
    """
    try:
        return model.model_validate_json(json.dumps(values, default=str), strict=strict, context={"stored": not strict})
    except ValidationError as error:
        raise ConfigurationError(explain(error, where, model, shown=shown)) from (error if shown else None)


def due_dates(
    config: BenchConfig, known: Mapping[str, date | None] = MappingProxyType({})
) -> Iterator[tuple[str, str, date | None]]:
    """Due dates of calibrations: kind of entry ("instrument", "reference"), names in words, and date; once an asset.

    Entries of one asset number with one date are one line. One without a date is none, if another of its asset has one.

    Args:
        config: the bench.
        known: dates by asset number, as a register states them, of entries that have none in the bench file.
    """
    read_by = {name: one.asset for name, one in config.instruments.items()}
    every = [
        *(("instrument", n, one.asset, one.due or known.get(one.asset)) for n, one in config.instruments.items()),
        # A reference without an asset number is the standard that reads it: one instrument, one certificate.
        *(
            ("reference", n, one.asset or read_by.get(one.reader, ""), one.due or known.get(one.asset))
            for n, one in config.references.items()
        ),
    ]
    dated = {asset for _, _, asset, due in every if due is not None}
    lines: dict[tuple[str, str, date | None], list[str]] = {}
    for kind, name, asset, due in every:
        if due is not None or not asset or asset not in dated:
            lines.setdefault((kind, asset or f"without {name}", due), []).append(name)
    yield from ((kind, ", ".join(names), due) for (kind, _, due), names in lines.items())
