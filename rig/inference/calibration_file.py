"""What `rig fit --out` wrote, read back for use."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from fitter.errors import FitError
from procedures.attitude.infer import AttitudeCalibration
from procedures.general.infer.curve import CurveCalibration
from procedures.pressure.fit import PressureCalibration
from rig.errors import UsageError
from rig.present.words import incomplete
from rig.regular import read_regular_text
from rig.tables.unused import Unused


@dataclass(frozen=True)
class Inference:
    """A table with what was inferred from it.

    Attributes:
        columns: the input's, and those that were added.
        added: names of the latter.
        notes: what a reader should know.
        flagged: rows with something to say in a flag column.
        quantities: names of what was inferred; each has columns with _sd, _lo95 and _hi95 after its name.
        unused: columns and rows that play no part.
        zeros: pressure: what was taken as zero, by output, ready for JSON.

    """

    columns: Mapping[str, Any]
    added: tuple[str, ...]
    notes: tuple[str, ...]
    flagged: int
    quantities: tuple[str, ...] = ()
    unused: Unused = field(default_factory=Unused)
    zeros: Mapping[str, Any] = field(default_factory=dict)

    def to_json(self) -> dict[str, Any]:
        """What `rig infer --json` prints; the numbers are in the CSV."""
        return {
            "rows": len(next(iter(self.columns.values()))),
            "flagged": self.flagged,
            "quantities": list(self.quantities),
            "added": list(self.added),
            "notes": list(self.notes),
            "unused": self.unused.to_json(),
            "zeros": dict(self.zeros),
        }


Calibration = AttitudeCalibration | CurveCalibration | Mapping[str, PressureCalibration]


@dataclass(frozen=True)
class CalibrationFile:
    """A calibration file.

    Attributes:
        calibration: of a package of attitude sensors, of a table of any kind, or of pressure transducers by output
            column.
        simulated: made from a simulated run.
        incomplete: that the run it was made from lacked points, "" if it did not.
        confirmed: pressure: what a follow-up run said of each effect, and what the calibration has of it; the notes of
            an attitude calibration say so themselves.

    """

    calibration: Calibration
    simulated: bool
    incomplete: str
    confirmed: tuple[str, ...] = ()


def read_calibration(path: Path) -> CalibrationFile:
    """The file that `rig fit --out` wrote. Raises `UsageError`."""
    if path.suffix == ".sqlite":
        raise UsageError(f"{path} is a run file; make a calibration of it first: rig fit {path} --out calibration.json")
    try:
        given = json.loads(read_regular_text(path))
        about = given["data"]
        told = () if about["kind"] == "pitch-roll" else given.get("confirmed_by", {"effects": ()})["effects"]
        words = tuple(str(effect["used"]) for effect in told)
        return CalibrationFile(calibration_of(given), bool(about.get("simulated")), incomplete(about), words)
    except FileNotFoundError:
        raise UsageError(f"there is no file {path}") from None
    except OSError as error:
        raise UsageError(f"{path} cannot be read: {error.strerror}") from error
    except UnicodeDecodeError as error:
        raise UsageError(
            f"{path} is not a calibration file of `rig fit --out`: it is not UTF-8 text (byte {error.start})"
        ) from error
    except RecursionError:
        raise UsageError(f"{path} is nested too deeply to be a calibration file") from None
    except (ValueError, LookupError, TypeError, AttributeError, ArithmeticError) as error:
        raise UsageError(f"{path} is not a calibration file of `rig fit --out`: {error}") from error


def calibration_of(given: Mapping[str, Any]) -> Calibration:
    """The calibration in what `rig fit --out` writes. Raises ValueError, KeyError, TypeError or AttributeError."""
    if given["data"]["kind"] == "pitch-roll":
        return AttitudeCalibration.from_dict(given["calibration"])
    if given["data"]["kind"] == "general":
        if "calibration" not in given:
            raise FitError("it was written before tables of any kind could be inferred from; fit the table again")
        return CurveCalibration.from_dict(given["calibration"])
    return {n: PressureCalibration.from_dict(sensor["calibration"]) for n, sensor in given["sensors"].items()}
