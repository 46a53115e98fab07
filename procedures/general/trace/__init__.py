"""From a residual to the effect behind it, for tables of any kind: docs/explanation/trace_tables.md."""

from procedures.general.trace.report import trace_general
from procedures.general.trace.result import FoundTableEffect, TableTrace
from procedures.general.trace.run import Found, TableData, search_table

__all__ = ["Found", "FoundTableEffect", "TableData", "TableTrace", "search_table", "trace_general"]
