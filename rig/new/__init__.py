"""First files of a laboratory: questions, their answers, and the bench, procedure, register and world made of them.

The questions are data (`questions`), without a terminal, so that a form can ask them, too.
"""
