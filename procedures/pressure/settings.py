"""The whole-plot procedure: `procedure.toml` with `kind = "whole-plot"`, checked and expanded to a run list.

Temperatures are hard to change and constant in a whole plot; pressures are randomised inside it. The default design is
that of the MEADS pressure transducers (McCollum, Commo and Parker, section II.B): 20 whole plots of 11 pressures. It is
also the reference of the file format: `rig explain procedure` prints it.
"""

from __future__ import annotations

import itertools
import random
from collections.abc import Iterator, Mapping
from math import sqrt
from types import MappingProxyType
from typing import Annotated, ClassVar, Literal, Self

from pydantic import Field, field_validator, model_validator

from rig.procedures.plan.by_hand import Steps, check_places, with_steps
from rig.procedures.plan.conduct import Conduct, SoakSettings, WholePlotConduct
from rig.procedures.plan.fault_policies import ABORT, HOLD, RE_SOAK, RETRY, SKIP, FaultSettings, Policy
from rig.procedures.plan.run_list import Factor, Point, RunList, Settle
from rig.procedures.plan.settings import Acceptance, GoalSettings, LoopSettings, Name, Positive, Strict, WarningSettings

PRESSURE, SENSOR, SSE = "pressure_psia", "sensor_temperature_degC", "sse_temperature_degC"

FACTORS = (PRESSURE, SENSOR, SSE)
"""The factors of the paper, and no others: a further one, such as humidity, is a table of the kind "general"."""

FULL = "full"
"""The full second order, the default model of a procedure."""
MOST_POINTS = 100_000
"""Maximum length of a run list: at a minute per point it would take ten weeks."""

LEAST_HALF_RANGE_DEGC = 1e-3
"""Minimum step of a temperature: no chamber sets and no thermometer reads a smaller one."""

_ORDERS_TRIED = 10_000

Pressure = Annotated[float, Field(ge=0, le=1e4)]
Temperature = Annotated[float, Field(ge=-273.15, le=1000)]
Times = Annotated[int, Field(ge=0, le=100)]


class RangeSettings(Strict):
    """Range of one temperature."""

    centre_degC: Temperature
    half_range_degC: Positive = Field(description="from the centre to either extreme")

    @field_validator("half_range_degC", mode="before")
    @classmethod
    def _leaves_something_to_vary(cls, value: object) -> object:
        if isinstance(value, int | float) and 0 <= value < LEAST_HALF_RANGE_DEGC:
            raise ValueError(
                "both extremes would be the centre, and nothing of this temperature could be estimated; give half of "
                "the range to be calibrated"
            )
        return value

    def at(self, coded: float) -> float:
        """Temperature of a coded level between -1 and 1, degrees Celsius."""
        return round(self.centre_degC + coded * self.half_range_degC, 6)


def spherical(factorial: int, axial_first: int, axial_second: int, centre: int) -> list[tuple[float, float]]:
    """Spherical central composite design in two coded factors: every outer point at distance 1 from the centre.

    Args:
        factorial: number of repeats of each of the four factorial points.
        axial_first: number of repeats of each of the two axial points of the first factor.
        axial_second: the same for the second factor.
        centre: number of repeats of the centre.

    Returns:
        Coded pairs; -1 and 1 are a factor's extremes, which its axial points reach (Myers and Montgomery, Response
        Surface Methodology, chapter 7, with axial distance sqrt(2) scaled to 1).
    """
    c = sqrt(0.5)
    corners = [(x, y) for x in (-c, c) for y in (-c, c)]
    first, second = [(-1.0, 0.0), (1.0, 0.0)], [(0.0, -1.0), (0.0, 1.0)]
    return factorial * corners + axial_first * first + axial_second * second + centre * [(0.0, 0.0)]


class WholePlotDesign(Strict):
    """Temperatures of the whole plots, and pressures at each."""

    type: Literal["central-composite", "list"] = Field(
        "central-composite",
        description="central-composite: spherical, in the two temperatures; list: the pairs in `temperatures_degC`",
    )
    sensor_temperature: RangeSettings = RangeSettings(centre_degC=-90.0, half_range_degC=40.0)
    sse_temperature: RangeSettings = RangeSettings(centre_degC=0.0, half_range_degC=40.0)
    factorial: Times = Field(2, description="central-composite: number of visits to each of the four factorial points")
    axial_sensor: Times = Field(2, description="... each extreme along the sensor temperature")
    axial_sse: Times = Field(1, description="... each extreme along the SSE temperature")
    centre: Times = Field(6, description="... the centre")
    temperatures_degC: list[tuple[Temperature, Temperature]] | None = Field(
        None, description="list: (sensor, SSE) of every whole plot, repeated ones as often as they are to be visited"
    )
    pressures_psia: list[Pressure] = Field([0.01, 0.12, 0.50, 0.79, 1.00, 2.50, 4.00, 5.00], min_length=1)
    repeated_psia: list[Pressure] = Field(
        [0.01, 2.50, 5.00], description="those of them that are set once more in every whole plot"
    )

    @model_validator(mode="after")
    def _can_be_built(self) -> Self:
        if (self.temperatures_degC is not None) != (self.type == "list"):
            needs = "needs temperatures_degC" if self.type == "list" else "does not use temperatures_degC"
            raise ValueError(f"design {self.type} {needs}")
        if not self.pairs():
            raise ValueError("the design has no whole plots")
        if len(set(self.pressures_psia)) != len(self.pressures_psia):
            raise ValueError("pressures_psia has a pressure twice; repeats go into repeated_psia")
        strange = [p for p in self.repeated_psia if p not in self.pressures_psia]
        if strange:
            raise ValueError(f"repeated_psia names {strange[0]:g} psia, which is not in pressures_psia")
        return self

    def pairs(self) -> list[tuple[float, float]]:
        """(sensor, SSE) temperature of every whole plot of one replication, degrees Celsius, in standard order."""
        if self.temperatures_degC is not None:
            return list(self.temperatures_degC)
        coded = spherical(self.factorial, self.axial_sensor, self.axial_sse, self.centre)
        return [(self.sensor_temperature.at(x), self.sse_temperature.at(y)) for x, y in coded]


class PressureApproach(Strict):
    """Approach of a pressure from its planned side."""

    overtravel_psia: Positive = Field(
        0.05,
        le=1e4,
        description="if a pressure follows itself, the controller leaves it by this much and sets it again",
    )


class PressureSettle(Strict):
    """Criterion for reaching a pressure."""

    band_psia: Positive = Field(0.002, description="reading within this of the setpoint")
    dwell_s: float = Field(15.0, ge=0, le=1e6, description="for this long")
    drift_psia_per_s: Positive = Field(0.0002, description="and drifting slower than this")
    poll_s: Positive = Field(2.0, le=60, description="time between readbacks")
    timeout_s: Positive = Field(900.0, description="then the settling has failed")

    def judged(self) -> Settle:
        """Judgement of a settled pressure for the sequencer."""
        return Settle(self.band_psia, self.dwell_s, self.drift_psia_per_s, self.timeout_s)


class WholePlotMeasure(Strict):
    """Measurement at a point."""

    readings: int = Field(5, ge=1, le=50_000, description="sweeps over all channels; their mean is the observation")
    max_sd_mV: Positive | None = Field(None, description="noisier than this: read again")
    repeats: int = Field(
        2,
        ge=0,
        le=10,
        description="maximum number of repeated readings; after them the reading is accepted and flagged",
    )


class WholePlotRecovery(Strict):
    """Handling of interruptions. A whole plot that may not continue is measured again under a new identity."""

    continue_gap_s: float = Field(
        600.0,
        ge=0,
        le=1e6,
        description="a whole plot left alone for longer is not continued, whatever it "
        "reads; one that is looked at while a person is waited for is not left alone",
    )
    hold_max_s: Positive = Field(
        12 * 3600.0, description="a hold that is not released ends the session after this time"
    )
    whole_plot_repeats: int = Field(
        2, ge=0, le=20, description="how often a whole plot may be measured again in one session because it was lost"
    )


class WholePlotModel(Strict):
    """The declared model of every transducer, for plan, fit, trace and acceptance. It is stored in the run file."""

    formula: str | None = Field(
        None,
        description="full (second order in pressure and both temperatures), II.C, eq10, hierarchical, or a formula "
        "such as `1 + P + P^2`; a design that cannot estimate it is refused. Left out: full",
    )


class WholePlotExpect(Strict):
    """Expected properties of the transducers; used by `rig plan` and never by a fit."""

    sigma_wholeplot_mV: Positive = Field(
        0.0125, description="sd of the error that is new at every change of temperature"
    )
    sigma_subplot_mV: Positive = Field(0.004, description="sd of one observation inside a whole plot")
    sensitivity_mV_per_psi: Positive = Field(2.0)
    model: str | None = Field(
        None, description="the declared model as procedures before `[model]` have it; write `[model]` formula instead"
    )


def declared_model(formula: str | None, expected: str | None) -> str:
    """The declared model, from `[model]` formula and `[expect]` model; by default the full second order."""
    return formula or expected or FULL


class WholePlotAcceptance(Acceptance):
    """Acceptance limits of a finished calibration; outside them `rig run` ends with exit code 3."""

    reading_error_pct: Positive | None = Field(
        None,
        description="largest reading error in use with in-flight zero + WLS, including the error of the zero",
    )
    at_psia: Pressure = Field(0.12, description="at this pressure")

    @property
    def limited(self) -> bool:
        """Whether a limit is set; the pressure is not a limit."""
        return self.reading_error_pct is not None


def square_of_pressure(given: Mapping[str, float]) -> tuple[float, ...]:
    """One, pressure and its square; offsets differ between temperatures."""
    psia = given[PRESSURE]
    return (1.0, psia, psia**2)


class WholePlotFaults(FaultSettings):
    """Policies for faults: steps for each class of fault; see docs/how_to/policies.md."""

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


class WholePlotProcedure(Strict):
    """A whole `procedure.toml` of kind whole-plot."""

    kind: Literal["whole-plot"]
    name: Name
    seed: int = Field(0, ge=0, le=2**63 - 1, description="seed of every random choice in the order")
    replications: int = Field(1, ge=1, le=1000, description="blocks; each visits every whole plot, in its own order")
    design: WholePlotDesign = WholePlotDesign()
    soak: SoakSettings = SoakSettings()
    approach: PressureApproach = PressureApproach()
    settle: PressureSettle = PressureSettle()
    measure: WholePlotMeasure = WholePlotMeasure()
    recovery: WholePlotRecovery = WholePlotRecovery()
    faults: WholePlotFaults = WholePlotFaults()
    warnings: WarningSettings = WarningSettings()
    model: WholePlotModel = WholePlotModel()
    expect: WholePlotExpect = WholePlotExpect()
    acceptance: WholePlotAcceptance = WholePlotAcceptance()
    by_hand: Steps = ()
    loop: LoopSettings = LoopSettings()
    goal: GoalSettings | None = None

    @model_validator(mode="after")
    def _can_be_run(self) -> Self:
        design = self.design
        per_plot = len(design.pressures_psia) + len(design.repeated_psia)
        points = self.replications * len(design.pairs()) * per_plot
        if points > MOST_POINTS:
            raise ValueError(f"the design has {points} points, more than {MOST_POINTS}")
        plots = self.replications * len(design.pairs())
        check_places(self.by_hand, points=points, replications=self.replications, whole_plots=plots)
        if self.approach.overtravel_psia <= 2.0 * self.settle.band_psia:
            raise ValueError(
                f"approach.overtravel_psia = {self.approach.overtravel_psia:g} must be more than twice "
                f"settle.band_psia = {self.settle.band_psia:g}, or a pressure would not be left"
            )
        return self

    @model_validator(mode="after")
    def _one_model_is_declared(self) -> Self:
        declared, expected = self.model.formula, self.expect.model
        if declared is not None and expected is not None and declared != expected:
            raise ValueError(
                f"model.formula = {declared!r} and expect.model = {expected!r} are two models; what is planned and "
                "fitted is one: leave expect.model out"
            )
        return self

    @property
    def declared_model(self) -> str:
        """The model for plan, fit, trace and acceptance."""
        return declared_model(self.model.formula, self.expect.model)

    @model_validator(mode="after")
    def _acceptance_can_be_judged(self) -> Self:
        at = self.acceptance.at_psia
        measured = self.design.pressures_psia
        if self.acceptance.reading_error_pct is not None and at not in measured:
            known = ", ".join(f"{p:g}" for p in measured)
            raise ValueError(f"acceptance.at_psia = {at:g} is no pressure of the design ({known})")
        return self

    @property
    def conduct(self) -> Conduct:
        """Execution of the run."""
        most_mV, recovery = self.measure.max_sd_mV, self.recovery
        return Conduct(
            settle=self.settle.judged(),
            poll_s=self.settle.poll_s,
            readings=self.measure.readings,
            repeats=self.measure.repeats,
            max_sd_V=None if most_mV is None else most_mV / 1e3,
            faults=self.faults,
            warnings=self.warnings,
            hold_max_s=recovery.hold_max_s,
            output_unit="mV",
            sensor_axes=False,
            response=square_of_pressure,
            whole_plots=WholePlotConduct(
                soak=self.soak, continue_gap_s=recovery.continue_gap_s, repeats=recovery.whole_plot_repeats
            ),
        )

    def expand(self) -> RunList:
        """Every point of the run, in order.

        Whole plots are in random order in each replication, without equal temperatures in succession; pressures are in
        random order in each whole plot.
        """
        factors = (
            Factor(PRESSURE, "pressure", self.approach.overtravel_psia, stays=False),
            Factor(SENSOR, "sensor_temperature", hard=True),
            Factor(SSE, "sse_temperature", hard=True),
        )
        return with_steps(RunList(factors, self._points(), self.seed), self.by_hand)

    def _points(self) -> Iterator[Point]:
        rng = random.Random(self.seed)
        index = whole_plot = 0
        before: tuple[float, float] | None = None
        last: float | None = None
        for replication in range(1, self.replications + 1):
            for pair in _apart(self.design.pairs(), rng, before):
                whole_plot += 1
                before = pair
                pressures = [*self.design.pressures_psia, *self.design.repeated_psia]
                rng.shuffle(pressures)
                for pressure, side in zip(pressures, _sides(pressures, last), strict=True):
                    yield Point(index, replication, whole_plot, (pressure, *pair), (side, 0, 0))
                    index += 1
                last = pressures[-1]


def _apart(
    pairs: list[tuple[float, float]], rng: random.Random, before: tuple[float, ...] | None
) -> list[tuple[float, float]]:
    """Pairs in random order, without equal pairs in succession: unchanged temperatures do not draw a new error.

    Args:
        pairs: temperatures of the whole plots.
        rng: random generator.
        before: temperatures of the previous whole plot.

    Returns:
        Every such order with the same probability. If there is hardly one, or none, the last tried order; the sequencer
        then leaves an unchanged temperature and returns to it.
    """
    for _ in range(_ORDERS_TRIED):
        rng.shuffle(pairs)
        if all(a != b for a, b in itertools.pairwise([before, *pairs])):
            break
    return pairs


def _sides(pressures: list[float], last: float | None) -> list[int]:
    """Side of approach of each pressure of a whole plot: from the previous one; the first from any side.

    A repeated pressure is left towards higher pressure and set again, so that its two readings are two settings and the
    line never has to go below its lowest level. The same is done for a first pressure equal to the last of the previous
    whole plot: the line stays there while the temperatures change, and two whole plots would share the error of one
    setting.

    Args:
        pressures: in order.
        last: last pressure of the previous whole plot; None if there is none.
    """
    sides = [-1 if pressures[0] == last else 0]
    sides += [1 if now > before else -1 for before, now in itertools.pairwise(pressures)]
    return sides
