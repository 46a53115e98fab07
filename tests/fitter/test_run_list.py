"""The run list: expansion, hashing and limits."""

from __future__ import annotations

import pytest
from night_procedure import procedure

from rig.bench.config import parse_procedure
from rig.errors import ConfigurationError


def test_the_night_has_2886_points_in_six_replications():
    points = procedure().expand().points
    assert len(points) == 2886
    assert [sum(p.replication == r for p in points) for r in range(1, 7)] == [481] * 6


def test_equal_procedures_expand_to_equal_hashes_and_any_change_shows():
    base = procedure().expand().sha256()
    assert base == procedure().expand().sha256()
    changed = [
        procedure(replications=5),
        procedure(order={"type": "serpentine", "replications": "same"}),
        procedure(order={"type": "random"}),
        procedure(approach={"overtravel_deg": 1.0}),
        procedure(seed=8),
    ]
    assert len({base, *(p.expand().sha256() for p in changed)}) == 6


def test_a_random_order_depends_on_the_seed_alone():
    random = {"order": {"type": "random"}}
    assert procedure(**random).expand() == procedure(**random).expand()
    assert procedure(**random).expand().points != procedure(**random, seed=8).expand().points


def test_limits_cover_the_overtravel():
    run_list = procedure().expand()
    assert not list(run_list.beyond({"pitch_deg": (-182, 182), "roll_deg": (-182, 182)}))
    (sentence,) = run_list.beyond({"pitch_deg": (-181, 181), "roll_deg": (-182, 182)})
    assert "approached from -182" in sentence
    first, second = run_list.beyond({"pitch_deg": (-90, 90), "roll_deg": (-100, 100)})
    assert "pitch_deg = -180" in first
    assert "roll_deg = -180" in second


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("kind = 'pitch-rol'", "is not a kind of procedure"),
        ("kind = 'pitch-roll'\nname = 'n'\n[design]\ntype = 'D1'", "needs pitch_count, pitch_max_deg, roll_count"),
        ("kind = 'pitch-roll'\nname = 'n'\n[design]\ntype = 'T6'\nroll_count = 3", "does not use roll_count"),
        ("kind = 'pitch-roll'\nname = 'n'\n[design]\ntype = 'T6'\n[setle]\nband_deg = 1", "did you mean settle?"),
        ("kind = 'pitch-roll'\nname = 'n'\n[design]\ntype = 'T6'\n[settle]\nband = 1", "did you mean band_deg?"),
        ("kind = 'pitch-roll'\n[design]\ntype = 'T6'", "name is missing"),
        ("kind = 'pitch-roll'\nreplications = 'six'\nname = 'n'\n[design]\ntype = 'T6'", "(it is 'six')"),
        ("kind = [", "not valid TOML"),
        (
            "kind = 'pitch-roll'\nname = 'n'\n[design]\ntype = 'D'\npitch_deg = [1, 1]\nroll_deg = [0]",
            "must differ from one another",
        ),
    ],
)
def test_a_wrong_procedure_file_is_explained(text, says):
    with pytest.raises(ConfigurationError) as caught:
        parse_procedure(text, "night.toml")
    assert says in str(caught.value)
    assert "night.toml" in str(caught.value)
