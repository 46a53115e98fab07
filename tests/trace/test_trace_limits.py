"""The table of limits that several kinds of run have."""

import pytest

from rig.fitter.trace.limits import KINDS, TABLE, limit
from rig.procedures.attitude.trace import unmodelled as of_attitude
from rig.procedures.general.trace import unmodelled as of_tables
from rig.procedures.pressure.trace import unmodelled as of_plots


def test_every_limit_stands_once_with_its_meaning():
    names = [one.name for one in TABLE]
    assert len(set(names)) == len(names)
    assert all(one.meaning and one.unit in ("1", "nats") for one in TABLE)
    assert all(sum(value is not None for value in one.values) > 1 for one in TABLE), "a limit of one kind stands there"


def test_kinds_read_their_column():
    """A name has to lead a shape without a name by odds of 20 to 1, but for whole plots."""
    kinds = [one.kind for one in (of_attitude.UnmodelledSmooth, of_plots.InTransducer, of_tables.UnmodelledSmooth)]
    assert kinds == list(KINDS)
    assert [limit("lead of a name", kind) for kind in kinds] == [3.0, 1.0, 3.0]


def test_a_limit_that_a_kind_does_not_have_is_an_error():
    with pytest.raises(KeyError, match="no limit 'most outliers' of general"):
        limit("most outliers", "general")
    with pytest.raises(KeyError, match="no limit 'size'"):
        limit("size", "general")
