"""JSON Schema of sweep files, for editors; `mpm.sweep.sweepfile` reads them and says what is wrong in a line."""

from typing import Any

from mpm.case.schema import DRAFT
from mpm.sweep.sweepfile import DEFAULT_COLUMNS, DEFAULT_PICTURES, METHODS, MODES, MOST_POINTS

_LEVEL = {"type": ["string", "number", "boolean", "array"]}
_END = {"type": ["string", "number"]}
_TEXTS = {"anyOf": [{"type": "string"}, {"type": "array", "items": {"type": "string"}}]}


def _count(description: str, least: int = 1, **more: Any) -> dict[str, Any]:
    return {"type": "integer", "minimum": least, "maximum": MOST_POINTS, "description": description, **more}


def _table(description: str, properties: dict[str, Any], **more: Any) -> dict[str, Any]:
    return {
        "type": "object",
        "description": description,
        "properties": properties,
        "additionalProperties": False,
        **more,
    }


_RANGE = {
    "start": {**_END, "description": 'first level, as a case writes it, e.g. "2 mm" or 1e-4'},
    "stop": {**_END, "description": "last level, in the same dimension"},
    "num": _count("how many levels; of a mode other than sample"),
}
_AXIS = {
    "key": {
        **_TEXTS,
        "description": "the dotted key of the case that is varied, list entries by name (mpm explain KEY); or several that get one value",
        "examples": ["geometry.inlet.tma.width"],
    },
    "name": {
        "type": "string",
        "description": "what the axis is called in tables, pictures and conditions. Left out: the key",
    },
    "values": {
        "type": "array",
        "items": _LEVEL,
        "minItems": 1,
        "description": "the levels, as a case writes them",
    },
    "linspace": _table("levels in equal distances", _RANGE, required=["start", "stop"]),
    "logspace": _table("levels in equal ratios", _RANGE, required=["start", "stop"]),
}
_SLURM = {
    "workers": _count("jobs of Slurm at a time", default=1),
    "points_per_job": _count("points that one job runs at a time", default=1),
}
_SWEEP = {
    "title": {"type": "string", "description": "a line that names the sweep. Left out: the name of the file"},
    "case": {
        "type": "string",
        "description": "the case that is varied: a path relative to this file, or the name of a built-in case (mpm list cases)",
        "examples": ["single_zone"],
    },
    "mode": {
        "enum": [*MODES],
        "default": MODES[0],
        "description": "grid: every combination of all levels; zip: the first level of each axis, then the second, ...; "
        "sample: points drawn from the ranges",
    },
    "samples": _count("how many points; of mode sample, which requires it"),
    "method": {
        "enum": [*METHODS],
        "default": METHODS[0],
        "description": "how points are drawn in mode sample",
    },
    "seed": _count("which sequence of points is drawn in mode sample", 0, default=0),
    "where": {
        **_TEXTS,
        "description": "conditions in the names of the axes; only combinations that meet all are run",
        "examples": ["width <= 2 * height"],
    },
    "columns": {
        **_TEXTS,
        "default": [*DEFAULT_COLUMNS],
        "description": "numbers of summary.json that go into the table, * for any name (mpm explain lists them)",
    },
    "pictures": {
        **_TEXTS,
        "default": [*DEFAULT_PICTURES],
        "description": "numbers that are drawn. Left out: the columns, if these are given",
    },
    "ranks": _count("MPI ranks of each point", default=1),
    "axis": {
        "type": "array",
        "minItems": 1,
        "description": "the parameters that are varied",
        "items": _table("one parameter, by one of values, linspace and logspace", _AXIS, required=["key"]),
    },
    "set": {
        "type": "object",
        "description": "other keys of the case that this sweep changes, the same for all points",
        "examples": [{"time.end": "10 s"}],
    },
    "slurm": {
        "type": "object",
        "description": "for --scheduler slurm: the keys here, and any of dask_jobqueue.SLURMCluster",
        "properties": _SLURM,
    },
}


def sweep_schema() -> dict[str, Any]:
    """JSON Schema of a sweep file."""
    sweep = _table("a parameter sweep", _SWEEP, required=["case", "axis"])
    whole = _table("A sweep file of mpm.", {"sweep": sweep}, required=["sweep"])
    return {"$schema": DRAFT, "title": "Sweep", **whole}
