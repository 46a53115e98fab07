"""Curves over a setting that look like one another: which leads, and when its name is doubtful."""

import pytest

from proving.truth.table import MISSING, options, simulate
from rig.fitter.trace.search import names_of
from rig.procedures.general.column_roles import Roles, roles_of
from rig.procedures.general.trace import search_table
from rig.procedures.general.trace.reasons import other_laws
from rig.procedures.general.trace.unmodelled import UnmodelledSmooth
from rig.procedures.tables.table import Table


def traced(name, seed):
    """A table of the campaign with one effect of 1 sd: the first name found, and the doubts about other curves."""
    missing = MISSING[name]
    table = Table("simulated", simulate(missing.lab, seed, missing.at(1.0)), True, {})
    data, _ = roles_of(table, Roles(**options(missing.lab)))
    found = search_table(data)
    names = names_of(found.judge.candidates, found.chosen)
    return names, other_laws(UnmodelledSmooth(found.judge, found.chosen, data))


@pytest.mark.parametrize("seed", [701, 704])
def test_a_kink_that_is_more_probable_than_a_smooth_curve_leads(seed):
    """Its bend costs two columns' price; with that it is ahead. Before, a cube and a square led as the simpler ones."""
    names, doubts = traced("kink", seed)
    assert names == ["kink:x"]
    assert all("explains as much: how it depends on the variable is not known" in one for one in doubts.values())


def test_a_root_is_doubtful_where_a_saturation_explains_as_much():
    names, doubts = traced("square root", 702)
    assert names == ["square-root:x"]
    assert doubts == {names[0]: "saturation:x explains as much: how it depends on the variable is not known"}


def test_a_root_that_nothing_else_explains_is_not():
    assert traced("square root", 102) == (["square-root:x"], {})
