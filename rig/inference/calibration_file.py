"""Reading the calibration files of `rig fit --out`."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from procedures.kind import Kind
from procedures.kinds import kinds
from procedures.shell import shell_word
from procedures.words import incomplete
from rig.errors import UsageError
from rig.inference.total import KeptBudget
from rig.regular import read_regular_text


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
    """

    kind: Kind
    calibration: Any
    simulated: bool
    incomplete: str
    notes: tuple[str, ...] = ()
    budget: KeptBudget | None = None


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
        about, kind = given["data"], _kind(given)
        words = kind.notes_of(given)
        budget = KeptBudget.of(given["budget"]) if "budget" in given else None
        calibration = kind.calibration_of(given)
        return CalibrationFile(kind, calibration, bool(about.get("simulated")), incomplete(about), words, budget)
    except RecursionError:
        raise UsageError(f"{source} is nested too deeply to be a calibration file") from None
    except (ValueError, LookupError, TypeError, AttributeError, ArithmeticError) as error:
        raise _no_calibration(source, error) from error


def _no_calibration(source: str, error: Exception) -> UsageError:
    return UsageError(f"{source} is not a calibration file of `rig fit --out`: {error}")


def _kind(given: Mapping[str, Any]) -> Kind:
    name = given["data"]["kind"]
    if name not in kinds():
        raise ValueError(f"its kind {name!r:.80} is not known; known: {', '.join(kinds())}")
    return kinds()[name]
