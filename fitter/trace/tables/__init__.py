"""From a residual to the effect behind it, for tables of any kind: docs/trace_tables.md."""

from fitter.trace.tables.report import trace_general
from fitter.trace.tables.result import FoundTableEffect, TableTrace
from fitter.trace.tables.run import Found, TableData, search_table

__all__ = ["Found", "FoundTableEffect", "TableData", "TableTrace", "search_table", "trace_general"]
