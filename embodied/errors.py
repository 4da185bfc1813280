"""UnableError: what the machine or the run cannot do although the input is right."""


class UnableError(RuntimeError):
    """No OpenGL, no path tracer, training that diverged: the message says why and what to do.

    Wrong input is a ValueError, a missing or unwritable file an OSError; the command line shows
    the message of all three and nothing else.
    """
