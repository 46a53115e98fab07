"""What a setting leaves behind where the declared model has that setting in curves only: at rest it is nothing.

The world is a hot wire by King's law (Phil. Trans. A 214 (1914) 373), whose reading goes on for minutes after every
change of the speed. Until November 2026 the catalogue's lag was the late setting itself, a straight line at rest, which
that law has not: the trace named other effects, and results were up to 4.2 expanded uncertainties wrong.
"""

from __future__ import annotations

import numpy as np
import pytest

from proving.statistics.coverage_effects import FORCES, _general
from proving.truth.stands import METERS, stand
from rig.procedures.general.column_roles import Roles, roles_of
from rig.procedures.general.trace import trace_general
from rig.procedures.tables.table import Table

WIRE = "hot-wire anemometer"


@pytest.mark.parametrize("seed", [5005, 5001, 5007, 5010])
def test_results_at_rest_hold_where_the_reading_creeps(seed):
    assert max(map(abs, _general(seed, "creep", WIRE)["traced"])) < 1.0


def test_it_is_one_effect_with_its_time_constant():
    one = stand("creep", FORCES, np.random.default_rng(11), 5.0, METERS[WIRE])
    night = one.night
    columns = {
        "elapsed_s": night.time,
        "speed_m_per_s": METERS[WIRE].set_to(night.force),
        "speed_since_s": night.since,
        "speed_from_m_per_s": METERS[WIRE].set_to(night.before),
        "wire_V": one.volts,
    }
    roles = Roles(response="wire_V", formula=METERS[WIRE].declared, time="elapsed_s")
    found = trace_general(roles_of(Table("a wire", columns, True, {}), roles)[0], validate=False)
    assert [effect.effect for effect in found.added] == ["setting-lag:speed_m_per_s"]
    (effect,) = found.added
    assert "- (speed_m_per_s" in effect.terms[0]
    (constant,) = effect.constants
    assert abs(constant.value - 180.0) < 2.5 * constant.stderr < 90.0
