"""`python -m cylx`, and what the command `cylx` calls."""

from cylx.cli import main
from cylx.cli.terminal.startup import own_process


def run() -> None:
    """Run the command line in a process of its own."""
    with own_process():
        main(prog_name="cylx")


if __name__ == "__main__":
    run()
