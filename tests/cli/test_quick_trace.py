"""`rig trace --quick` of whole plots: the same findings, without the error at left-out whole plots."""

from __future__ import annotations

from pathlib import Path

import rig

RUN = Path(__file__).parents[1] / "data" / "pressure-20261121.sqlite"


def test_a_quick_trace_has_the_findings_of_a_whole_one():
    quick, whole = (rig.open(RUN).trace(formula="1 + P", **more).to_json()["sensors"] for more in ({"quick": True}, {}))
    for name, sensor in whole.items():
        assert quick[name]["effects"] == sensor["effects"]
        assert quick[name]["verdict"] == sensor["verdict"]
        assert quick[name]["after"] | {"cv_rms": None} == sensor["after"] | {"cv_rms": None}
        assert quick[name]["after"]["cv_rms"] is None
        assert sensor["after"]["cv_rms"] > 0
