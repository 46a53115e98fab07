"""Settings common to procedures of every kind."""

from __future__ import annotations

from datetime import time
from typing import Annotated, Literal, Self

from pydantic import AfterValidator, BaseModel, ConfigDict, Field, ValidationInfo, field_validator, model_validator

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


Varies = Literal["again", "order", "settings", "temperature", "wait"]
"""Respects in which a further run differs from the first one."""


def _is_time(text: str) -> bool:
    try:
        time.fromisoformat(text)
    except ValueError:
        return False
    return True


class LoopSettings(Strict):
    """Bounds of `rig loop`, which makes further runs by itself. Options of the command line come first."""

    until: str | None = Field(None, description="time of day by which all is done, as 07:00; local time")
    hours: Positive | None = Field(None, description="the same as a number of hours; without `until`")
    most_runs: int = Field(3, ge=0, le=20, description="maximum number of further runs")
    least_gain: float = Field(
        0.005,
        ge=0,
        le=1,
        description="a further run has to settle an open question with at least this probability per hour, on average "
        "over the open questions",
    )
    allow: tuple[Varies | Literal["person"], ...] = Field(
        ("again", "order", "settings", "temperature", "wait"),
        description="in what a further run may differ from the first: the same again, another order, other settings, "
        "another temperature, longer waits; with person, also runs in which somebody has to do something",
    )
    stop_when: Literal["explained", "confirmed"] = Field(
        "confirmed",
        description="explained: no further run once every effect has one explanation; confirmed: only once a further "
        "run has shown it, too",
    )

    @field_validator("until")
    @classmethod
    def _is_time_of_day(cls, until: str | None) -> str | None:
        if until is not None and not (len(until) == len("07:00") and _is_time(until)):
            raise ValueError("until is a time of day such as 07:00")
        return until

    @model_validator(mode="after")
    def _one_end(self) -> Self:
        if self.until is not None and self.hours is not None:
            raise ValueError("until and hours both say when the loop ends; leave one out")
        return self


class GoalSettings(Strict):
    """Precision for which `rig loop` adds replications, before it looks for further effects."""

    sigma: dict[str, Positive] = Field(
        min_length=1,
        description="largest standard uncertainty of a coefficient or parameter, by its name in `rig fit --json`, in "
        "its unit: { S_V = 3e-6 }; for every sensor that has it, as far as scatter between the observations goes",
    )
    least_replications: int | None = Field(
        None, ge=2, le=1000, description="replications of the first run, before the first look; default: its own"
    )
    most_replications: int = Field(30, ge=2, le=1000, description="maximum number of replications")


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
