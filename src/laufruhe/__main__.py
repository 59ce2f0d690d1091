"""The `laufruhe` command, and `python -m laufruhe`."""

import os
import sys


def main() -> None:
    """Entry point; Ctrl-C while the command line is still being loaded ends in one line too."""
    try:
        from laufruhe.cli import main as run

        run()
    except KeyboardInterrupt:
        sys.stderr.write("laufruhe: interrupted, nothing was written\n")
        # after an interrupted import Python would kill itself by the signal in its place
        os._exit(130)


if __name__ == "__main__":
    main()
