"""`python -m proving CAMPAIGN`; proving/notes/campaigns.md."""

import os
import sys

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # narrow matrices: threads cost more than they bring

from proving.frame import main

if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
