"""Reading the calibration files of `rig fit --out`."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from rig.errors import UsageError
from rig.files.regular import read_regular_text
from rig.procedures.kind import Kind
from rig.procedures.kinds import kinds
from rig.procedures.present.shell import shell_word
from rig.procedures.present.words import incomplete
from rig.procedures.tables.within import KEY as READINGS
from rig.procedures.tables.within import Within
from rig.verbs.infer.content_hash import KEY, NOT_CHECKED, changed
from rig.verbs.infer.total import KeptBudget

_LARGEST = 1e150


@dataclass(frozen=True)
class CalibrationFile:
    """A calibration file.

    Attributes:
        kind: of calibration.
        calibration: object of that kind.
        simulated: whether it is from a simulated run.
        incomplete: sentence about missing points of its run, "" if none.
        notes: sentences for every use.
        budget: influences of its instruments; None if it has repeatability only.
        within: readings of which the rows of its data are means, by output.
        why: why it has repeatability only, a sentence; "" if the file does not say.
    """

    kind: Kind
    calibration: Any
    simulated: bool
    incomplete: str
    notes: tuple[str, ...] = ()
    budget: KeptBudget | None = None
    within: Mapping[str, Within] = field(default_factory=dict)
    why: str = ""


def read_calibration(path: Path) -> CalibrationFile:
    """Read a calibration file of `rig fit --out`. Raises `UsageError`."""
    if path.suffix == ".sqlite":
        raise UsageError(
            f"{path} is a run file; make a calibration from it first: rig fit {shell_word(path)} --out calibration.json"
        )
    if path.suffix == ".xml":
        raise UsageError(
            f"{path} is no calibration file of `rig fit --out`. Of the values of a digital calibration "
            f"certificate make one: rig certificate --read {shell_word(path)} --column "
            f"bath_degC=NAME --column prt_ohm=NAME > "
            f"t.csv, then rig fit t.csv --out c.json; numbers for the register: --as-equipment ASSET"
        )
    try:
        text = read_regular_text(path)
    except FileNotFoundError:
        raise UsageError(f"there is no file {path}") from None
    except OSError as error:
        raise UsageError(f"{path} cannot be read: {error.strerror}") from error
    except UnicodeDecodeError as error:
        why = f"it is not UTF-8 text (byte {error.start})"
        raise UsageError(f"{path} is not a calibration file of `rig fit --out`: {why}") from error
    except ValueError as error:
        raise _no_calibration(str(path), error) from error
    return calibration_in(text, str(path))


def calibration_in(text: str, source: str) -> CalibrationFile:
    """The calibration in the text of such a file; `source` is its name in messages. Raises `UsageError`."""
    try:
        given = json.loads(text)
        _check_unchanged(given, source)
        if (large := _too_large(given)) is not None:
            raise ValueError(f"its {large} is too large to compute with")
        about, kind = given["data"], _kind(given)
        words = kind.notes_of(given)
        if KEY not in given:
            words = (NOT_CHECKED, *words)
        budget = KeptBudget.of(given["budget"]) if "budget" in given else None
        calibration = kind.calibration_of(given)
        within = {str(name): Within.from_dict(one) for name, one in given.get(READINGS, {}).items()}
        simulated = bool(about.get("simulated"))
        told = (within, "" if budget else _why(given))
        return CalibrationFile(kind, calibration, simulated, incomplete(about), words, budget, *told)
    except RecursionError:
        raise UsageError(f"{source} is nested too deeply to be a calibration file") from None
    except (ValueError, LookupError, TypeError, AttributeError, ArithmeticError) as error:
        raise _no_calibration(source, error) from error


def _why(given: Mapping[str, Any]) -> str:
    """Why standard deviations and intervals are repeatability only, a sentence; "" if the file does not say."""
    told = str(given.get("uncertainty", ""))
    return f"standard deviations and intervals are {told}" if told else ""


def _check_unchanged(given: Any, source: str) -> None:
    """Refuse a file of which a key is not what was written: the block for readers and the one that is used agree."""
    keys = changed(given) if isinstance(given, Mapping) else []
    if keys:
        verb = "is" if len(keys) == 1 else "are"
        raise UsageError(
            f"{source} is not a calibration file of `rig fit --out`, or was changed since: {', '.join(keys)[:200]} "
            f"{verb} not what {KEY} in it says. Write it again with `rig fit DATA --out {shell_word(source)}`, or take "
            f"a copy"
        )


def _too_large(given: Any, key: str = "") -> str | None:
    """Key, with points between its parts, of the first number whose square is no double; None if there is none."""
    if isinstance(given, int | float):
        return key if not abs(given) <= _LARGEST else None
    parts = given.items() if isinstance(given, dict) else enumerate(given) if isinstance(given, list) else ()
    found = (_too_large(value, f"{key}.{name}".lstrip(".")) for name, value in parts)
    return next((one for one in found if one is not None), None)


def _no_calibration(source: str, error: Exception) -> UsageError:
    what = f"it has no key {error}" if isinstance(error, KeyError) else str(error)
    return UsageError(
        f"{source} is not a calibration file of `rig fit --out`: {what}. Write it again with `rig fit DATA --out FILE`"
    )


def _kind(given: Mapping[str, Any]) -> Kind:
    name = given["data"]["kind"]
    if name not in kinds():
        raise ValueError(f"its kind {name!r:.80} is not known; known: {', '.join(kinds())}")
    return kinds()[name]
