"""A program of a stranger that uses all of `import rig`. Only mypy reads it, with the other sources (`tools/check`)."""

from __future__ import annotations

from typing import Any, assert_type

import pandas
import xarray

import rig
from rig.verbs.data.result import Calibration, Data
from rig.verbs.observations import Observations
from rig.verbs.result import Plots

run = rig.open("run.sqlite")
assert_type(run.table, Observations)
assert_type(run.fit(temperature=True), Calibration)
assert_type(run.trace().to_json(), dict[str, Any])
assert_type(run.fit().infer({"x_V": [1.0]}).to_pandas(), pandas.DataFrame)
assert_type(rig.chart([run]).plot(), Plots)
assert_type(rig.plan("p", "b").to_xarray(), xarray.Dataset)
assert_type(rig.run("p", "b").data, Data)
assert_type(rig.UsageError(), rig.UsageError)
rig.open(3)  # type: ignore[arg-type] # an unused `ignore` is an error: so this line has to be one
