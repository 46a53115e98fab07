"""Whether a run continues in another file: the copy rescued when this file was moved, deleted or replaced."""

from __future__ import annotations

import contextlib
from pathlib import Path

from rig.errors import RigError
from rig.run_file.chain import link
from rig.run_file.events.sessions import Rescued
from rig.run_file.read.reader import RunReader
from rig.run_file.state.state import RunState


def goes_on_in(run: RunReader, state: RunState, instead_of: Path | None = None) -> Path | None:
    """The rescued copy in which a run continues; None if it continues here, or the copy cannot be found.

    Args:
        run: this file, which may have been moved since, or be an older copy under its name.
        state: state of the run by this file.
        instead_of: the file that this one was restored from; the copy would be beside it.

    """
    if state.ended is not None:
        return None
    here = (instead_of or run.path).absolute()
    if state.rescued:
        named = Path(state.rescued)
        return next((p for p in (named, here.with_name(named.name)) if p.is_file() and p != here), None)
    return next((p for p in sorted(here.parent.glob("*-rescued-*.sqlite")) if p != here and _continues(p, run)), None)


def _continues(other: Path, run: RunReader) -> bool:
    """Whether another file holds all records of this one, and more.

    The next record must have a correct hash: this file may be restored from the other one, up to its damage. A next
    record that only names the rescued copy does not count: this file may be that copy.
    """
    seq, own = run.head()
    with contextlib.suppress(RigError, OSError, TypeError, ValueError), RunReader.open(other) as copy:
        following = copy.chained("seq IN (?, ?)", (seq, seq + 1))
        (_, _, _, here), (number, record, previous, its) = following
        goes_on = not isinstance(record.event, Rescued)
        return goes_on and here == own == previous and link(previous, number, record) == its
    return False
