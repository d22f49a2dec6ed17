"""Which program has computed a result: the commit of a working copy, and a digest of the sources that decide numbers."""

from __future__ import annotations

import hashlib
import subprocess
from functools import cache
from importlib import metadata
from pathlib import Path

PACKAGE = Path(__file__).parent
WITHOUT_NUMBERS = (
    *("sweep", "dem", "cases", "cli", "page"),
    *(
        "launcher.py",
        "settings.py",
        "screen.py",
        "tables.py",
        "checkscreen.py",
        "marks.py",
        "notes.py",
        "sketch.py",
        "nextsteps.py",
    ),
    *("caveats.py", "idle.py", "quantities.py", "keys.py", "schema.py", "verdict.py", "compare.py"),
    *("results.py", "pictures.py", "maps.py", "outline.py", "curves.py", "labels.py", "fieldnames.py"),
    *("drawing.py", "beside.py", "movie.py"),
    *("streamlines.py", "optimise.py", "revision.py"),
    *("watch.py", "kinds.py", "rundirs.py", "searchscreen.py"),
    *(
        "paraview.py",
        "notebook.py",
        "session.py",
        "figures.py",
        "markup.py",
        "casehtml.py",
        "resulthtml.py",
        "help.py",
        "following.py",
        "result.py",
    ),
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
        if where.parts[0] not in WITHOUT_NUMBERS:
            found.update(f"{where}\0".encode() + file.read_bytes())
    return found.hexdigest()[:8]


@cache
def revision() -> str:
    """Version, digest, and in a working copy the commit: "0.1.0 (3f2a9c01), commit 4de27239b with changes"."""
    known = f"{metadata.version('mpm')} ({digest()})"
    commit = _git("rev-parse", "--short=9", "HEAD") if (PACKAGE.parent / ".git").exists() else ""
    if not commit:
        return known
    changed = " with changes" if _git("status", "--porcelain", "--untracked-files=no", "--", "mpm") else ""
    return f"{known}, commit {commit}{changed}"


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
