"""Statements of a register about the columns of a run: the bench file says which equipment gives which column."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from datetime import date
from math import inf, sqrt

import numpy as np
from scipy import special

from rig.bench.bench_file import playing
from rig.bench.config import BenchConfig
from rig.drivers.roles import Head
from rig.errors import ConfigurationError
from rig.fitter.arrays import FloatArray
from rig.procedures.column_names import stem_of, unit_of
from rig.procedures.evaluate.stated import Behaviour, Curve, Distribution, PlaceConstant, Stated, Statements
from rig.procedures.present.meant import meant
from rig.procedures.tables.table import Columns
from rig.register.check import entries
from rig.register.computed import computed_from
from rig.register.drift import drifted
from rig.register.equipment_file import PLACE_UNITS, Equipment, Polynomial, Register, Statement, Uncertain
from rig.units.differences import factor, relative
from rig.units.of_instruments import HEAD, TEMPERATURE_UNIT, VOLT, scale

_T_FROM = 0.05
_WIDTHS: Mapping[Distribution, float] = {"rectangular": sqrt(3.0), "triangular": sqrt(6.0), "arcsine": sqrt(2.0)}
_AUTO = 1.2
MISFIT = "{place} is not used: {asset} gives no {quantity}, but {columns}; correct the quantity{near}"
BEHIND = (
    "references.{name}: the register states no errors in {unit} of {asset}, which reads it: they are not in these "
    "uncertainties; state them, unless the certificate of the reference standard includes its meter"
)
VOLTS = "volts"
"""Function of a scanner's channel that reads volts; its other ones read temperatures."""
_SLACK = 1e-3


@dataclass(frozen=True)
class Given:
    """A column that a piece of equipment gives.

    Attributes:
        column: its name in tables.
        meter_range: configured range of the meter that reads it; None if it has none.
        output: whether it is the output of a sensor under calibration.
        formula: the column as a function of the reading; None if it is the reading.
        reads: unit of the reading that it is computed from.
    """

    column: str
    meter_range: float | None = None
    output: bool = False
    formula: str | None = None
    reads: str = ""


def degrees_of_freedom(one: Uncertain) -> float:
    """Degrees of freedom, where nobody states them from k and probability: k is a limit of Student's t (EA-4/02)."""
    if one.df is not None or one.k is None or one.probability is None:
        return inf if one.df is None else one.df
    upper = 0.5 * (1.0 + one.probability)
    if one.k - float(special.ndtri(upper)) <= _T_FROM:
        return inf
    return max(float(special.stdtridf(upper, one.k)), 1.0)


def standard_of(one: Uncertain) -> tuple[tuple[float, ...], Distribution]:
    """Standard uncertainty, as coefficients of a polynomial in the quantity's magnitude, and the distribution."""
    kind: Distribution = "normal"
    if one.expanded is not None:
        assert one.k is not None
        size, divisor = one.expanded, one.k
    elif one.half_width is not None:
        kind = one.distribution or "rectangular"
        size, divisor = one.half_width, _WIDTHS[kind]
    else:
        size, divisor = one.standard if one.standard is not None else 0.0, 1.0
    coefficients = size if isinstance(size, tuple) else (size,)
    return tuple(c / divisor for c in coefficients), kind


def stated_of(register: Register, config: BenchConfig, on: date) -> Statements:
    """Everything that a register states about the columns of a run on a bench.

    Args:
        register: the register.
        config: the bench.
        on: last day of the run, for drift since the calibrations.

    Raises:
        ConfigurationError: the drift of a certificate's quantity is not known for so long a time.
    """
    errors: list[Stated] = []
    unused: list[str] = []
    lacking: list[str] = []
    counted: set[str] = set()
    for asset, given in given_by(config).items():
        equipment = register.equipment.get(asset)
        if equipment is None:
            continue
        ranges = [one.meter_range for one in equipment.says if one.meter_range is not None]
        for number, said in enumerate(equipment.says):
            place = f"equipment.{asset}.says.{number}"
            mine = [one for one in given if _is_of(said, one)]
            if not mine:
                columns = ", ".join(map(_words, given)) or "no column"
                if any(_is_of(other, one) for other in equipment.says for one in given) or not given:
                    unused.append(f"{place}: nothing here is in {said.quantity}; {asset} gives {columns}")
                else:
                    names = [name for one in given for name in (one.column, one.reads or unit_of(one.column))]
                    what = {"quantity": said.quantity, "near": meant(said.quantity, names)}
                    lacking.append(MISFIT.format(place=place, asset=asset, columns=columns, **what))
            else:
                errors += _stated(asset, equipment, said, mine, ranges, place, on)
                counted |= {one.column for one in mine if one.formula is not None}
    for name, reference in config.references.items():
        if reference.formula is not None and name not in counted:
            asset = config.instruments[reference.reader].asset or reference.reader
            unit = _unit(config, reference.reader, reference.channel)
            lacking.append(BEHIND.format(name=name, asset=asset, unit=unit))
    place_constants: dict[str, PlaceConstant] = {name: _constant(name, register) for name in register.place}
    every = tuple(_each_by_its_name(errors))
    return Statements(every, place_constants, tuple(unused), register.example, tuple(lacking))


def _each_by_its_name(errors: Sequence[Stated]) -> Iterator[Stated]:
    """Errors that have one name, such as two gains of one meter, with a number behind it from the second on."""
    known: Counter[str] = Counter()
    for one in errors:
        known[one.name] += 1
        yield one if known[one.name] == 1 else replace(one, name=f"{one.name}, no. {known[one.name]}")


def given_by(config: BenchConfig) -> Mapping[str, Sequence[Given]]:
    """Columns that equipment gives, by asset number: outputs and temperatures that it reads, factors that it sets."""
    found: dict[str, list[Given]] = {entry.asset: [] for _, entry in entries(config) if entry.asset}
    asset = {name: one.asset for name, one in config.instruments.items()}

    def add(number: str, one: Given) -> None:
        if number:
            found.setdefault(number, []).append(one)

    for name, sensor in config.sensors.items():
        column = f"{name}_{sensor.unit}"
        add(asset[sensor.reader], Given(column, _range(config, sensor.reader, sensor.channel), output=True))
    for name, thermometer in config.temperatures.items():
        one = Given(name, _range(config, thermometer.reader, thermometer.channel))
        add(asset[thermometer.reader], one)
        add(thermometer.asset, one)
    for name, reference in config.references.items():
        add(reference.asset, Given(name))
        where = (reference.reader, reference.channel)
        unit = "" if reference.formula is None else _unit(config, *where)
        add(asset[reference.reader], Given(name, _range(config, *where), formula=reference.formula, reads=unit))
    for name, instrument in _setters(config):
        if name not in config.references and name not in config.temperatures:
            add(asset[instrument], Given(name))
    return found


def _setters(config: BenchConfig) -> Iterator[tuple[str, str]]:
    """Factors and the instruments that set them; the axes of a head need no entry in the bench file."""
    yield from config.factors.items()
    for instrument in playing(config, Head):
        yield from ((axis, instrument) for axis in HEAD if axis not in config.factors)


def _range(config: BenchConfig, reader: str, channel: str) -> float | None:
    """Configured range of a channel, in the channel's unit."""
    options = config.instruments[reader].options
    ranges = options.get("ranges")
    found = ranges.get(channel) if isinstance(ranges, Mapping) else None
    found = options.get("range_V") if found is None else found
    return float(found) if isinstance(found, (int, float)) else None


def _unit(config: BenchConfig, reader: str, channel: str) -> str:
    """Unit of a channel's readings: volts, or degrees Celsius, unless the instrument's options say another one."""
    options = config.instruments[reader].options
    functions = options.get("channels")
    function = functions.get(channel, VOLTS) if isinstance(functions, Mapping) else VOLTS
    return str(options.get("unit", VOLT if function == VOLTS else TEMPERATURE_UNIT))


def _words(one: Given) -> str:
    return f"{one.column}, computed from {one.reads}" if one.reads else one.column


def _is_of(said: Statement, one: Given) -> bool:
    """Whether a statement is about a column or the reading that it is computed from: by its name, or by its unit."""
    if _is_named(said, one.column):
        return True
    return said.of_unit and factor(said.quantity, one.reads or unit_of(one.column)) is not None


def _is_named(said: Statement, column: str) -> bool:
    """Whether a statement has the name of a column; the unit may have another prefix."""
    if said.of_unit or said.quantity == column:
        return said.quantity == column
    same = stem_of(said.quantity) == stem_of(column)
    return same and scale(said.quantity_unit, unit_of(column)) is not None


def _stated(
    asset: str,
    equipment: Equipment,
    said: Statement,
    given: Sequence[Given],
    ranges: Sequence[float],
    key: str,
    on: date,
) -> Iterator[Stated]:
    """The errors that one statement makes: its own, drift, and resolution."""
    mine = [one for one in given if said.meter_range is None or one.meter_range in (None, said.meter_range)]
    if not mine:
        return
    columns = {one.column: factor(said.quantity_unit, unit_of(one.column)) or 1.0 for one in mine}
    computed = {
        one.column: computed_from(one.column, one.formula, factor(said.quantity_unit, one.reads) or 1.0)
        for one in mine
        if one.formula is not None and not _is_named(said, one.column)
    }
    direct = [one.output for one in mine if one.column not in computed]
    reads = bool(direct) and all(direct)
    auto = said.meter_range is not None and any(one.meter_range is None for one in mine)
    inside = _within(said.meter_range, ranges) if auto and said.meter_range is not None else None
    share = relative(said.unit)
    unit = factor(said.unit, said.quantity_unit) if share is None else None
    coefficients, distribution = standard_of(said)
    certificate = equipment.certificate
    source = f"{asset}, certificate {certificate.number}" if certificate is not None else asset
    words = f" in the {said.meter_range:g} {said.quantity_unit} range" if said.meter_range is not None else ""
    what = {"turn": "error per turn"}.get(said.behaves, said.behaves)
    name = f"{asset} {what} of {said.quantity}{words}"

    def scaled(curve: Curve) -> Curve:
        def value(x: FloatArray) -> FloatArray:
            y = curve(x) * (np.abs(x) * share if share is not None else (unit or 1.0))
            return np.asarray(y if inside is None else np.where(inside(x), y, 0.0))

        return value

    def signed(curve: Curve) -> Curve:
        def value(x: FloatArray) -> FloatArray:
            y = curve(x) * (x * share if share is not None else (unit or 1.0))
            return np.asarray(y if inside is None else np.where(inside(x), y, 0.0))

        return value

    standard, correction = _uncertainty(said, coefficients), _correction(said)
    own = Stated(
        name,
        source,
        columns,
        said.behaves,
        signed(correction),
        scaled(standard),
        degrees_of_freedom(said),
        distribution,
        reads,
        said.covered,
        key,
        computed,
    )
    yield own
    since = f"drift since {certificate.date}" if certificate is not None else "drift"
    further: list[tuple[str, float, Behaviour, Distribution]] = []
    if isinstance(said.drift, tuple):
        days = (on - certificate.date).days if certificate is not None else 0
        size = drifted(said.drift, days, f"{key}.drift")
        further.append((f"{name}, {since} ({days} days, by its history)", size, said.behaves, "normal"))
    elif said.drift:
        further.append((f"{name}, {since}", said.drift / sqrt(3.0), said.behaves, "rectangular"))
    if said.resolution:
        further.append((f"{name}, resolution", said.resolution / 2.0 / sqrt(3.0), "setting", "rectangular"))
    for label, size, behaves, shape in further:
        yield replace(
            own,
            name=label,
            behaves=behaves,
            correction=np.zeros_like,
            standard=scaled(_constant_curve(size)),
            df=inf,
            distribution=shape,
        )


def _constant_curve(value: float) -> Curve:
    return lambda x: np.full_like(x, value)


def _uncertainty(said: Statement, coefficients: Polynomial) -> Curve:
    """Standard uncertainty over the quantity, in the statement's unit."""
    if said.table is not None:
        x0, _, U = (np.array(column) for column in zip(*said.table, strict=True))
        assert said.k is not None
        return lambda x: np.asarray(np.interp(x, x0, U / said.k))
    return lambda x: np.asarray(np.polynomial.polynomial.polyval(np.abs(x), coefficients) + 0.0 * x)


def _correction(said: Statement) -> Curve:
    """Correction over the quantity, in the statement's unit."""
    if said.table is not None:
        x0, c, _ = (np.array(column) for column in zip(*said.table, strict=True))
        return lambda x: np.asarray(np.interp(x, x0, c))
    coefficients = said.polynomial or (said.correction,)
    return lambda x: np.asarray(np.polynomial.polynomial.polyval(x, coefficients) + 0.0 * x)


def _within(own: float, ranges: Sequence[float]) -> Curve:
    """Whether an autoranging meter reads a value in its range `own`: up at 120 % of a range."""
    below = max((one for one in ranges if one < own), default=0.0)
    return lambda x: np.asarray((np.abs(x) <= _AUTO * own) & (np.abs(x) > _AUTO * below))


def _constant(name: str, register: Register) -> PlaceConstant:
    given = next(one for key, one in register.place.items() if key == name)
    unit = factor(given.unit, next(u for key, u in PLACE_UNITS.items() if key == name)) or 1.0
    (standard, *_), distribution = standard_of(given)
    source = given.source or f"place.{name}"
    return PlaceConstant(name, given.value * unit, standard * unit, degrees_of_freedom(given), distribution, source)


def check_covered(stated: Statements, columns: Columns, where: str) -> None:
    """Refuse certificates that do not cover the values of a run.

    A thousandth of the covered range beyond it is permitted, for readings at its end.

    Raises:
        ConfigurationError: with a line for each.
    """
    found = []
    for one in stated.errors:
        if one.covered is None:
            continue
        low, high = one.covered
        slack = _SLACK * (high - low)
        for name in one.columns:
            if name not in columns:
                continue
            values = one.quantity(name, columns[name])
            least, most = float(np.nanmin(values)), float(np.nanmax(values))
            read = f"the reading of {name}" if name in one.computed else name
            if least < low - slack or most > high + slack:
                found.append(
                    f"{where}: {one.key}.range: the certificate covers {low:g} to {high:g}, and {read} of the run goes "
                    f"from {least:g} to {most:g}: name a certificate that covers it, or a narrower run"
                )
    if found:
        raise ConfigurationError("\n".join(found))
