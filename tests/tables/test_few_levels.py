"""Settings of a few levels whose values were read finely: nothing finer than the levels is seen over them."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from rig.procedures.general.effects.columns import wave
from rig.procedures.general.effects.scene import TableScene, at_levels
from rig.procedures.general.trace.parts import _shapes
from rig.procedures.general.trace.places import places_of

LEVELS = np.repeat([0.0, 50.0, 100.0, 150.0, 200.0], 18)
READ = LEVELS + np.random.default_rng(1).normal(0.0, 0.02, LEVELS.size)


def test_values_that_scatter_about_levels_are_the_levels():
    found = at_levels(READ)
    assert np.unique(found).size == 5
    np.testing.assert_allclose(found, LEVELS, atol=0.02)


@pytest.mark.parametrize("v", [LEVELS, np.linspace(0.0, 1.0, 90), np.random.default_rng(2).uniform(0.0, 1.0, 1000)])
def test_levels_without_scatter_and_settings_without_levels_stay_as_they_are(v):
    assert at_levels(v) is v


def test_over_five_levels_there_are_four_waves_and_no_period():
    side = np.tile([1.0, -1.0], LEVELS.size // 2)
    scene = TableScene({"torque_Nm": READ}, {}, {}, None, ("torque_side", side))
    places = places_of(scene, None)
    over = next(place for place in places if place.block.place == "over torque_Nm")
    assert over.block.columns.shape == (READ.size, 4)
    nameless = SimpleNamespace(data=SimpleNamespace(scene=scene), places=places)
    part = SimpleNamespace(variable="torque_side", rows=side < 0)
    found = [block.place for block in _shapes(nameless, part)]
    assert found
    assert not any("periodic" in place for place in found)


@pytest.mark.parametrize("scatter", [0.0, 2e-4, 2e-3, 6e-3])
def test_no_period_is_as_short_as_the_steps_between_the_levels_that_a_standard_reads(scatter):
    """Read with noise, nine levels counted as a hundred: a period of one step was named in every sensor."""
    rng = np.random.default_rng(1)
    levels = np.repeat([0.62, 1.18, 1.73, 2.28, 2.82, 3.35, 3.88, 4.39, 4.9], 11)
    read = levels + scatter * rng.standard_normal(levels.size).clip(-2.5, 2.5)
    scene = TableScene({"flow_kg_per_min": read}, {}, {}, None, None)
    assert list(wave(scene, "flow_kg_per_min")) == []
