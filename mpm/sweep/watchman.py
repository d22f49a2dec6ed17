"""Our end of a guard: orders go in, exit statuses come out."""

import contextlib
import json
import os
import signal
import subprocess
import sys
from collections.abc import Mapping
from typing import Any

from mpm.sweep import guard

GUARD_KILLED = 128 + signal.SIGKILL


class Watchman:
    """A guard process (`mpm.sweep.guard`) at the service of one thread."""

    def __init__(self, environment: Mapping[str, str]) -> None:
        self._process = subprocess.Popen(
            [sys.executable, "-I", "-S", guard.__file__],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.DEVNULL,
            env=environment,
            start_new_session=True,
        )

    def __del__(self) -> None:
        self._process.communicate()  # the end of its orders is the guard's end

    def ready(self) -> bool:
        """Whether it lives."""
        return self._process.poll() is None

    def run(self, order: Mapping[str, Any]) -> int:
        """Hand over an order and wait for the exit status; as of a killed point when the guard itself was killed."""
        assert self._process.stdin is not None and self._process.stdout is not None
        with contextlib.suppress(BrokenPipeError):
            self._process.stdin.write(json.dumps(order).encode() + b"\n")
            self._process.stdin.flush()
            answer = self._process.stdout.readline()
            if answer:
                return int(answer)
        self._process.wait()
        return GUARD_KILLED

    def stop(self) -> None:
        """Let the present point stop; from any thread."""
        assert self._process.stdin is not None
        with contextlib.suppress(OSError, ValueError):
            os.write(self._process.stdin.fileno(), guard.STOP + b"\n")
