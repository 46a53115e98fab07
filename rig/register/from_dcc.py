"""Entries of a register from digital calibration certificates of others: numbers copied once, with their source.

The register keeps the numbers themselves, so that a run has them also without the certificate's file.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Literal

from rig.dcc.read_dcc import Number, Quantity, Read
from rig.errors import UsageError
from rig.files.toml_text import toml_text
from rig.procedures.column_names import stem_of, unit_of
from rig.units.differences import factor
from rig.units.si import ratio

_ZERO_CELSIUS_K = 273.15
_ONE_SIGMA = 0.6827


@dataclass(frozen=True)
class Wanted:
    """Values to be taken from a certificate.

    Attributes:
        asset: of the equipment in the register.
        quantity: the column or unit in tables that the equipment gives, such as `bath_degC`.
        value: name, path or refType of the values in the certificate.
        means: whether they are errors of the reading (reading minus true value), or corrections.
        at: name, path or refType of the settings of the values; "" for a value of all settings.
    """

    asset: str
    quantity: str
    value: str
    means: Literal["error", "correction"]
    at: str = ""


def equipment_text(read: Read, wanted: Wanted, sha256: str) -> str:
    """Text for `equipment.toml`: the equipment, its certificate, and one statement.

    Args:
        read: the certificate.
        wanted: what is taken from it.
        sha256: of its file.

    Raises:
        UsageError: it is not traceable, or values are not there, do not convert, or have no complete uncertainty.
    """
    number, date = read.number, read.issued or read.ended or read.began
    if read.untraceable:
        raise UsageError(
            f"{read.file} says that it is not traceable ({read.untraceable[0]}): no equipment is made of it"
        )
    if date is None:
        raise UsageError(f"{read.file} has no date: write the entry by hand")
    maker, model, serial = read.makers[0] if read.makers else ("", "", "")
    known = {"maker": maker, "model": model, "serial": serial}
    certificate = {"number": number, "date": date, "laboratory": read.laboratory}
    entry = {**{name: text for name, text in known.items() if text}, "certificate": certificate}
    told = toml_text({"equipment": {wanted.asset: entry}}).lstrip()
    says = toml_text({"says": _says(read, wanted)}).replace("[says]", f"[[equipment.{_bare(wanted.asset)}.says]]")
    source = f"# From the digital calibration certificate {number} (SHA-256 {sha256}): {wanted.value}.\n"
    return f"{source}{told}{says}"


def _bare(asset: str) -> str:
    """The asset as a key of TOML, as `toml_text` writes it."""
    return toml_text({asset: 0}).partition(" = ")[0].strip()


def _says(read: Read, wanted: Wanted) -> dict[str, object]:
    unit = unit_of(wanted.quantity)
    values = read.find(wanted.value)
    values = _with_coverage(values)
    k, probability = _coverage(values)
    sign = -1.0 if wanted.means == "error" else 1.0
    rows = [
        (sign * _in(one.value, one.unit, unit), _in(_uncertain(values, one), one.unit, unit)) for one in values.numbers
    ]
    says: dict[str, object] = {"quantity": wanted.quantity, "unit": unit, "k": k, "probability": probability}
    if not wanted.at:
        if len(rows) > 1:
            raise UsageError(f"{values.name} has {len(rows)} values: say at which settings, --at")
        return {**says, "correction": rows[0][0], "expanded": rows[0][1]}
    at = read.find(wanted.at)
    if len(at.numbers) != len(rows):
        raise UsageError(f"{values.name} has {len(rows)} values, and {at.name} has {len(at.numbers)}")
    settings = [_setting(one, unit) for one in at.numbers]
    table = sorted([setting, *row] for setting, row in zip(settings, rows, strict=True))
    if any(b[0] <= a[0] for a, b in pairwise(table)):
        raise UsageError(
            f"{at.name} has a setting more than once: the values of {values.name} there are one correction; write its "
            f"entry by hand, with their mean"
        )
    return {**says, "table": table}


@dataclass(frozen=True)
class Column:
    """A column of a table made of a certificate: its name with its unit, and the values' name in the certificate."""

    name: str
    value: str


def table_text(read: Read, columns: Sequence[Column]) -> str:
    """Values of a certificate as CSV, with a column of standard uncertainties, `u_NAME`, where it has them for all.

    Args:
        read: the certificate.
        columns: what is taken from it, one or more.

    Raises:
        UsageError: values are not there, do not convert, or are not as many as the others.
    """
    made: dict[str, list[float]] = {}
    for one in columns:
        unit, values = unit_of(one.name), read.find(one.value)
        if not stem_of(one.name):
            raise UsageError(f"--column {one.name}={one.value}: the column's name ends in its unit, as in bath_degC")
        made[one.name] = [_setting(number, unit) for number in values.numbers]
        standard = [number.standard for number in values.numbers]
        if None not in standard:
            pairs = zip(values.numbers, standard, strict=True)
            made[f"u_{one.name}"] = [_in(u or 0.0, number.unit, unit) for number, u in pairs]
    counts = {name: len(values) for name, values in made.items()}
    if len(set(counts.values())) > 1:
        told = ", ".join(f"{name} {count}" for name, count in counts.items())
        raise UsageError(f"{read.file}: these values are not as many as one another: {told}")
    rows = zip(*made.values(), strict=True)
    return "\n".join([",".join(made), *(",".join(map(repr, row)) for row in rows)]) + "\n"


def _with_coverage(values: Quantity) -> Quantity:
    """Standard uncertainties alone as expanded ones with k = 1, which is all that is known of them."""
    alone = all(one.expanded is None and one.k is None and one.standard is not None for one in values.numbers)
    if not alone:
        return values
    numbers = tuple(replace(one, expanded=one.standard, k=1.0, probability=_ONE_SIGMA) for one in values.numbers)
    return replace(values, numbers=numbers)


def _coverage(values: Quantity) -> tuple[float, float]:
    """Coverage factor and probability, which must be the same for all values. Raises `UsageError`."""
    found = {(one.k, one.probability) for one in values.numbers}
    if len(found) > 1:
        raise UsageError(f"{values.name} has several coverage factors: write its entry by hand, with `standard`")
    k, probability = found.pop()
    if k is None or probability is None:
        raise UsageError(f"{values.name} has no coverage factor and probability: write its entry by hand")
    return k, probability


def _uncertain(values: Quantity, one: Number) -> float:
    if one.expanded is None:
        raise UsageError(f"{values.name} has no expanded uncertainty: write its entry by hand")
    return one.expanded


def _in(difference: float, of: str, to: str) -> float:
    """An error or an uncertainty in another unit. Raises `UsageError` if the units do not convert."""
    per = factor(of, to)
    per = ratio(of, to) if per is None else per
    if per is None:
        raise UsageError(f"the certificate is in {of!r}, which does not convert to {to!r}, the unit of the quantity")
    return _plain(difference * per)


def _setting(one: Number, to: str) -> float:
    """A value in another unit; a temperature in K is one in degC of another zero."""
    shift = {("K", "degC"): -_ZERO_CELSIUS_K, ("degC", "K"): _ZERO_CELSIUS_K}.get((one.unit, to), 0.0)
    value = _in(one.value, one.unit, to)
    return round(value + shift, 9) if shift else value


def _plain(value: float) -> float:
    """Without the last digits, which a conversion of units leaves."""
    return float(f"{value:.12g}")


def choose(given: Sequence[str | None]) -> Literal["error", "correction"]:
    """Which of `--error` and `--correction` was given. Raises `UsageError` unless it is one of them."""
    error, correction = given
    if (error is None) == (correction is None):
        raise UsageError("say whether the values are errors (--error NAME) or corrections (--correction NAME)")
    return "error" if error is not None else "correction"
