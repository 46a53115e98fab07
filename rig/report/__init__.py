"""The report: one HTML file that needs nothing else, with the evidence a person signs on."""
