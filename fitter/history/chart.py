"""All statistics of one sensor over its calibrations."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from rig.fitter.arrays import FloatArray
from rig.fitter.history.charted import Charted
from rig.fitter.history.control_limits import Limits, limits
from rig.fitter.history.forecast import ErrorBound, error_bound
from rig.fitter.history.homogeneity import Homogeneity, homogeneity
from rig.fitter.history.series import Series
from rig.fitter.history.step import Step, step
from rig.fitter.history.trend import Trend, trend

LEVEL = 0.05


@dataclass(frozen=True, eq=False)
class QuantityChart:
    """One parameter.

    Attributes:
        name: with its unit.
        series: its values.
        homogeneity: test of differences between calibrations beyond their own error.
        trend: test of drift; None below three calibrations.
        step: test of a step; None below four.
        limits: of the chart; None below three.
        adjusted: p of each test ("homogeneity", "trend", "step"), adjusted for the other parameters of the sensor.
    """

    name: str
    series: Series
    homogeneity: Homogeneity
    trend: Trend | None
    step: Step | None
    limits: Limits | None
    adjusted: dict[str, float]

    def significant(self, test: str) -> bool:
        """Whether a test is significant at 5 %, over all parameters of the sensor."""
        return self.adjusted.get(test, 1.0) < LEVEL

    @property
    def steady(self) -> bool:
        """Whether it drifts more steadily than a random walk."""
        return self.significant("trend") and self.trend is not None and self.trend.p_walk < LEVEL

    @property
    def stepped(self) -> bool:
        """Whether there is a step that explains more than a steady drift does."""
        if not self.significant("step") or self.step is None or self.trend is None:
            return False
        return not self.significant("trend") or self.step.explained > self.trend.explained


@dataclass(frozen=True, eq=False)
class Chart:
    """One sensor.

    Attributes:
        quantities: by parameter.
        bound: on the error of the last calibration over its age; None below three calibrations.
    """

    quantities: tuple[QuantityChart, ...]
    bound: ErrorBound | None

    @property
    def changed(self) -> bool:
        """Whether any test of any parameter is significant."""
        return any(q.significant(test) for q in self.quantities for test in q.adjusted)


def chart(charted: Charted, rows: FloatArray) -> Chart:
    """Test every parameter, and bound the error of the last calibration's output.

    Args:
        charted: q parameters of a sensor.
        rows: (H, q) derivative of the output by each parameter, at H places of the range of use.
    """
    series = charted.series
    tests = [(homogeneity(s), trend(s), step(s)) for s in series]
    adjusted: list[dict[str, float]] = [{} for _ in series]
    for i, test in enumerate(("homogeneity", "trend", "step")):
        found = [each[i] for each in tests]
        p = [each.p for each in found if each is not None]
        if len(p) == len(found):
            for one, value in zip(adjusted, holm(p), strict=True):
                one[test] = value
    return Chart(
        tuple(
            QuantityChart(name, one, *three, limits(one), p)
            for name, one, three, p in zip(charted.names, series, tests, adjusted, strict=True)
        ),
        error_bound(charted, rows),
    )


def holm(p: Sequence[float]) -> list[float]:
    """Probabilities adjusted for several tests (Holm, Scand. J. Statist. 6, 65, 1979)."""
    adjusted, largest = [0.0] * len(p), 0.0
    for rank, i in enumerate(sorted(range(len(p)), key=lambda i: p[i])):
        largest = max(largest, min(1.0, (len(p) - rank) * p[i]))
        adjusted[i] = largest
    return adjusted
