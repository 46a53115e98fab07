"""The kind "whole-plot": pressure transducers in temperature whole plots (McCollum, Commo and Parker)."""
