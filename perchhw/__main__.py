"""``python -m perchhw`` is the console script ``perchhw``."""

from perchhw.cli.main import main

main()
