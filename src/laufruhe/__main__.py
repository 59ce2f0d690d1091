"""`python -m laufruhe`."""

from laufruhe.cli import main

if __name__ == "__main__":
    main()
