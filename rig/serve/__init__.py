"""The server of a laboratory, `rig serve`: the live page grown by acts of people who are logged in.

Acts go through the same functions and request files as the command line (`rig.acts`).
"""

from rig.serve.api import openapi
from rig.serve.app import make_app
from rig.serve.server import serve

__all__ = ["make_app", "openapi", "serve"]
