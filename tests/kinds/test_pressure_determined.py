"""A model that the design does not determine is refused, although readbacks scatter; a zero that has moved is said."""

from __future__ import annotations

import numpy as np
import pytest

from rig.fitter import RankError
from rig.procedures.pressure.data import WholePlotData
from rig.procedures.pressure.fit import fit_pressure
from rig.procedures.pressure.infer import Zero, infer_pressure

PRESSURES = (0.05, 0.5, 1.0, 2.5, 5.0)
WHOLE_PLOT_MV, SUBPLOT_MV = 0.012, 0.002


def calibration(pairs, seed, *, given=False):
    """A run over pairs of temperatures with readbacks that scatter; truth is of first order in everything."""
    rng = np.random.default_rng(seed)
    sensor, sse = (np.repeat([pair[i] for pair in pairs], len(PRESSURES)).astype(float) for i in (0, 1))
    count = len(sensor)
    whole_plot = np.repeat(np.arange(len(pairs)), len(PRESSURES))
    pressure = np.tile(PRESSURES, len(pairs))
    output = 0.4 + 2.0 * pressure + 1e-3 * sensor - 4e-4 * sse
    output = output + rng.normal(0, WHOLE_PLOT_MV, len(pairs))[whole_plot] + rng.normal(0, SUBPLOT_MV, count)
    settings = {"sensor_set_degC": sensor, "sse_set_degC": sse} if given else {}
    return WholePlotData(
        whole_plot=whole_plot,
        order=np.arange(count),
        elapsed_s=np.arange(count) * 300.0,
        pressure_psia=pressure + rng.normal(0, 2e-4, count),
        sensor_temperature_degC=sensor + rng.normal(0, 0.05, count),
        sse_temperature_degC=sse + rng.normal(0, 0.05, count),
        outputs={"bridge_mV": output},
        **settings,
    )


@pytest.mark.parametrize("given", [False, True])
@pytest.mark.parametrize(
    ("pairs", "model"),
    [
        (3 * [(-10, 0), (0, 10), (10, 0)], "full"),
        (2 * [(-20, 0), (-10, 10), (0, 20), (10, 30), (20, 40)], "1 + P + T_sensor + T_SSE"),
        (3 * [(-10, 0), (10, 0)], "1 + P + T_sensor + T_sensor^2"),
    ],
)
def test_scatter_of_readbacks_does_not_determine_a_model(pairs, model, given):
    with pytest.raises(RankError, match="pairs of temperatures and 5 pressures that were set; fit a smaller model"):
        fit_pressure(calibration(pairs, seed=1, given=given), "bridge_mV", model)


def test_what_the_design_determines_is_fitted():
    pairs = 2 * [(-20, 0), (20, 0), (0, -20), (0, 20), (0, 0), (20, 20)]
    fit = fit_pressure(calibration(pairs, seed=2), "bridge_mV", "1 + P + T_sensor + T_SSE")
    assert fit.reml.coefficients[1] == pytest.approx(2.0, abs=0.003)


def test_a_zero_at_other_temperatures_is_flagged_and_its_interval_covers():
    """Ten flights on each of 100 calibrations: the zero at one temperature, the reading at another, each with its own
    whole-plot error. Coverage differs by 0.04 between calibrations, so that 0.03 is 3.8 standard errors of the mean.
    """
    pairs = 3 * [(-20, 0), (20, 0), (0, -20), (0, 20), (0, 0), (20, 20)]
    inside, calibrations, flights = 0, 100, 10
    for seed in range(calibrations):
        print(f"seed {seed}")
        rng = np.random.default_rng(100 + seed)
        kept = fit_pressure(calibration(pairs, seed), "bridge_mV", "1 + P + T_sensor + T_SSE").calibration()
        for _ in range(flights):
            errors = rng.normal(0, WHOLE_PLOT_MV, 2) + rng.normal(0, SUBPLOT_MV, 2)
            zero = Zero(0.4 + 1e-3 * 15 - 4e-4 * 5 + errors[0], 15.0, 5.0)
            reading = 0.4 + 2.0 * 1.0 + 1e-3 * -10 - 4e-4 * -5 + errors[1]
            found = infer_pressure(kept, [reading], -10.0, -5.0, zero)
            assert found.flag[0].startswith("temperatures are not those of the zero")
            inside += found.lo95_psia[0] <= 1.0 <= found.hi95_psia[0]
    assert 0.92 < inside / (calibrations * flights) < 0.98
