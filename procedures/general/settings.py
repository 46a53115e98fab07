"""The general procedure: `procedure.toml` with `kind = "general"`, checked and expanded to a run list.

Any number of factors, easy or hard to change, any sensors, any formula. It is also the reference of the file format:
`rig explain procedure` prints it.
"""

from __future__ import annotations

import random
import re
from collections.abc import Callable, Iterator, Mapping
from functools import cached_property
from types import MappingProxyType
from typing import Any, ClassVar, Literal, Self

from pydantic import Field, field_validator, model_validator

from rig.procedures.column_names import stem_of
from rig.procedures.general.design import (
    MOST_POINTS,
    DesignSettings,
    Points,
    Setting,
    check_whole_plots,
    optimal_rows,
    rows_of,
)
from rig.procedures.general.factors import FACTOR_NAME, HEAD_ANGLES, FactorSettings
from rig.procedures.general.model_settings import ModelSettings
from rig.procedures.general.orders import sides, visits
from rig.procedures.general.response import response_of
from rig.procedures.plan.by_hand import Steps, check_places, with_steps
from rig.procedures.plan.conduct import Conduct, EnvironmentSettings, SoakSettings, WholePlotConduct
from rig.procedures.plan.fault_policies import (
    ABORT,
    ACCEPT,
    HOLD,
    RE_HOME,
    RE_SOAK,
    RETRY,
    SKIP,
    FaultSettings,
    Policy,
)
from rig.procedures.plan.run_list import Factor, Point, RunList, Settle
from rig.procedures.plan.settings import Acceptance, GoalSettings, LoopSettings, Name, Positive, Strict, WarningSettings

_TAKEN = re.compile(r"(replicate|whole_plot|order|elapsed|block|run_index|simulated|accepted)(_.*)?")
"""Names with a meaning of their own in tables."""


class SettleSettings(Strict):
    """Criterion for reaching a setting; the bands are those of the factors."""

    dwell_s: float = Field(5.0, ge=0, le=1e6, description="within the band of every factor for this long")
    poll_s: Positive = Field(1.0, le=60, description="time between readbacks")
    timeout_s: Positive = Field(600.0, description="then the settling has failed")


class MeasureSettings(Strict):
    """Measurement at a point."""

    readings: int = Field(5, ge=1, le=50_000, description="sweeps over all channels; their mean is the observation")
    max_sd_V: Positive | None = Field(
        None, description="noisier than this: read again; for outputs in volts, or in millivolts and so on"
    )
    max_sd: dict[str, Positive] = Field(
        default_factory=dict,
        description="the same of one sensor, by its name on the bench, or of a factor's reference standard, by the "
        "factor's name; in its own unit",
    )
    repeats: int = Field(
        2,
        ge=0,
        le=10,
        description="maximum number of repeated readings; after them the reading is accepted and flagged",
    )


class RecoverySettings(Strict):
    """Handling of interruptions. A whole plot that may not continue is measured again under a new identity."""

    max_gap_s: Positive = Field(1800.0, description="after a longer gap the bench is prepared again")
    continue_gap_s: float = Field(
        600.0,
        ge=0,
        le=1e6,
        description="a whole plot left alone for longer is not continued; one that is looked at while a "
        "person is waited for is not left alone",
    )
    whole_plot_repeats: int = Field(
        2, ge=0, le=20, description="how often a whole plot may be measured again in one session because it was lost"
    )
    hold_max_s: Positive = Field(
        12 * 3600.0, description="a hold that is not released, or a setting that nobody makes, ends the session then"
    )


class ExpectSettings(Strict):
    """Expected errors of the sensors; used by `rig plan` and never by a fit."""

    sigma: dict[str, Positive] = Field(
        default_factory=dict, description="standard deviation of one observation, by sensor, in the unit of its output"
    )
    output: dict[str, str] = Field(
        default_factory=dict,
        description="output of a sensor by the factors, as arithmetic; with `sigma` and a register of equipment "
        "`rig plan` promises total uncertainties",
    )
    whole_plot_ratio: Positive = Field(
        1.0, description="standard deviation between whole plots, relative to that of one observation"
    )


class GeneralAcceptance(Acceptance):
    """Acceptance limits of a finished calibration; outside them `rig run` ends with exit code 3."""

    sigma_E: dict[str, Positive] | None = Field(
        None, description="largest standard deviation of one observation about the declared model, by sensor"
    )


class GeneralFaults(FaultSettings):
    """Policies for faults: steps for each class of fault; see docs/how_to/policies.md."""

    channel: Policy = Field(
        ["retry 3", ABORT],
        description="a channel of a reader fails, and its others read; accept: the output has no reading at the point",
    )
    supply_failure: Policy = Field(["retry 8", ABORT], description="a source or pressure controller reports a fault")
    drive_fault: Policy = Field([RE_HOME, ABORT], description="a drive of a head complains or went off")
    not_homed: Policy = Field(["re-home 2", ABORT], description="an axis lost its zero, or did not find it")
    reference: Policy = Field(
        ["retry 2", ACCEPT],
        description="a reference standard's reading is not within `tolerance` of the setpoint; accept flags it",
    )
    soak: Policy = Field(ABORT, description="a whole plot's settings do not settle")
    environment: Policy = Field(ABORT, description="the environment does not settle before the first point")
    temperature_left: Policy = Field(
        [RE_SOAK, ABORT],
        description="a whole plot's settings left their band. Without whole plots: the environment left its tolerance "
        'at a point, and the default is ["accept"], which flags the reading',
    )

    actions: ClassVar[tuple[str, ...]] = (RETRY, RE_HOME, RE_SOAK, SKIP, HOLD, ABORT)
    special: ClassVar[Mapping[str, tuple[str, ...]]] = MappingProxyType(
        {
            **FaultSettings.special,
            "channel": (RETRY, ACCEPT, SKIP, HOLD, ABORT),
            "reference": (RETRY, ACCEPT, SKIP, HOLD, ABORT),
            "soak": (RETRY, HOLD, ABORT),
            "environment": (RETRY, HOLD, ABORT),
            "temperature_left": (RE_SOAK, RETRY, ACCEPT, SKIP, HOLD, ABORT),
        }
    )
    follows: ClassVar[Mapping[str, str]] = MappingProxyType(
        {**FaultSettings.follows, **dict.fromkeys(("channel", "supply_failure", "drive_fault"), "instrument_error")}
    )

    def for_run(self, *, whole_plots: bool) -> GeneralFaults:
        """These policies, with the defaults of a run without whole plots if it is one."""
        if whole_plots or "temperature_left" in self.model_fields_set:
            return self
        return self.model_copy(update={"temperature_left": [ACCEPT]})


class GeneralProcedure(Strict):
    """A whole `procedure.toml` of kind general."""

    kind: Literal["general"]
    name: Name
    seed: int = Field(0, ge=0, le=2**63 - 1, description="seed of every random choice in the order")
    replications: int = Field(1, ge=1, le=1000, description="passes over the design, each in its own order")
    factors: dict[str, FactorSettings] = Field(min_length=1, max_length=20, description="what is set at each point")
    design: DesignSettings = DesignSettings()
    model: ModelSettings
    soak: SoakSettings = SoakSettings()
    settle: SettleSettings = SettleSettings()
    measure: MeasureSettings = MeasureSettings()
    environment: EnvironmentSettings | None = None
    recovery: RecoverySettings = RecoverySettings()
    faults: GeneralFaults = GeneralFaults()
    warnings: WarningSettings = WarningSettings()
    expect: ExpectSettings = ExpectSettings()
    acceptance: GeneralAcceptance = GeneralAcceptance()
    by_hand: Steps = ()
    loop: LoopSettings = LoopSettings()
    goal: GoalSettings | None = None

    @field_validator("factors")
    @classmethod
    def _names_are_columns(cls, factors: dict[str, FactorSettings]) -> dict[str, FactorSettings]:
        for name in factors:
            if not re.fullmatch(FACTOR_NAME, name):
                raise ValueError(f"factors.{name}: the name is a column and must end in its unit, such as force_kN")
            if _TAKEN.fullmatch(name):
                raise ValueError(f"factors.{name}: tables have a column of this name already; rename the factor")
        axes = [stem_of(name) for name in factors]
        for name, axis in zip(factors, axes, strict=True):
            if axes.count(axis) > 1:
                raise ValueError(f"factors.{name}: two factors are called {axis}; rename one, whatever its unit")
        return factors

    @model_validator(mode="after")
    def _can_be_run(self) -> Self:
        if self.environment is not None and self._whole_plots:
            raise ValueError(
                "environment goes with no hard factor: its temperatures are settled before the first point only; give "
                "them as a hard factor"
            )
        if not self.design.known:
            return self  # a file is read, or a design is searched, when a run is planned
        check_whole_plots(self._design, self.factors, steps=self._steps)
        points = sum(1 for _ in self._points())
        if points > MOST_POINTS:
            raise ValueError(f"the design has {points:,} points, more than {MOST_POINTS:,}")
        places = self._points() if self.by_hand else iter(())
        plots = len({point.whole_plot for point in places} - {None})
        check_places(self.by_hand, points=points, replications=self.replications, whole_plots=plots)
        return self

    @property
    def files(self) -> tuple[str, ...]:
        """Files beside the procedure that it needs, and that are not yet in it."""
        design = self.design
        return (str(design.points),) if design.type == "file" and not design.known else ()

    def completed(self, texts: Mapping[str, str]) -> dict[str, Any] | None:
        """Values of the procedure's file with the points of a design that is read or searched; None without one.

        Args:
            texts: contents of its `files`, by name.

        Raises:
            ValueError: with the defect of a file, or of a design, and what would mend it.
        """
        design = self.design
        if design.known:
            return None
        if design.type == "file":
            file = str(design.points)
            rows, plots = rows_of(texts[file], file, tuple(self.factors))
        else:
            formulas, ratio = self.model.formulas, self.expect.whole_plot_ratio
            if not formulas:
                raise ValueError('design "optimal" is searched for a formula, and the model has none: write `formula`')
            rows, plots = optimal_rows(design, self.factors, formulas, ratio, self.seed)
        values = self.model_dump(mode="json", exclude_none=True, exclude_unset=True)
        found = {"rows": rows} if plots is None else {"rows": rows, "plots": plots}
        return {**values, "design": {**values["design"], **found}}

    @property
    def _whole_plots(self) -> bool:
        return any(factor.hard for factor in self.factors.values())

    @property
    def _steps(self) -> bool:
        """Whether the points are steps in their order."""
        return self.design.type == "file"

    @cached_property
    def _design(self) -> Points:
        """Points of one replication in standard order."""
        return self.design.settings(self.factors)

    @property
    def _settings(self) -> tuple[Setting, ...]:
        return self._design.settings

    def _span(self, name: str) -> float:
        """Range of a factor's settings."""
        at = list(self.factors).index(name)
        values = [setting[at] for setting in self._settings]
        return max(values) - min(values)

    @property
    def settled(self) -> Mapping[str, Settle]:
        """Criterion of arrival of each factor, by its axis, those that are easy to change first."""
        settle = self.settle
        return {
            stem_of(name): factor.settle(self._span(name), settle.dwell_s, settle.timeout_s)
            for name, factor in sorted(self.factors.items(), key=lambda one: one[1].hard)
        }

    @property
    def conduct(self) -> Conduct:
        """Execution of the run."""
        recovery, settled = self.recovery, self.settled
        whole_plots = None
        if self._whole_plots:
            whole_plots = WholePlotConduct(
                soak=self.soak, continue_gap_s=recovery.continue_gap_s, repeats=recovery.whole_plot_repeats
            )
        any_settle = Settle(0.0, self.settle.dwell_s, 0.0, self.settle.timeout_s)
        return Conduct(
            settle=next(iter(settled.values()), any_settle),
            settles=settled,
            tolerances={name: factor.tolerated(self._span(name)) for name, factor in self.factors.items()},
            near={name: factor.nearness(self._span(name)) for name, factor in self.factors.items()},
            poll_s=self.settle.poll_s,
            readings=self.measure.readings,
            repeats=self.measure.repeats,
            max_sd_V=self.measure.max_sd_V,
            max_sd=self.measure.max_sd,
            models_of=dict.fromkeys(
                [*self.model.own, *self.expect.sigma, *self.expect.output, *(self.acceptance.sigma_E or ())]
            ),
            faults=self.faults.for_run(whole_plots=self._whole_plots),
            warnings=self.warnings,
            hold_max_s=recovery.hold_max_s,
            environment=self.environment,
            max_gap_s=recovery.max_gap_s,
            whole_plots=whole_plots,
            response=self._response,
            any_instruments=True,
            misfit=self._misfit,
        )

    def _misfit(self, sensors: Mapping[str, str], read: Mapping[str, str]) -> str:
        from rig.procedures.general.misfit import misfit  # noqa: PLC0415 - imports the fitter

        return misfit(self.factors, self.model, sensors, read)

    @cached_property
    def _response(self) -> Callable[[Mapping[str, float]], tuple[float, ...]] | None:
        return response_of(self.model.formulas, tuple(self.factors))

    def expand(self) -> RunList:
        """Every point of the run, in order."""
        return with_steps(RunList(self._run_factors(), self._points(), self.seed), self.by_hand)

    def _run_factors(self) -> tuple[Factor, ...]:
        return tuple(
            factor.named(name, {setting[at] for setting in self._settings})
            for at, (name, factor) in enumerate(self.factors.items())
        )

    def _points(self) -> Iterator[Point]:
        order = list(self._visits())
        plotted = self._whole_plots
        sideless = [factor.hard and name not in HEAD_ANGLES for name, factor in self.factors.items()]
        directions = sides([setting for _, _, setting in order], sideless)
        whole_plot, before = 0, None
        for index, ((replication, number, setting), came) in enumerate(zip(order, directions, strict=True)):
            if (replication, number) != before:
                whole_plot, before = whole_plot + 1, (replication, number)
            yield Point(index, replication, whole_plot if plotted else None, setting, came)

    def _visits(self) -> Iterator[tuple[int, int, Setting]]:
        """(replication, whole plot in it, setting) of every point."""
        rng = random.Random(self.seed)
        orders = [factor.order for factor in self.factors.values()]
        hard = [factor.hard for factor in self.factors.values()]
        last: Setting | None = None
        for replication in range(1, self.replications + 1):
            one: Setting | None = None
            plots = self._design.plots
            for number, setting in visits(self._settings, orders, hard, rng, last, plots, steps=self._steps):
                yield replication, number, setting
                one = tuple(value for value, stiff in zip(setting, hard, strict=True) if stiff)
            last = one
