"""Columns of a record: what recovery needs without reading a body."""

from __future__ import annotations

from typing import NamedTuple


class Columns(NamedTuple):
    """Values of a record as they are stored; `rig.run_file.chain.Record` says what each is."""

    session: int
    kind: str
    elapsed_s: float
    utc_s: float
    run_index: int | None = None
    whole_plot: int | None = None
    attempt: int | None = None
    status: str | None = None
    body: str = "{}"
