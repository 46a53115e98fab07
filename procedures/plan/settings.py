"""Settings common to procedures of every kind."""

from __future__ import annotations

from typing import Annotated

from pydantic import AfterValidator, BaseModel, ConfigDict, Field, ValidationInfo

Positive = Annotated[float, Field(gt=0, le=1e6)]


def check_name(name: str) -> None:
    """Refuse a name with an effect elsewhere: in a mail's header, a unit file, a spreadsheet's cell.

    Raises:
        ValueError: it has an unprintable character, or begins like a spreadsheet's formula.
    """
    if not name.isprintable():
        raise ValueError(f"a name has printable characters only, not {name!r:.100}")
    if name[:1] in ("=", "+", "-", "@"):
        raise ValueError(f"a name does not begin with {name[0]}, which spreadsheets take for a formula")


def _checked_name(name: str, info: ValidationInfo) -> str:
    """Existing runs with such a name can be finished."""
    if not (info.context or {}).get("stored"):
        check_name(name)
    return name


Name = Annotated[str, Field(min_length=1, max_length=80), AfterValidator(_checked_name)]
"""Name of a bench, a procedure, an instrument or a sensor."""


class Strict(BaseModel):
    """Settings that refuse unknown keys and NaN."""

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False, defer_build=True)


class Acceptance(Strict):
    """Acceptance limits of a finished calibration, None for no limit."""

    @property
    def limited(self) -> bool:
        """Whether any limit is set."""
        return any(getattr(self, name) is not None for name in type(self).model_fields)


class WarningSettings(Strict):
    """Early warnings about the sensors during a run. They never stop it by themselves."""

    enabled: bool = Field(True, description="watch for rising noise, drift, and sensors that died")
    hold: bool = Field(False, description="hold the run at each new warning, until `rig release`")
    against: str | None = Field(
        None,
        min_length=1,
        description="the last calibration of these sensors, or an earlier run of them: a file beside the procedure. "
        "It is kept in the run file, and readings that leave it are warned of",
    )
