"""The result of a run in a sentence or two: what leaves coated, its worst row, how much of the precursor was used, and parasitic growth."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from mpm.case import Case, Inlet

NOTHING = 1e-12
"""A share below which there is nothing: rounding of a solver that converges to 1e-10 of the feed."""
REMAINDER = 1e-3
"""Shares closer to 0 or 1 than this are printed with more digits: 99.98 % is not 100 %."""


def percent(share: float) -> str:
    """A share as a percentage of three digits, not rounded to 0 or 100 when it is more than NOTHING away from them."""
    if share < NOTHING or share == 1.0:
        return f"{100.0 * share:.0f} %"
    if 1.0 - REMAINDER < share < 1.0:
        lacking = f"{100.0 * (1.0 - share):.1g}"
        digits = len(lacking.partition(".")[2])
        return f"{100.0 * share:.{digits}f} %" if digits and "e" not in lacking else "almost 100 %"
    return f"{100.0 * share:.3g} %"


def verdict(case: Case, summary: Mapping[str, Any]) -> str:
    """What a run says about its case, in words; for a run that is not done, how it ended first."""
    steady = summary.get("fidelity") == "steady"
    parts = [*_coating(case, summary), *_growth(case, summary)]
    when = "In the steady state" if steady else f"After {summary.get('simulated_seconds', 0.0):.4g} s"
    sentence = (
        f"{when}, {'; '.join(parts)}."
        if parts
        else f"{when}, nothing has been coated: no inlet doses a surface."
    )
    return f"{_ended(summary)}{sentence}"


def _ended(summary: Mapping[str, Any]) -> str:
    status = summary.get("status", "unfinished")
    return "" if status == "done" else f"The run has not ended as planned ({status}). "


def _coating(case: Case, summary: Mapping[str, Any]) -> list[str]:
    parts = []
    conveyed = case.conveying_velocity != 0.0
    for name, titration in summary.get("titration", {}).items():
        inlet = next((i for i in case.geometry.inlets if i.name == name), None)
        species = None if inlet is None else case.mechanism.precursor(inlet.mass_fractions)
        if "exit_mean" in titration:
            where = (
                f"powder leaves the zone of {name}"
                if conveyed
                else f"powder at the end of the zone of {name} stands there"
            )
            text = f"{where} with {percent(titration['exit_mean'])} of its sites {_made(case, inlet)}"
            if "exit_min" in titration:
                text += f" (worst row {percent(titration['exit_min'])})"
            used = summary.get("utilisation", {}).get(name)
            if used is not None and species is not None:
                text += f", where {percent(used)} of the {species} fed was used"
            parts.append(text)
    return parts


def _made(case: Case, inlet: Inlet | None) -> str:
    """What this inlet's half-reaction has made of the sites."""
    species = None if inlet is None else case.mechanism.precursor(inlet.mass_fractions)
    sites = () if species is None else case.mechanism.titrated_sites(species)
    return f"turned into {' or '.join(sites)}" if sites else "coated"


def growth_share(case: Case, summary: Mapping[str, Any]) -> float | None:
    """Parasitic gas reactions over the run as the largest share of a fed precursor that they have taken; None without such reactions."""
    total = summary.get("cvd", {}).get("total")
    if total is None:
        return None
    fed = {name: entry.get("fed", 0.0) for name, entry in summary.get("species", {}).items()}
    shares = [
        -count * total / fed[species]
        for reaction in case.mechanism.gas_reactions
        for species, count in reaction.nu.items()
        if count < 0.0 and fed.get(species, 0.0) > 0.0
    ]
    return max(shares, default=None)


def _growth(case: Case, summary: Mapping[str, Any]) -> list[str]:
    share = growth_share(case, summary)
    if share is None:
        return ["no parasitic growth in the gas"] if case.mechanism.gas_reactions else []
    return [
        "no parasitic growth in the gas"
        if share < NOTHING
        else f"parasitic growth in the gas took {percent(share)} of a precursor"
    ]
