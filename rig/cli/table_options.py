"""Options that say how a table of others is written."""

from __future__ import annotations

from typing import Annotated

import typer

_PANEL = "Tables of others"

SeparatorOption = Annotated[
    str | None,
    typer.Option(
        help="between cells: comma, semicolon, tab, pipe or space; recognised if not given", rich_help_panel=_PANEL,
        show_default=False,
    ),
]  # fmt: skip
DecimalOption = Annotated[
    str | None,
    typer.Option(help="point or comma; recognised if not given", rich_help_panel=_PANEL, show_default=False),
]
EncodingOption = Annotated[
    str | None,
    typer.Option(help="of the text, such as cp1252 or utf-16", rich_help_panel=_PANEL, show_default=False),
]
HeaderOption = Annotated[
    int | None,
    typer.Option(
        help="row of the column names in the file; 0 if it has none", rich_help_panel=_PANEL, show_default=False
    ),
]
