"""`python -m handpipe.cli`: the command `handpipe`."""

import sys

from handpipe.cli.commands import main

if __name__ == "__main__":
    sys.exit(main())
