"""From a residual to the effect behind it, for tables of any kind: docs/trace_tables.md."""

from fitter.trace.tables.run import Found, TableData, search_table

__all__ = ["Found", "TableData", "search_table"]
