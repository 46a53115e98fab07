"""What can go wrong on a dividing head, beside what can on any bench."""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType
from typing import ClassVar

from pydantic import Field

from procedures.faults import ABORT, ACCEPT, HOLD, RE_HOME, RETRY, SKIP, FaultSettings, Policy


class PitchRollFaults(FaultSettings):
    """What to do when something goes wrong: steps for each class of fault; see docs/policies.md."""

    drive_fault: Policy = Field(
        [RE_HOME, ABORT], description="a drive complains or went off; clearing it is part of every step"
    )
    not_homed: Policy = Field(["re-home 2", ABORT], description="an axis lost its zero, or did not find it")
    environment: Policy = Field(ABORT, description="the environment does not settle before the first point")
    temperature_left: Policy = Field(
        [ACCEPT], description="the environment left its tolerance at a point; accept flags the reading"
    )

    actions: ClassVar[tuple[str, ...]] = (RETRY, RE_HOME, SKIP, HOLD, ABORT)
    special: ClassVar[Mapping[str, tuple[str, ...]]] = MappingProxyType(
        {
            **FaultSettings.special,
            "environment": (RETRY, HOLD, ABORT),
            "temperature_left": (RETRY, ACCEPT, SKIP, HOLD, ABORT),
        }
    )
    follows: ClassVar[Mapping[str, str]] = MappingProxyType(
        {**FaultSettings.follows, "drive_fault": "instrument_error"}
    )
