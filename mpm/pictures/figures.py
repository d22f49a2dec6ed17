"""Pictures of a run by name, for a session: `run.plot("theta")`."""

from __future__ import annotations

import io
from functools import partial
from typing import TYPE_CHECKING, Any

from mpm.errors import InputError
from mpm.report.dosing import made_sites

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from mpm.output.results import Run

FIRST_OF = {"theta": "the coverage", "x": "the mole fraction", "C": "the concentration"}
"""Kinds of field that stand for the first of their kind."""


def figure_of(run: Run, name: str | None, **options: Any) -> Figure:
    """A picture of a run by name: a field (`options` as for `draw_field`), a standard picture of `mpm plot`, or a column of the history.

    `theta`, `x` and `C` alone are the first coverage that is made, the first precursor's mole fraction and concentration; a species or a
    site alone is its mole fraction or coverage. Raises InputError for another name, with the nearest.
    """
    from matplotlib import style

    from mpm.pictures.standard import STYLE, Fields, draw_field, pictures
    from mpm.report.fieldnames import drawable

    name = field_called(run, name)
    fields = drawable(run.snapshot().cell_data) if run.times else []
    if name in fields:
        return showable(draw_field(run, name, **options))
    standard = {picture.name: picture for picture in pictures(run, Fields(run), lambda line: None)}
    columns = [column for column in run.history if column != "time"]
    if name not in (*standard, *columns):
        accepted = (
            f"a field ({', '.join(fields)}), a picture ({', '.join(standard)}), or a column of history.csv"
        )
        known = [*fields, *standard, *columns]
        raise InputError.at(run.directory.path, "plot", repr(name), accepted, known=known, given=name)
    if options:
        raise InputError.at(None, "plot", f"{', '.join(options)} with {name}", "options with a field alone")
    if name in columns:
        return showable(_curve(run, name))
    with style.context(STYLE):
        return showable(standard[name].draw())


def field_called(run: Run, name: str | None) -> str:
    """The full name of what is meant."""
    sites, species = made_sites(run.case), run.case.fed_species
    if name is None:
        return f"theta_{sites[0]}" if sites else "velocity"
    if name in FIRST_OF:
        firsts = sites if name == "theta" else species
        if not firsts:
            raise InputError.at(
                None,
                "plot",
                repr(name),
                f"the name of a field: no inlet feeds anything that makes {FIRST_OF[name]}",
            )
        return f"{name}_{firsts[0]}"
    if name in run.case.mechanism.site_names:
        return f"theta_{name}"
    if name in (*run.case.mechanism.species_names, run.case.gas.carrier):
        return f"x_{name}"
    return {"speed": "velocity", "cvd": "cvd_rate"}.get(name, name)


def _curve(run: Run, name: str) -> Figure:
    """A number of the history over time."""
    from matplotlib import style
    from matplotlib.figure import Figure

    from mpm.labels import literal
    from mpm.pictures.maps import name_of
    from mpm.pictures.standard import STYLE
    from mpm.report.fieldnames import superscript
    from mpm.report.quantities import quantity

    meant = quantity(name)
    with style.context(STYLE):
        figure = Figure(figsize=(7.0, 3.2), layout="constrained")
        axes = figure.subplots()
        axes.plot(run.history["time"], run.history[name] / meant.factor)
        axes.set(xlabel="time [s]", ylabel=f"[{superscript(meant.unit_shown)}]" if meant.unit_shown else "")
        axes.set_title(literal(meant.label), fontsize=9)
        axes.grid(alpha=0.25)
        figure.suptitle(name_of(run), fontsize=10)
    return figure


def showable(figure: Figure) -> Figure:
    """`figure`, which a notebook shows also where nobody has loaded pyplot."""
    setattr(figure, "_repr_png_", partial(_png, figure))  # noqa: B010 (matplotlib has no such name)
    return figure


def _png(figure: Figure) -> bytes:
    content = io.BytesIO()
    figure.savefig(content, format="png", dpi=100)
    return content.getvalue()
