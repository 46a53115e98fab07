"""A previous calibration: predicted outputs of a run, with their uncertainty."""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from rig.errors import UsageError
from rig.files.regular import read_regular_text
from rig.fitter.errors import FitError
from rig.procedures.errors import DataError
from rig.procedures.kinds import kinds
from rig.procedures.plan.expected import Expecting, Previous
from rig.verbs.infer import read_calibration


def read_previous(path: Path) -> Previous:
    """A calibration file, or an earlier run, which is then fitted. Raises `UsageError` or `RunFileError`."""
    if path.suffix == ".sqlite":
        return Previous(path.name, _expecting(_fitted(path)))
    file = read_calibration(path)
    try:
        return Previous(path.name, file.kind.expecting(file.calibration))
    except FitError as error:
        raise UsageError(f"{path}: {error}") from error


def previous_text(path: Path) -> str:
    """A calibration file, or an earlier run, as text that `parse_previous` reads. Raises as `read_previous`."""
    given = _fitted(path) if path.suffix == ".sqlite" else _content(path)
    return json.dumps({"name": path.name, "content": given}, allow_nan=False)


def parse_previous(text: str, where: str) -> Previous:
    """Read the text of `previous_text`. Raises `UsageError`."""
    try:
        given = json.loads(text)
        return Previous(str(given["name"]), _expecting(given["content"]))
    except (ValueError, KeyError, TypeError, AttributeError, RecursionError) as error:
        raise UsageError(f"{where}: the previous calibration in it cannot be read: {error}") from error


def _expecting(content: Mapping[str, Any]) -> Expecting:
    """A calibration from the JSON output of `rig fit`. Raises `FitError` for one without information about a bench."""
    kind = kinds()[content["data"]["kind"]]
    return kind.expecting(kind.calibration_of(content))


def _content(path: Path) -> Any:
    read_calibration(path)  # reports its defect
    return json.loads(read_regular_text(path))


def _fitted(path: Path) -> dict[str, Any]:
    from rig.by_kind import fit_table  # noqa: PLC0415 - a controller without an earlier run does not need it
    from rig.tables import read_table  # noqa: PLC0415

    try:
        return fit_table(read_table(path)).to_json()
    except DataError as error:
        raise UsageError(str(error)) from error
