"""Zones: named stretches of the strip that results are given for, each with the inlet that doses it."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise
from typing import Annotated

from pydantic import Field

from mpm.case.model import Frozen, Name
from mpm.case.ports import Inlet, check_inside, span
from mpm.units import Dimension, StripLength, reject


class Zone(Frozen):
    """A named stretch of the strip, from `start` to `end` [m], with the inlet that doses it."""

    name: Annotated[Name, Field(examples=["zone1"])]
    """what the zone is called in results and in keys: letters, digits, _ and -"""
    start: Annotated[float, Dimension("m", "a position", "0 mm", at_least=0.0)]
    """left end of the zone, from the left end of the strip"""
    end: StripLength
    """right end of the zone, from the left end of the strip"""
    inlet: Annotated[str | None, Field(examples=["tma"])] = None
    """name of the inlet whose precursor reacts in this zone: its titration is read where solids leave the zone"""


def default_zones(inlets: Sequence[Inlet], length: float) -> tuple[Zone, ...]:
    """As many equal zones as inlets that dose, provided that each contains the centre of one of them."""
    dosing = sorted((inlet for inlet in inlets if inlet.doses), key=lambda inlet: inlet.center)
    share = length / max(1, len(dosing))
    if any(not i * share <= inlet.center <= (i + 1) * share for i, inlet in enumerate(dosing)):
        raise reject(
            f"no zones, and dosing inlets at {', '.join(f'{inlet.center * 1e3:g} mm' for inlet in dosing)}",
            f"a list of zones, since {len(dosing)} equal zones would not hold one dosing inlet each",
            key="zone",
        )
    edges = [i * share for i in range(len(dosing))] + [length]
    return tuple(
        Zone(name=f"zone{i + 1}", start=f"{edges[i]!r} m", end=f"{edges[i + 1]!r} m", inlet=inlet.name)
        for i, inlet in enumerate(dosing)
    )


def check_zones(zones: Sequence[Zone], inlets: Sequence[Inlet], *, length: float, dx: float) -> None:
    """Zones lie inside the strip, apart, and each around the centre of an inlet that no other has; they hold a column (`dx`) at least."""
    tolerance = 1e-9 * length
    by_name = {inlet.name: inlet for inlet in inlets}
    for zone in zones:
        key = f"zone.{zone.name}"
        if zone.end <= zone.start:
            raise reject(span(zone.start, zone.end), "an end after the start", key=f"{key}.end")
        check_inside(key, zone.start, zone.end, length=length)
        if zone.end - zone.start < dx * (1.0 - 1e-9):
            raise reject(
                span(zone.start, zone.end),
                f"a zone of at least one column ({dx * 1e3:.3g} mm)",
                key=key,
            )
        if zone.inlet is None:
            continue
        if zone.inlet not in by_name:
            raise reject(
                repr(zone.inlet),
                f"the name of an inlet: {', '.join(by_name) or 'there is none'}",
                key=f"{key}.inlet",
                given=zone.inlet,
                known=list(by_name),
            )
        if not zone.start - tolerance <= by_name[zone.inlet].center <= zone.end + tolerance:
            raise reject(
                f"inlet {zone.inlet} at {by_name[zone.inlet].center * 1e3:g} mm",
                f"an inlet whose centre lies in the zone, {span(zone.start, zone.end)}",
                key=f"{key}.inlet",
            )
    ordered = sorted(zones, key=lambda zone: zone.start)
    for left, right in pairwise(ordered):
        if right.start < left.end - tolerance:
            raise reject(
                f"{span(right.start, right.end)} and {left.name} at {span(left.start, left.end)}",
                "zones that do not overlap",
                key=f"zone.{right.name}.start",
            )
    served = [zone.inlet for zone in zones if zone.inlet is not None]
    for inlet in served:
        if served.count(inlet) > 1:
            raise reject(
                f"inlet {inlet} in {served.count(inlet)} zones",
                "at most one zone for each inlet",
                key="zone",
            )
