"""A terminal to write on."""

import os
import sys


def on_a_terminal(action):
    """Run an action with standard error on a pseudo-terminal, and give what was shown there."""
    import pty

    reader, writer = pty.openpty()
    before = sys.stderr
    try:
        with os.fdopen(writer, "w") as sys.stderr:
            action()
            sys.stderr.flush()
            os.set_blocking(reader, False)
            shown = b""
            while True:
                try:
                    shown += os.read(reader, 65536)
                except BlockingIOError:
                    break
    finally:
        sys.stderr = before
        os.close(reader)
    return shown.decode()
