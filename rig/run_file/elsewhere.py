"""Whether a run goes on in another file than the one at hand: the copy that was rescued when this one lost its name."""

from __future__ import annotations

import contextlib
from pathlib import Path

from rig.errors import RigError
from rig.run_file.chain import link
from rig.run_file.events.sessions import Rescued
from rig.run_file.reader import RunReader
from rig.run_file.state import RunState


def goes_on_in(run: RunReader, state: RunState, instead_of: Path | None = None) -> Path | None:
    """The rescued copy in which a run goes on; None if it goes on here, or the copy is not to be found.

    Args:
        run: the file at hand, which may have been moved since, or be an older copy that got its name.
        state: what it says.
        instead_of: the file it was restored from, beside which the copy would lie.

    """
    if state.ended is not None:
        return None
    here = (instead_of or run.path).absolute()
    if state.rescued:
        named = Path(state.rescued)
        return next((p for p in (named, here.with_name(named.name)) if p.is_file() and p != here), None)
    return next((p for p in sorted(here.parent.glob("*-rescued-*.sqlite")) if p != here and _continues(p, run)), None)


def _continues(other: Path, run: RunReader) -> bool:
    """Whether another file holds all that this one does, and more.

    The record that follows must hold: this file may be what was restored of the other, up to where that is damaged.
    A record that only says where the other goes on is no more: this may be the copy that was rescued from it.
    """
    seq, own = run.head()
    with contextlib.suppress(RigError, OSError, TypeError, ValueError), RunReader.open(other) as copy:
        following = copy.chained("seq IN (?, ?)", (seq, seq + 1))
        (_, _, _, here), (number, record, previous, its) = following
        goes_on = not isinstance(record.event, Rescued)
        return goes_on and here == own == previous and link(previous, number, record) == its
    return False
