"""`python -m cylx`, and the entry point of the command `cylx`."""


def run() -> None:
    """Run the command line in its own process."""
    from cylx.cli.terminal.startup import own_process  # noqa: PLC0415  Ctrl-C is heard from there on

    with own_process():
        from cylx.cli import main  # noqa: PLC0415  after Ctrl-C is taken care of

        main(prog_name="cylx")


if __name__ == "__main__":
    run()
