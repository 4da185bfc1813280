"""The processors and threads that this process may use, and what is made to keep to them."""

from __future__ import annotations

import os


def processors() -> int:
    """Processors that this process may run on; all there are on systems that do not tell, such as macOS."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def threads_allowed() -> int | None:
    """Threads that this process should use, as OMP_NUM_THREADS has it but no more than there are processors; None where
    nobody says.

    The workers of joblib and of Ray get it as their share of the machine. Without it every process takes all
    processors, and threads that wait for work do so awake (docs/scaling.md).
    """
    first = os.environ.get("OMP_NUM_THREADS", "").split(",")[0].strip()  # a list is for nested loops
    return min(int(first), processors()) if first.isdecimal() and int(first) > 0 else None


def keep_drawing_to_threads() -> None:
    """Have Mesa's software OpenGL, which is not open yet, and OpenCV draw with as many threads as are allowed."""
    threads = threads_allowed()
    if threads is None:
        return
    import cv2

    os.environ.setdefault("LP_NUM_THREADS", str(threads if threads > 1 else 0))  # 0: in the thread that draws
    cv2.setNumThreads(threads)
