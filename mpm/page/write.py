"""The file of a page: the template, its styles and script, plotly and the data in one file that needs nothing else."""

from __future__ import annotations

import base64
import json
from collections.abc import Mapping
from functools import cache
from importlib.metadata import version
from importlib.resources import files
from pathlib import Path
from typing import Any

from jinja2 import Environment, PackageLoader, StrictUndefined
from markupsafe import Markup

from mpm.errors import FULL, InputError
from mpm.files import write_atomically
from mpm.output.deflate import small


@cache
def environment() -> Environment:
    """Templates escape what comes from cases: names may hold any character."""
    return Environment(
        loader=PackageLoader("mpm.page", "."),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )


@cache
def _plotly() -> str:
    """plotly's script, deflated, as base64: a third of its size in the page, unpacked by the browser."""
    script = files("plotly").joinpath("package_data", "plotly.min.js").read_bytes()
    return base64.b64encode(small(script)).decode("ascii")


def _part(name: str) -> Markup:
    return Markup(files("mpm.page").joinpath(name).read_text(encoding="utf-8"))  # our own, not to be escaped


def script_json(value: Any) -> Markup:
    """JSON for a script element: `</script>` and `<!--` in a name must not end it."""
    text = json.dumps(value, allow_nan=False, separators=(",", ":"))
    return Markup(text.replace("&", "\\u0026").replace("<", "\\u003c").replace(">", "\\u003e"))


def render(template: str, title: str, data: Mapping[str, Any], **context: Any) -> str:
    """The whole file."""
    return (
        environment()
        .get_template(template)
        .render(
            title=title,
            version=version("mpm"),
            style=_part("style.css"),
            script=_part("page.js"),
            plotly=Markup(_plotly()),
            data=script_json(data),
            **context,
        )
    )


def write_page(path: Path, html: str) -> Path:
    """Replace the file as a whole. Raises InputError where that is not possible."""
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        write_atomically(path, html)
    except OSError as error:
        if error.errno in FULL:
            raise
        raise InputError(f"{path}: the page cannot be written ({error.strerror})") from None
    except ValueError as error:  # -o "", -o /
        raise InputError(f"{path}: the page cannot be written (no name of a file: {error})") from None
    return path
