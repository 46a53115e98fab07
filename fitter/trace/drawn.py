"""A shape without a name, drawn over what it follows, with the names nearest to it."""

from __future__ import annotations

from rig.fitter.trace.doubts import DOUBT
from rig.fitter.trace.limits import limit
from rig.fitter.trace.lines import Line, over_phase
from rig.fitter.trace.outcome import Instead
from rig.fitter.trace.places import Place
from rig.fitter.trace.shape import ResidualAndWaves, Shape, shape_of, standing_for
from rig.fitter.trace.unmodelled import ResidualShape, Unmodelled


def drawn(unmodelled: Unmodelled, left: ResidualShape, i: int = 0) -> Shape | None:
    """The shape that sensor `i` follows; None where the likeliest is nothing."""
    return drawn_at(unmodelled, left.place.fine, i, left.p)


def drawn_instead(unmodelled: Unmodelled, names: tuple[str, ...], i: int = 0) -> Instead | None:
    """One shape of sensor `i` in place of all effects of some names; None without names, or where there is none."""
    if not names:
        return None
    rest = unmodelled.without(names)
    own = [one for one in rest.left if one.p < DOUBT and one.shows_in(i)]
    clearest = own[: int(limit("places", unmodelled.kind))]
    found = standing_for(names, ((one.where, drawn(rest, one, i)) for one in clearest))
    return None if found is None else Instead(names, *found)


def drawn_period(unmodelled: Unmodelled, found: Line, i: int = 0) -> Shape | None:
    """A period of sensor `i`, over its phase; None where nothing is known to put rows into it."""
    phase = unmodelled.phase(found, i)
    if phase is None:
        return None
    block, axis = over_phase(found, phase.left, phase.at, phase.period, phase.unit, unmodelled.harmonics)
    place = Place.of(block, lambda _i: (axis, None), level=phase.level, sensor=i, timed=not found.over)
    return drawn_at(unmodelled, place, i, found.p)


def drawn_at(unmodelled: Unmodelled, place: Place, i: int, p: float) -> Shape | None:
    """The shape of sensor `i` at a place; None where the likeliest is nothing, or nothing is known to draw it over."""
    axes = place.axes(i)
    if axes is None:
        return None
    seen, (plain, columns) = unmodelled.seen(place, i), unmodelled.plain(place, i)
    white = seen.project(place.columns())
    waves = ResidualAndWaves(plain, columns, seen.y, white, place.roughness, seen.df)
    near, stratum = unmodelled.near(place, i), unmodelled.stratum(place)
    return shape_of(waves, *axes, near, unit=unmodelled.unit, p=p, stratum=stratum)
