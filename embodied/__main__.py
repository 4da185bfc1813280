"""The console command's entry point, also as `python -m embodied`: Ctrl-C works from the first line on.

Libraries may swallow a KeyboardInterrupt that reaches them while they are being imported, or turn
it into an ImportError. Nothing is being written at that time, so Ctrl-C then ends the program at
once; at all other times it raises KeyboardInterrupt, and whoever is writing tidies up.
"""

import signal
import sys
from types import FrameType

STOPPED = b"\nstopped; finished parts are kept and the same command goes on from there\n"


def start() -> int:
    """Run the console command; returns its exit status."""
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, stop)
    try:
        from embodied.cli import main

        return main()
    except KeyboardInterrupt:
        return 130


def stop(number: int, frame: FrameType | None) -> None:
    """Handle Ctrl-C and SIGTERM: end the program if something is being imported, else raise KeyboardInterrupt."""
    import os

    while frame is not None:
        if frame.f_code.co_filename.startswith("<frozen importlib"):
            os.write(2, STOPPED)
            os._exit(130)
        frame = frame.f_back
    raise KeyboardInterrupt


if __name__ == "__main__":
    sys.exit(start())
