"""`python -m rig.serve > docs/reference/openapi.json`: the description of the API."""

from __future__ import annotations

import json

from rig.serve.api import openapi

if __name__ == "__main__":
    print(json.dumps(openapi(), indent=1))
