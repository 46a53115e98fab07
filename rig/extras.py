"""Libraries of the extras of pyproject.toml, imported at their first use."""

from __future__ import annotations

from importlib import import_module
from typing import Any

from rig.errors import UsageError


def needed(module: str, extra: str) -> Any:
    """A module of an extra.

    Args:
        module: its name.
        extra: of pyproject.toml, which has it.

    Raises:
        UsageError: it is not installed; the message has the line that installs it.
    """
    try:
        return import_module(module)
    except ImportError as error:
        package = module.partition(".")[0]
        raise UsageError(
            f"this needs {package}, which is not installed: pip install 'calibration-rig[{extra}]'"
        ) from error
