"""What is proven about the program: campaigns and checks that are not shipped with it."""

import os

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # before numpy is loaded: campaigns have a process for each core
