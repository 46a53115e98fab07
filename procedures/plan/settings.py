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


def _checked_time(key: str, text: str | None) -> str | None:
    if text is not None and not (len(text) == len("07:00") and _is_time(text)):
        raise ValueError(f"{key} is a time of day such as 07:00")
    return text


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
    stop_when: Literal["explained", "confirmed", "alone"] = Field(
        "confirmed",
        description="explained: no further run once every effect has one explanation; confirmed: only once a further "
        "run has shown it, too; alone: only once a second cause beside it is excluded, too, which takes hours",
    )
    between_runs: Literal["chamber", "safe"] = Field(
        "chamber",
        description="between two runs, chamber: what holds the environment stays on at its setting, watched, at most "
        "half an hour, and the next run begins without settling again; safe: everything is in its safe state",
    )

    @field_validator("until")
    @classmethod
    def _is_time_of_day(cls, until: str | None) -> str | None:
        return _checked_time("until", until)

    @model_validator(mode="after")
    def _one_end(self) -> Self:
        if self.until is not None and self.hours is not None:
            raise ValueError("until and hours both say when the loop ends; leave one out")
        return self


class GoalSettings(Strict):
    """Precision for which `rig loop` adds replications, before it looks for further effects."""

    sigma: dict[str, Positive] = Field(
        {},
        description="largest standard uncertainty of a coefficient or parameter, by its name in `rig fit --json`, in "
        "its unit: { S_V = 3e-6 }; for every sensor that has it, as far as scatter between the observations goes",
    )
    U: dict[str, Positive] = Field(
        {},
        description="largest expanded uncertainty (95 %, with the bench's register) of a result, by its name in "
        '`rig budget`, or by that without the point: { "cell inferred force" = 0.002 }',
    )
    prediction: dict[str, Positive] = Field(
        {},
        description="largest half-width of the 95 % interval of a sensor's output by the model at the points of `at`, "
        "by the sensor's name and in its unit, by the scatter of the run alone: { cell = 0.0005 }",
    )
    at: tuple[dict[str, float], ...] = Field(
        (), description="points of `U` and `prediction`, as `--at` of `rig budget`; default: those of the kind"
    )
    same_meter: bool = Field(False, description="for `U`: the meter of the run reads the sensors in use, too")
    deadline: str | None = Field(
        None,
        description="time of day after which no replication is added, as 03:00; local time. Default: that of `loop`",
    )
    least_replications: int | None = Field(
        None, ge=2, le=1000, description="replications of the first run, before the first look; default: its own"
    )
    most_replications: int = Field(30, ge=2, le=1000, description="maximum number of replications")
    add: Literal["replications", "points"] = Field(
        "replications",
        description="what is added until the goal is met: whole replications; or points, a quarter of those of "
        "a replication at once, or one whole plot, at the settings that by the declared formula tell most of the "
        "aimed values, until there are as many as in most_replications",
    )

    @field_validator("deadline")
    @classmethod
    def _is_time_of_day(cls, deadline: str | None) -> str | None:
        return _checked_time("deadline", deadline)

    @model_validator(mode="after")
    def _has_one(self) -> Self:
        if not (self.sigma or self.U or self.prediction):
            raise ValueError("a goal is sigma, U or prediction: give one of them")
        return self


class WarningSettings(Strict):
    """Early warnings about the sensors during a run. They never stop it by themselves."""

    enabled: bool = Field(True, description="watch for rising noise, drift, and sensors that died")
    look: bool = Field(
        True,
        description="trace the run so far after every replication, in the background, and warn of effects that the "
        "declared model lacks; not in a dry run",
    )
    hold: bool = Field(False, description="hold the run at each new warning, until `rig release`")
    against: str | None = Field(
        None,
        min_length=1,
        description="the last calibration of these sensors, or an earlier run of them: a file beside the procedure. "
        "It is kept in the run file, and readings that leave it are warned of",
    )
