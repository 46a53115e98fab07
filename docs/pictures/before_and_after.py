"""Draw `before_and_after.png` for the README from the first run of `make demo`, `NAME-1.sqlite`, the only argument."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np

from rig.by_kind import trace_table
from rig.procedures.present.pictures import side_by_side
from rig.tables.table_of_run import run_table

SENSOR = "x_V"
OUT = Path(__file__).with_suffix(".png")
LIMIT_MDEG = 3.0


def main(run_file: Path) -> None:
    """Trace the run and draw the residuals of one sensor, before and after."""
    traced = trace_table(run_table(run_file))
    found = traced.trace.sensors[SENSOR]
    pitch = traced.data.pitch_deg
    to_mdeg = 1e3 * np.degrees(1.0 / found.S_V)
    names = " and ".join(effect.effect.replace("-", " ") for effect in found.effects)
    figure, axes = side_by_side(2.9, width=8.4)
    for axis, residual, fit, title in (
        (axes[0], found.residual_before_V, found.before, "before: the declared model"),
        (axes[1], found.residual_after_V, found.after, "after: the two confirmed effects are added"),
    ):
        axis.plot(pitch, residual * to_mdeg, ".", markersize=2, color="tab:blue", alpha=0.6)
        axis.axhline(0.0, color="0.5", linewidth=0.7)
        axis.set_title(f"{title}\nstandard error {fit.sigma_E * to_mdeg:.2f} mdeg", fontsize=9)
        axis.set_xlabel("pitch / deg", fontsize=9)
        axis.grid(color="0.9", linewidth=0.6)
        axis.tick_params(labelsize=8)
    axes[0].set_ylabel(f"residual of {SENSOR} / mdeg", fontsize=9)
    axes[0].set_ylim(-LIMIT_MDEG, LIMIT_MDEG)
    figure.subplots_adjust(top=0.84)
    figure.savefig(OUT, metadata={"Software": None})
    largest = max(float(np.max(np.abs(r))) for r in (found.residual_before_V, found.residual_after_V)) * to_mdeg
    print(f"{OUT}: {names}; largest residual {largest:.2f} mdeg")


if __name__ == "__main__":
    main(Path(sys.argv[1]))
