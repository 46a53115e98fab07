"""Where a row is, in words: one number is enough."""

from __future__ import annotations

import numpy as np
import pytest

from rig.procedures.general.fit import _order_of
from rig.procedures.tables.table import Table


@pytest.mark.parametrize(("order", "said"), [([1, 2, 3], ""), ([3, 1, 2], "order 1"), (None, "")])
def test_the_order_is_said_where_the_row_does_not_tell_it(order, said):
    """A fit named "row 27 (order 26)" of a table in its order."""
    columns = {"x": np.zeros(3)} | ({} if order is None else {"order": np.array(order, float)})
    assert _order_of(Table("t.csv", columns, False, {}))(1) == said
