"""``python -m perchhw`` is the console script ``perchhw``."""

from perchhw.cli import main

main()
