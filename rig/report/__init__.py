"""The report: one HTML file that needs nothing else, with the evidence a person signs on."""

from rig.report.html import write_report

__all__ = ["write_report"]
