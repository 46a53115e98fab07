"""Policies for faults of a pressure controller and a chamber, in addition to those of any bench."""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType
from typing import ClassVar

from pydantic import Field

from procedures.fault_policies import ABORT, HOLD, RE_SOAK, RETRY, SKIP, FaultSettings, Policy


class WholePlotFaults(FaultSettings):
    """Policies for faults: steps for each class of fault; see docs/policies.md."""

    supply_failure: Policy = Field(["retry 8", ABORT], description="the pressure controller lost its supply or vacuum")
    soak: Policy = Field(ABORT, description="a soak that does not settle")
    temperature_left: Policy = Field(
        [RE_SOAK, ABORT],
        description="a whole plot's temperatures left their band; how often: `recovery.whole_plot_repeats`",
    )

    actions: ClassVar[tuple[str, ...]] = (RETRY, RE_SOAK, SKIP, HOLD, ABORT)
    special: ClassVar[Mapping[str, tuple[str, ...]]] = MappingProxyType(
        {**FaultSettings.special, "soak": (RETRY, HOLD, ABORT), "temperature_left": (RE_SOAK, HOLD, ABORT)}
    )
    follows: ClassVar[Mapping[str, str]] = MappingProxyType(
        {**FaultSettings.follows, "supply_failure": "instrument_error"}
    )
