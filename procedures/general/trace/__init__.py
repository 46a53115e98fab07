"""From a residual to the effect behind it, for tables of any kind: docs/explanation/trace.md."""

from rig.procedures.general.trace.report import trace_general
from rig.procedures.general.trace.result import FoundTableEffect, TableTrace
from rig.procedures.general.trace.run import Found, TableData, search_table

__all__ = ["Found", "FoundTableEffect", "TableData", "TableTrace", "search_table", "trace_general"]
