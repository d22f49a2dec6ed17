"""Which program has computed a result: the commit of a working copy, and a digest of the sources that decide numbers."""

from __future__ import annotations

import hashlib
import subprocess
from functools import cache
from importlib import metadata
from pathlib import Path

PACKAGE = Path(__file__).parent
WITHOUT_NUMBERS = (
    *("sweep", "dem", "cases", "cli", "page", "pictures", "guide"),
    *(
        "drawing.py",
        "help.py",
        "labels.py",
        "launcher.py",
        "markup.py",
        "optimise.py",
        "revision.py",
        "screen.py",
        "session.py",
    ),
    *("advice/caveats.py", "advice/doses.py", "advice/idle.py", "advice/limits.py", "advice/notes.py"),
    *("advice/screen.py", "advice/sheet.py", "advice/sketch.py"),
    *(
        "report/fieldnames.py",
        "report/rounding.py",
        "report/tables.py",
        "report/verdict.py",
        "report/notebook.py",
    ),
    *(
        "case/keys.py",
        "case/keytable.py",
        "case/schema.py",
        "case/kinds.py",
        "case/marks.py",
        "case/notebook.py",
        "case/settings.py",
    ),
    *("output/results.py", "output/rundirs.py", "output/following.py", "output/compare.py"),
    *("reactor/result.py", "reactor/notebook.py"),
)
"""Parts of the package that change no number of a run: sweeps, particles, the command line, warnings, pictures."""
PATIENCE = 5.0
"""Seconds to wait for git."""


@cache
def digest() -> str:
    """Eight hexadecimal digits of the sources that decide a run's numbers; an edited working copy has another."""
    found = hashlib.sha256()
    for file in sorted((*PACKAGE.rglob("*.py"), *PACKAGE.rglob("*.toml"))):
        where = file.relative_to(PACKAGE)
        if not {where.parts[0], str(where)} & set(WITHOUT_NUMBERS):
            found.update(f"{where}\0".encode() + file.read_bytes())
    return found.hexdigest()[:8]


def release() -> str:
    """Version and digest: "0.1.0 (3f2a9c01)"."""
    return f"{metadata.version('mpm')} ({digest()})"


@cache
def revision() -> str:
    """Version, digest, and in a working copy the commit: "0.1.0 (3f2a9c01), commit 4de27239b with changes"."""
    commit = _git("rev-parse", "--short=9", "HEAD") if (PACKAGE.parent / ".git").exists() else ""
    if not commit:
        return release()
    changed = " with changes" if _git("status", "--porcelain", "--untracked-files=no", "--", "mpm") else ""
    return f"{release()}, commit {commit}{changed}"


def _git(*arguments: str) -> str:
    """What git says in the working copy; empty where there is no git, or it fails."""
    try:
        done = subprocess.run(
            ("git", *arguments),
            cwd=PACKAGE.parent,
            capture_output=True,
            text=True,
            timeout=PATIENCE,
            check=True,
        )
    except (OSError, subprocess.SubprocessError):
        return ""
    return done.stdout.strip()
