"""The `laufruhe` command, and `python -m laufruhe`."""

import os
import sys

try:
    from laufruhe.cli import main
except KeyboardInterrupt:
    sys.stderr.write("laufruhe: interrupted, nothing was written\n")
    # after an interrupted import Python would end by the signal
    os._exit(130)

__all__ = ["main"]

if __name__ == "__main__":
    main()
