"""How constants of the place displace the recorded angles of a dividing head."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from rig.fitter.arrays import FloatArray


def levelled(pitch_deg: FloatArray, roll_deg: FloatArray, tilt_deg: float) -> Mapping[str, FloatArray]:
    """Additions to pitch and roll for a base that is tilted about the roll axis's direction at zero pitch.

    Gravity in the base is (0, -sin t, -cos t). The head turns it by pitch, then by roll; the angles of a level head
    with the same gravity in the package are exact, also where pitch passes 90 deg.

    Args:
        pitch_deg: (n,) angles of the head.
        roll_deg: (n,).
        tilt_deg: tilt t of the base along the pitch axis, about the horizontal axis across it.
    """
    a, t = np.radians(pitch_deg), np.radians(tilt_deg)
    x, z = np.sin(a) * np.cos(t), np.cos(a) * np.cos(t)
    side = np.where(z < 0, -1.0, 1.0)
    pitch = np.arctan2(x, side * np.hypot(np.sin(t), z))
    roll = np.arctan2(np.sin(t) * side, z * side)
    turned = np.degrees(pitch) - pitch_deg
    return {"pitch_deg": turned - 360.0 * np.round(turned / 360.0), "roll_deg": np.degrees(roll)}
