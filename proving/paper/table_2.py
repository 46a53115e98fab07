"""Table 2 from simulated sensors, row by row as the paper has it; and its critical values, which need no data."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from proving.paper import printed
from proving.paper.capture import at_points, temperature_corrected
from proving.paper.plots import PITCH, ROLL, Figure, Line, Panel
from proving.paper.printed import Row
from proving.paper.statement import Statement, digits
from rig.fitter.arrays import FloatArray
from rig.fitter.quantiles import f_limit
from rig.procedures.attitude.data import AttitudeData
from rig.procedures.attitude.designs import Design, fraction, grid, tumble, uniform
from rig.procedures.attitude.fit import AttitudeFit, fit_attitude
from rig.procedures.attitude.model import sigma_deg

SCALE = 1e4
"""Standard errors are in 1e-4 deg, as printed."""


def _fraction(pitch_max_deg: float, pitch_count: int, roll_count: int) -> Design:
    full = grid("D", uniform(-pitch_max_deg, pitch_max_deg, pitch_count), uniform(-180, 180, roll_count))
    return fraction(full, pitch_every=2, roll_every=2)


FRACTION_53, FRACTION_73 = _fraction(30, 5, 13), _fraction(180, 13, 7)
T4, T6 = tumble(roll=False), tumble(roll=True)


@dataclass(frozen=True)
class Experiment:
    """What a row of Table 2 was computed from.

    Attributes:
        figure: of the row.
        night: the calibration, of `NIGHTS`.
        sensor: output.
        corrected: whether what follows the temperature was taken off.
        design: the points used; None for all.

    """

    figure: str
    night: str
    sensor: str
    corrected: bool = True
    design: Design | None = None


EXPERIMENTS = (
    Experiment("22", "no roll, +-36", "aoa_V", corrected=False),
    Experiment("24", "no roll, +-180", "aoa_V", corrected=False),
    Experiment("26", "no roll, +-180", "aoa_V", corrected=False, design=T4),
    Experiment("28(a)", "13 x 25", "sensor_1_V", corrected=False),
    Experiment("28(b)", "13 x 25", "sensor_1_V"),
    Experiment("34", "13 x 25", "sensor_2_V"),
    Experiment("35", "13 x 25", "sensor_1_V", design=FRACTION_53),
    Experiment("37", "25 x 13", "sensor_1_V"),
    Experiment("42", "25 x 13", "sensor_2_V"),
    *(Experiment(f"44({letter})", "19 x 13", f"{axis}_V") for letter, axis in zip("abc", "xyz", strict=True)),
    *(Experiment(f"47({letter})", "37 x 13", f"{axis}_V") for letter, axis in zip("abc", "xyz", strict=True)),
    *(Experiment(f"50 {axis}", "37 x 13", f"{axis}_V", design=T6) for axis in "xyz"),
    *(Experiment(f"53 {axis}", "37 x 13", f"{axis}_V", design=FRACTION_73) for axis in "xyz"),
)
BY_FIGURE = {e.figure: e for e in EXPERIMENTS}
UNDER = {
    "36": ("28(b)", "35"),
    **{f"52 {axis}": (f"47({letter})", f"50 {axis}") for letter, axis in zip("abc", "xyz", strict=True)},
    **{f"54 {axis}": (f"47({letter})", f"53 {axis}") for letter, axis in zip("abc", "xyz", strict=True)},
}
"""Figures of residuals under another fit's coefficients: whose data, whose coefficients."""


class Measured:
    """The captured nights, and their fits as rows need them.

    Args:
        nights: by name.

    """

    def __init__(self, nights: Mapping[str, AttitudeData]) -> None:
        self._raw = nights
        self._corrected: dict[str, AttitudeData] = {}
        self._fits: dict[str, AttitudeFit] = {}

    def figures(self) -> tuple[str, ...]:
        """Rows that can be computed from the nights there are."""
        return tuple(e.figure for e in EXPERIMENTS if e.night in self._raw)

    def data(self, figure: str) -> AttitudeData:
        """The observations behind a row."""
        experiment = BY_FIGURE[figure]
        data = self._raw[experiment.night]
        if experiment.corrected:
            if experiment.night not in self._corrected:
                self._corrected[experiment.night] = temperature_corrected(data)
            data = self._corrected[experiment.night]
        return data if experiment.design is None else at_points(data, experiment.design)

    def fit(self, figure: str) -> AttitudeFit:
        """The calibration of a row."""
        if figure not in self._fits:
            self._fits[figure] = fit_attitude(self.data(figure), BY_FIGURE[figure].sensor)
        return self._fits[figure]

    def residual_deg(self, data_of: str, fit_of: str | None = None) -> FloatArray:
        """(n,) residuals of one row's data under its own coefficients, or under another row's, in deg."""
        data, fit = self.data(data_of), self.fit(fit_of or data_of)
        output = data.outputs[BY_FIGURE[data_of].sensor]
        return np.degrees((output - fit.predict(data.pitch_deg, data.roll_deg)) / fit.parameters.S_V)

    def residual_sd(self, data_of: str, fit_of: str) -> float:
        """Standard deviation of such residuals, 1e-4 deg; over degrees of freedom of the data's own fit."""
        residual = self.residual_deg(data_of, fit_of)
        return SCALE * float(np.sqrt(np.sum(residual**2) / self.fit(data_of).linear.df))

    def row(self, figure: str) -> Row:
        """A row of Table 2."""
        fit = self.fit(figure)
        r, S = fit.replication, fit.parameters.S_V
        e, bias, prec, b, s = (
            SCALE * sigma_deg(v, S) for v in (r.sigma_E, r.sigma_bias, r.sigma_prec, r.sigma_b, r.sigma_S)
        )
        counts = (figure, r.n_points, r.n_replications, len(fit.linear.names))
        tests = (r.bias.value, r.bias.limit_95)
        return Row(*counts, e, bias, prec, *tests, b, s, r.drift_b.value, r.drift_S.value, r.drift_b.limit_95)

    @cached_property
    def rows(self) -> dict[str, Row]:
        """All rows that can be computed, by figure."""
        return {figure: self.row(figure) for figure in self.figures()}


def critical_values() -> tuple[Statement, ...]:
    """Limits of Table 2: F at 95 % on (K - L, K(n - 1)) and on (n - 1, n(K - L)) degrees of freedom."""
    found = []
    for r in printed.TABLE_2:
        K, n, L = r.points, r.replications, r.parameters
        found.append(digits(r.figure, f"limit of T_bias, F({K - L}, {K * (n - 1)})", r.F_bias, bias_limit(r), 2))
    for r in printed.TABLE_2:
        K, n, L = r.points, r.replications, r.parameters
        value, note = f_limit(0.95, n - 1, n * (K - L)), ""
        if round(value, 2) != r.F_bS:
            other = f_limit(0.95, K - L, 3 * K)
            near = abs(other - r.F_bS) < 0.01
            note = (
                f"F({K - L}, {3 * K}) = {other:.3f}, the limit of T_bias for 4 replications"
                if near
                else "not explained"
            )
        found.append(digits(r.figure, f"limit of T_b and T_S, F({n - 1}, {n * (K - L)})", r.F_bS, value, 2, note=note))
    return tuple(found)


def bias_limit(row: Row) -> float:
    """Limit of T_bias of a row."""
    return f_limit(0.95, row.points - row.parameters, row.points * (row.replications - 1))


def identities() -> tuple[Statement, ...]:
    """T_bias of every printed row from its own sigmas: (sigma_bias / sigma_prec)^2 (n - 1) K / (K - L)."""
    found = []
    for r in printed.TABLE_2:
        K, n, L = r.points, r.replications, r.parameters
        of_sigmas = (r.sigma_bias / r.sigma_prec) ** 2 * (n - 1) * K / (K - L)
        off = 100 * (of_sigmas / r.T_bias - 1)
        says = "T_bias = (sigma_bias / sigma_prec)^2 (n - 1) K / (K - L)"
        found.append(
            Statement(r.figure, says, f"{r.T_bias:g}", f"{of_sigmas:.3g}", f"{off:+.1f} %", "within 3 %", abs(off) < 3)
        )
    return tuple(found)


FULL_247 = grid("D", uniform(-90, 90, 19), uniform(-180, 180, 13))
FRACTION_139 = fraction(FULL_247, pitch_every=3, roll_every=4)


def figure_21() -> Figure:
    """As plots."""
    panels = (_panel("(a) full, 19 x 13", FULL_247), _panel("(b) fraction, K_a = 3, K_R = 4", FRACTION_139))
    return Figure("21", "Experimental designs", panels)


def statements_21() -> tuple[Statement, ...]:
    """Numbers of points."""
    return (
        digits("21(a)", "points of the full design", 247, len(FULL_247), 0),
        digits("21(b)", "points of its fraction, eq. (109)", 139, len(FRACTION_139), 0),
        digits("9.2.2", "points of 5 x 13, K_a = K_R = 2", 53, len(FRACTION_53), 0,
               note="steps of 15 and 30 deg; the text's 3 deg for the former step of pitch is 5 deg"),
        digits("9.3.4", "points of 13 x 7, K_a = K_R = 2", 73, len(FRACTION_73), 0),
    )  # fmt: skip


def _panel(title: str, design: Design) -> Panel:
    pitch, roll = np.array(design.points_deg()).T
    return Panel(f"{title}: {len(design)} points", PITCH, ROLL, (Line(pitch, roll, "", "."),))
