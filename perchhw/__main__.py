"""``python -m perchhw`` is the console script ``perchhw``."""

import signal


def main() -> None:
    """Load the command line and run it; who interrupts the loading ends it without more words."""
    if signal.getsignal(signal.SIGINT) is signal.default_int_handler:
        signal.signal(signal.SIGINT, signal.SIG_DFL)
    from perchhw.cli.main import main as command_line

    command_line()


if __name__ == "__main__":
    main()
