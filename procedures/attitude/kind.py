"""What the program asks of the kind "pitch-roll"."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Sequence
from functools import cached_property

from fitter.effects.own import Grammar
from procedures.acceptance import Verdict
from procedures.advice import Advice
from procedures.attitude.settings import PitchRollProcedure
from procedures.further_runs import Limits, Variation
from procedures.precision import Precision
from procedures.run_list import RunList
from procedures.table import Table


class AttitudeKind:
    """Inertial attitude sensors on a dividing head. See `procedures.kind.Kind`."""

    name = "pitch-roll"
    settings = PitchRollProcedure

    @cached_property
    def own_effects(self) -> Grammar:
        """See `Kind`."""
        from procedures.attitude.effects.own import GRAMMAR  # noqa: PLC0415

        return GRAMMAR

    def recognises(self, columns: Collection[str]) -> bool:
        """By columns that no other kind has."""
        return bool({"pitch_deg", "roll_deg"} & set(columns))

    def check_design(self, procedure: PitchRollProcedure, run_list: RunList) -> None:
        """Any design will do: `precision` says where it determines nothing."""

    def precision(self, procedure: PitchRollProcedure, run_list: RunList) -> Precision:
        """Of a sensor's calibrated output at a few pitch angles."""
        from procedures.attitude.precision import precision

        return precision(procedure, run_list)

    def advice(self, procedure: PitchRollProcedure, axes: Sequence[str], usage_deg: float | None) -> Sequence[Advice]:
        """What NASA/TP-1999-209835 recommends."""
        from procedures.attitude.advice import advise, package_of, usage_of

        found = advise(procedure, usage_of(procedure, usage_deg), package_of(procedure, axes))
        return [one for one in found if one.applies]

    def judge(self, procedure: PitchRollProcedure, table: Table) -> Sequence[Verdict]:
        """See `Kind`."""
        from procedures.attitude.acceptance import judge  # noqa: PLC0415

        return judge(procedure, table)

    def further_runs(self, procedure: PitchRollProcedure, limits: Limits, *, chamber: bool) -> Iterator[Variation]:
        """See `Kind`."""
        from procedures.attitude.further_runs import further_runs

        return further_runs(procedure, limits, chamber=chamber)


KIND = AttitudeKind()
