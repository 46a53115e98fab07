"""What must hold where the controller had no turn for a while, as a process that is stopped has none."""

from __future__ import annotations

from collections.abc import Iterator

from proving.night.judged import Night
from rig.run_file.events.bench import Prepared

_NOTICED_S = 20.0
"""A hole of which more than so much is not explained by waiting is noticed."""


def unbroken(night: Night) -> Iterator[str]:
    """Nothing that has to be of one piece has a hole in time in it."""
    conduct = night.played.plan.procedure.conduct
    accepted = list(night.accepted())
    prepared = [night.world_s(r.session, r.elapsed_s) for r in night.records if isinstance(r.event, Prepared)]
    for began, ended in _holes(night):
        spans = [(night.measured_s(r), r) for r in accepted]
        for (first, last), r in spans:
            if first < began and ended <= last:
                yield f"point {r.run_index} was accepted, measured over a hole of {ended - began:.0f} s"
        before = [r for (_, last), r in spans if last <= began]
        after = [(first, r) for (first, _), r in spans if first >= began]
        if not before or not after:
            continue
        again, following = after[0]
        if conduct.whole_plots is not None:
            same = before[-1].whole_plot == following.whole_plot
            if same and ended - began > conduct.whole_plots.continue_gap_s:
                yield f"whole plot {following.whole_plot} went on over a hole of {ended - began:.0f} s"
        elif ended - began > conduct.max_gap_s and not any(began < t < again for t in prepared):
            yield f"a hole of {ended - began:.0f} s, and nothing was prepared again"


def _holes(night: Night) -> Iterator[tuple[float, float]]:
    """World times between which a controller that lived had no turn."""
    for mishap in night.played.scenario.mishaps:
        if mishap.kind != "suspend" or mishap.options["for_s"] <= _NOTICED_S:
            continue
        if any(what == str(mishap) and abs(t - mishap.at_s) < 1e-6 for t, what in night.played.happened):
            yield mishap.at_s, mishap.at_s + mishap.options["for_s"]
