"""NASA/TP-1999-209835 (Tripp and Tcheng, 1999) done again: its tables, its figures, its words, beside what is printed.

    rig study paper --out FOLDER

Table 1, figures 1 to 21 and the critical values follow from the designs alone. Experiments 22 to 54 are run on the
simulated bench by the real controller, and fitted and inferred as any calibration is.
"""

from proving.paper.document import computed_sections, markdown, section_markdown
from proving.paper.study import Study, measure, reproduce, without_experiments

__all__ = [
    "Study",
    "computed_sections",
    "markdown",
    "measure",
    "reproduce",
    "section_markdown",
    "without_experiments",
]
