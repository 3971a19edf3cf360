"""`python -m cylx`."""

from cylx.cli import main

if __name__ == "__main__":
    main(prog_name="cylx")
