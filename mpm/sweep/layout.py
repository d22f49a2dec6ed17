"""Where a sweep keeps what: the results for people, `points/` for the runs, `driver/` for the bookkeeping.

results.csv results.parquet sweep.json plots/     what a sweep is for
points/<name>/                                    the output directory of one run, as `mpm run` writes it
driver/<name>.toml .json .log .lock               its resolved case, its verdict, what it printed, its lock
driver/lease driver/lock                          the living driver
"""

import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any


@dataclass(frozen=True)
class Layout:
    """Paths below one sweep's output directory."""

    root: Path

    @property
    def driver(self) -> Path:
        """The bookkeeping directory."""
        return self.root / "driver"

    def run(self, name: str) -> Path:
        """Output directory of the point's run."""
        return self.root / "points" / name

    def case(self, name: str) -> Path:
        """The point's resolved case."""
        return self.driver / f"{name}.toml"

    def record(self, name: str) -> Path:
        """The verdict that the guard writes when the point has ended."""
        return self.driver / f"{name}.json"

    def log(self, name: str) -> Path:
        """What the point's last attempt printed."""
        return self.driver / f"{name}.log"

    def lock(self, name: str) -> Path:
        """Held by whoever runs the point."""
        return self.driver / f"{name}.lock"


def read_json(path: Path) -> dict[str, Any]:
    """The object in a JSON file; empty when there is none, or only half of one."""
    try:
        content = json.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError):
        return {}
    return content if isinstance(content, dict) else {}
