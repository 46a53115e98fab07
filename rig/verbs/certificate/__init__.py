"""Calibration certificates: a document as data, and its forms on paper, on a page and as XML."""
