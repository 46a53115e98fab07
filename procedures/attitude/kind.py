"""What the program asks of the kind "pitch-roll"."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from procedures.advice import Advice
from procedures.attitude.settings import PitchRollProcedure
from procedures.further_runs import Limits, Variation
from procedures.precision import Precision
from procedures.run_list import RunList


class AttitudeKind:
    """Inertial attitude sensors on a dividing head. See `procedures.kind.Kind`."""

    name = "pitch-roll"
    settings = PitchRollProcedure

    def check_design(self, procedure: PitchRollProcedure, run_list: RunList) -> None:
        """Any design will do: `precision` says where it determines nothing."""

    def precision(self, procedure: PitchRollProcedure, run_list: RunList) -> Precision:
        """Of a sensor's calibrated output at a few pitch angles."""
        from procedures.attitude.precision import precision  # noqa: PLC0415

        return precision(procedure, run_list)

    def advice(self, procedure: PitchRollProcedure, axes: Sequence[str], usage_deg: float | None) -> Sequence[Advice]:
        """What NASA/TP-1999-209835 recommends."""
        from procedures.attitude.advice import advise, package_of, usage_of  # noqa: PLC0415

        found = advise(procedure, usage_of(procedure, usage_deg), package_of(procedure, axes))
        return [one for one in found if one.applies]

    def further_runs(self, procedure: PitchRollProcedure, limits: Limits, *, chamber: bool) -> Iterator[Variation]:
        """See `Kind`."""
        from procedures.attitude.further_runs import further_runs  # noqa: PLC0415

        return further_runs(procedure, limits, chamber=chamber)


KIND = AttitudeKind()
