"""``python -m bladefem``: the same as the command ``bladefem``."""

import sys

from bladefem.cli.main import main

if __name__ == "__main__":
    sys.exit(main())
