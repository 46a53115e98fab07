"""Rows, sentences and figures for people, the same on terminal, page and notebook."""
