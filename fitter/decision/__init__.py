"""Decisions on conformity after JCGM 106."""
