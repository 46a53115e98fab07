"""Whole-plot data: identities, sides of approach, clocks; what is refused."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from proving.truth.pressure import HOMOSCEDASTIC, simulate
from rig.procedures.pressure.data import WholePlotData
from rig.procedures.pressure.effects.scene import PressureScene
from rig.procedures.pressure.table import whole_plot_data
from rig.procedures.tables.table import Table


def rows(**changes):
    base = {
        "whole_plot": [7, 7, 7, 7, 3, 3, 3],
        "order": [0, 1, 2, 3, 4, 5, 6],
        "elapsed_s": [100.0, 200.0, 310.0, 420.0, 5000.0, 5100.0, 5200.0],
        "pressure_psia": [1.0, 5.0, 5.001, 0.12, 2.5, 0.01, 4.0],
        "sensor_temperature_degC": [-90.0] * 7,
        "sse_temperature_degC": [0.0] * 7,
        "outputs": {"bridge_mV": np.arange(7.0)},
    }
    return WholePlotData(**(base | changes))


def test_what_the_order_tells():
    data = rows()
    np.testing.assert_array_equal(data.pressure_side, [0, 1, 1, -1, 0, -1, 1])
    np.testing.assert_array_equal(data.previous_pressure_psia, [np.nan, 1.0, 5.0, 5.001, np.nan, 2.5, 0.01])
    np.testing.assert_array_equal(data.position, [0, 1, 2, 3, 0, 1, 2])
    np.testing.assert_array_equal(data.since_s, [0, 100, 210, 320, 0, 100, 200])
    np.testing.assert_array_equal(data.whole_plots, [3, 7])
    np.testing.assert_array_equal(data.whole_plot_index, [1, 1, 1, 1, 0, 0, 0])
    levels, level = data.pressure_levels
    np.testing.assert_allclose(levels, [0.01, 0.12, 1.0, 2.5, 4.0, 5.0005])
    np.testing.assert_array_equal(level, [2, 5, 5, 1, 3, 0, 4])
    np.testing.assert_array_equal(rows(pressure_set_psia=[1, 5, 5, 0.12, 2.5, 0.01, 4]).pressure_levels[0][-1], 5.0)


def test_a_table_says_from_what_the_first_pressure_of_a_whole_plot_was_set():
    """The first row of a whole plot came from the pressure of its soak, 14.7 psi off, and was taken to be at rest."""
    names = ("whole_plot", "order", "elapsed_s", "pressure_psia", "sensor_temperature_degC", "sse_temperature_degC")
    plain = rows()
    columns = {name: np.asarray(getattr(plain, name), float) for name in names} | {"bridge_mV": np.arange(7.0)}
    columns["pressure_from_psia"] = np.array([14.7, 1.0, 5.0, 5.0, 0.12, 2.5, np.nan])
    data = whole_plot_data(Table("t.csv", columns, simulated=True, provenance={}))
    np.testing.assert_array_equal(data.previous_pressure_psia, [14.7, 1.0, 5.0, 5.001, 0.12, 2.5, 0.01])
    scene = PressureScene(data, 0.0, 0.0, 0.0, 0.0, {}, {})
    np.testing.assert_allclose(scene.change_psia[[0, 4]], [1.0 - 14.7, 2.5 - 0.12])
    left = np.exp(-scene.waited_h[0] / 0.05)
    np.testing.assert_allclose(scene.behind(0.05)[[0, 4]], [13.7 * left, -2.38 * left])


def test_a_table_says_from_which_side_a_pressure_was_approached():
    """A run leaves a repeated pressure upwards and sets it again, and knows how the first one was reached: a hysteresis
    of the wrong sign in these rows was named carry-over, and a whole plot an outlier.
    """
    names = ("whole_plot", "order", "elapsed_s", "pressure_psia", "sensor_temperature_degC", "sse_temperature_degC")
    plain = rows()
    columns = {name: np.asarray(getattr(plain, name), float) for name in names} | {"bridge_mV": np.arange(7.0)}
    columns["pressure_side"] = np.array([-1.0, 1.0, -1.0, -1.0, 0.0, -1.0, 1.0])
    data = whole_plot_data(Table("t.csv", columns, simulated=True, provenance={}))
    np.testing.assert_array_equal(data.pressure_side, [-1, 1, -1, -1, 0, -1, 1])


def test_a_whole_plot_that_was_continued_later_has_its_own_history():
    data = rows(whole_plot=[7, 7, 3, 3, 7, 7, 3])
    np.testing.assert_array_equal(data.previous_pressure_psia, [np.nan, 1.0, np.nan, 5.001, 5.0, 2.5, 0.12])


@given(st.permutations(range(7)), st.sets(st.integers(0, 6), min_size=1))
def test_nothing_depends_on_the_order_of_rows_or_on_what_is_taken(mixed, some):
    data = rows()
    shuffled = rows(
        **{
            name: np.asarray(getattr(data, name))[mixed]
            for name in ("whole_plot", "order", "elapsed_s", "pressure_psia")
        },
        outputs={"bridge_mV": np.array(mixed, float)},
    )
    taken = shuffled.take(np.array(sorted(some)))
    for name in ("pressure_side", "previous_pressure_psia", "position", "since_s"):
        np.testing.assert_array_equal(getattr(shuffled, name), getattr(data, name)[mixed])
        np.testing.assert_array_equal(getattr(taken, name), getattr(shuffled, name)[sorted(some)])


def test_formulas_see_the_columns_by_their_names_and_the_papers():
    data, _ = simulate(HOMOSCEDASTIC, 0)
    np.testing.assert_array_equal(data.table["P"], data.pressure_psia)
    np.testing.assert_array_equal(data.table["T_sensor"], data.table["sensor_temperature_degC"])
    np.testing.assert_array_equal(data.table["T_SSE"], data.sse_temperature_degC)
    assert data.transducers == ("bridge_mV",)
    assert all(len(column) == 220 for column in data.table.values())


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"order": [0] * 7}, "two observations have the same executed position"),
        ({"whole_plot": [1.5] * 7}, "whole_plot: row 0 holds 1.5, not a whole number"),
        ({"pressure_psia": [np.nan] * 7}, "pressure_psia: row 0 holds nan, not a finite number"),
        ({"outputs": {"bridge_mV": [1.0] * 6}}, "bridge_mV: expected 7 values"),
        ({"outputs": {}}, "no transducer output"),
        ({"replicate": [1, 1, 2, 2, 3, 3, 3]}, "whole plot 7 is in two replications"),
        ({"order": []}, "no observations"),
        ({"sse_set_degC": [0.0, np.inf] + [0.0] * 5}, "sse_set_degC: row 1 holds inf"),
    ],
)
def test_what_is_refused(changes, message):
    with pytest.raises(ValueError, match=message):
        rows(**changes)
