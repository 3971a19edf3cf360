"""`python -m cylx`, and the entry point of the command `cylx`."""

from cylx.cli import main
from cylx.cli.terminal.startup import own_process


def run() -> None:
    """Run the command line in its own process."""
    with own_process():
        main(prog_name="cylx")


if __name__ == "__main__":
    run()
