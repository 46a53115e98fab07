"""Pitch-roll procedures side by side, and one recommended."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Sequence
from dataclasses import asdict, dataclass, replace
from typing import IO, Any

from rich.markup import escape

from rig.procedures.attitude.advice import design_points, usage_of
from rig.procedures.attitude.merit import Comparison, Curve, Recommendation, Usage, compare, curve, recommend
from rig.procedures.attitude.settings import PitchRollProcedure
from rig.procedures.present.blocks import Block, Grid, Line
from rig.procedures.present.numbers import number


@dataclass(frozen=True)
class DesignsCompared:
    """Designs of pitch and roll, compared by precision over the range of use."""

    rows: Sequence[Comparison]
    hours: Sequence[float]
    curves: Sequence[Curve]
    usage: Usage
    sigma_deg: float
    best: Recommendation | None

    def to_json(self) -> dict[str, Any]:
        """JSON values for `rig plan --compare --json`, without files; "designs" in the given order."""
        return {
            "usage_deg": self.usage.pitch_half_deg,
            "sigma_deg": self.sigma_deg,
            "designs": [asdict(row) | {"hours": h} for row, h in zip(self.rows, self.hours, strict=True)],
            "recommended": self.best and asdict(self.best),
        }

    def blocks(self) -> Iterator[Block]:
        """Blocks for people."""
        title = f"Used within {self.usage}, one observation {self.sigma_deg:.1e} deg (expect.sigma_deg)"
        headings = ("procedure", "points", "time", "mean sd", "worst sd", "at", "V^1/2", "pads from")
        grid = Grid(headings, title=title, frame="plain")
        for row, time_h in zip(self.rows, self.hours, strict=True):
            grid.add_row(escape(row.name), *_cells(row, time_h))
        yield grid
        yield Line(
            "  sd of the calibrated output / 1e-4 deg; V^1/2: figure of merit, eq. (53); pads from: smallest "
            "deflection / 1e-4 deg that lack of fit shows nine times in ten"
        )
        for row in self.rows:
            if row.undetermined:
                yield Line(f"  [yellow]{escape(row.name)}:[/] {escape(row.undetermined)}")
            elif row.extrapolated:
                yield Line(f"  [yellow]{escape(row.name)}[/] is not calibrated over all of that range")
        if self.best is None:
            yield Line("  none of them determines the sensors over that range: none is recommended")
        else:
            yield Line(f"  [bold]recommended: {escape(self.best.name)}[/]; {escape(self.best.why)}")

    def draw(self, file: IO[bytes]) -> None:
        """Standard deviation over pitch, as in the paper's figures 1 to 5."""
        from rig.procedures.present.pictures import side_by_side  # noqa: PLC0415 - plots take a second to import

        figure, (axis,) = side_by_side(3.6, 1, width=7.0)
        for one in self.curves:
            axis.plot(one.pitch_deg, 1e4 * one.sd_deg[0], label=one.name)
        axis.set_xlabel("pitch / deg")
        axis.set_ylabel("sd of the calibrated output / 1e-4 deg")
        axis.grid(color="0.9", linewidth=0.6)
        axis.set_ylim(bottom=0)
        axis.legend(fontsize=8, frameon=False)
        figure.savefig(file, format="png", metadata={"Software": None})


def compare_designs(
    procedures: Sequence[PitchRollProcedure],
    names: Sequence[str],
    axes: Collection[str],
    usage_deg: float | None,
    hours: Sequence[float],
) -> DesignsCompared:
    """Compare procedures over the range of use of the first, or 30 deg. See `rig.procedures.kind.Kind.compare`."""
    usage = usage_of(procedures[0], usage_deg) or Usage.within(30.0)
    designs = [replace(design_points(p), name=name) for p, name in zip(procedures, names, strict=True)]
    sigma = procedures[0].expect.sigma_deg
    across = sorted(set(axes) - {"x"})
    rows = [_seen_by(row, across) for row in compare(designs, usage, sigma)]
    curves = [curve(d, usage, sigma) for d, row in zip(designs, rows, strict=True) if not row.undetermined]
    return DesignsCompared(rows, hours, curves, usage, sigma, recommend(rows, cost=list(hours)))


def _seen_by(row: Comparison, across: Sequence[str]) -> Comparison:
    """A design without roll determines no sensor across the pitch plane, only one along x."""
    if row.roll or row.undetermined or not across:
        return row
    sensors = " and ".join(across)
    return Comparison(
        row.name,
        row.roll,
        row.points,
        row.replications,
        row.observations,
        row.df,
        undetermined=f"without roll it does not calibrate the {sensors} sensors of this bench",
    )


def _cells(row: Comparison, time_h: float) -> list[str]:
    if row.undetermined:
        return [str(row.observations), f"{time_h:.1f} h", *"-----"]
    pads = "never" if row.smallest_pad_deg == float("inf") else number(1e4 * row.smallest_pad_deg, 2)
    return [
        str(row.observations),
        f"{time_h:.1f} h",
        number(1e4 * row.mean_sd_deg, 3),
        number(1e4 * row.worst_sd_deg, 3),
        f"{row.worst_pitch_deg:.0f} deg",
        f"{row.figure_of_merit:.3f}",
        pads,
    ]
