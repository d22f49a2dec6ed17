"""The result of a run in a sentence or two: what leaves coated, its worst row, use of the precursor, parasitic growth, temperature."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

from mpm.report.dosing import zone_of

if TYPE_CHECKING:
    from mpm.case.case import Case

NOTHING = 1e-12
"""A share below which there is nothing: rounding of a solver that converges to 1e-10 of the feed."""
TRACE = 1e-5
"""A share below which its digits say nothing to people: "less than 0.001 %"."""
REMAINDER = 1e-3
"""Shares closer to 0 or 1 than this are printed with more digits: 99.98 % is not 100 %."""


def percent(share: float) -> str:
    """A share as a percentage of three digits, not rounded to 0 or 100 when it is more than NOTHING away from them."""
    if abs(share) < NOTHING:
        return "0 %"
    if share == 1.0:
        return "100 %"
    if 0.0 < share < TRACE:
        return f"less than {100.0 * TRACE:g} %"
    if 1.0 - REMAINDER < share < 1.0:
        lacking = f"{100.0 * (1.0 - share):.1g}"
        digits = len(lacking.partition(".")[2])
        return f"{100.0 * share:.{digits}f} %" if digits and "e" not in lacking else "almost 100 %"
    return f"{100.0 * share:.3g} %"


def percents(shares: Sequence[float]) -> str:
    """One share, or the range of several."""
    low, high = percent(min(shares)), percent(max(shares))
    return low if low == high else f"{low} to {high}"


def verdict(case: Case, summary: Mapping[str, Any]) -> str:
    """What a run says about its case, in words; for a run that is not done, how it ended first."""
    steady = summary.get("fidelity") == "steady"
    parts = [
        *(_coating(case, summary) or [_no_coating(case)]),
        *_growth(case, summary),
        *_warmth(case, summary),
    ]
    when = "In the steady state" if steady else f"After {summary.get('simulated_seconds', 0.0):.4g} s"
    return f"{_ended(summary)}{when}, {'; '.join(parts)}."


def _ended(summary: Mapping[str, Any]) -> str:
    status = summary.get("status", "unfinished")
    return "" if status == "done" else f"The run has not ended as planned ({status}). "


def _coating(case: Case, summary: Mapping[str, Any]) -> list[str]:
    """A part for each half-reaction: inlets that make the same of the surface are told together."""
    reported = summary.get("titration", {})
    alike: dict[tuple[str | None, str], list[str]] = {}
    for inlet in case.geometry.inlets:
        if "exit_mean" in reported.get(inlet.name, {}):
            species = case.precursor(inlet)
            alike.setdefault((species, _made(case, species)), []).append(inlet.name)
    return [_of_inlets(case, summary, species, made, names) for (species, made), names in alike.items()]


def _no_coating(case: Case) -> str:
    """Why no coverage is reported where solids leave a zone."""
    from mpm.report.coating import conveyed_layer

    dosing = [inlet for inlet in case.geometry.inlets if case.precursor(inlet) is not None]
    if conveyed_layer(case) is None or not dosing:
        return "nothing has been coated: no inlet doses a surface"
    if all(zone_of(case, inlet) is None for inlet in dosing):
        return "no coverage is reported: no zone is that of a dosing inlet (geometry.zone.NAME.inlet)"
    unchanged = [
        name for inlet in dosing if (name := case.precursor(inlet)) and not case.sites_made_by(inlet)
    ]
    if len(unchanged) == len(dosing):
        names = list(dict.fromkeys(unchanged))
        leave = "leave" if len(names) > 1 else "leaves"
        return f"no coverage is reported: {' and '.join(names)} {leave} the sites as they are"
    return "no coverage has been reported"


def _of_inlets(
    case: Case, summary: Mapping[str, Any], species: str | None, made: str, names: Sequence[str]
) -> str:
    entries = [summary["titration"][name] for name in names]
    zone = f"the zone{'s' if len(names) > 1 else ''} of {', '.join(names)}"
    conveyed = case.conveying_velocity != 0.0
    where = f"powder leaves {zone}" if conveyed else f"powder at the end of {zone} stands there"
    text = f"{where} with {percents([entry['exit_mean'] for entry in entries])} of its sites {made}"
    worst = [entry["exit_min"] for entry in entries if "exit_min" in entry]
    if worst:
        text += f" (worst row {percent(min(worst))})"
    used = [summary["utilisation"][name] for name in names if name in summary.get("utilisation", {})]
    if used and species is not None:
        text += f", where {percents(used)} of the {species} fed was used"
    return text


def _made(case: Case, species: str | None) -> str:
    """What the half-reaction of a precursor makes of the sites."""
    sites = () if species is None else case.mechanism.titrated_sites(species)
    *first, last = sites or ("",)
    return f"turned into {', '.join(first)}{' or ' if first else ''}{last}" if sites else "coated"


def growth_share(case: Case, summary: Mapping[str, Any]) -> float | None:
    """Parasitic gas reactions over the run as the largest share of a fed precursor that they have taken; None without such reactions."""
    numbers = summary.get("cvd", {})
    total, used = numbers.get("total"), numbers.get("used")
    if total is None:
        return None
    fed = {name: entry.get("fed", 0.0) for name, entry in summary.get("species", {}).items()}
    if used is None:
        used = {
            species: -count * total
            for reaction in case.mechanism.parasitic_reactions
            for species, count in reaction.nu_gas.items()
            if count < 0.0
        }
    shares = [amount / fed[name] for name, amount in used.items() if fed.get(name, 0.0) > 0.0]
    return max(shares, default=None)


def _growth(case: Case, summary: Mapping[str, Any]) -> list[str]:
    share = growth_share(case, summary)
    if share is None:
        return ["no parasitic growth in the gas"] if case.mechanism.parasitic_reactions else []
    return [
        "no parasitic growth in the gas"
        if share < NOTHING
        else f"parasitic growth in the gas took {percent(share)} of a precursor"
    ]


def _warmth(case: Case, summary: Mapping[str, Any]) -> list[str]:
    """With what temperature powder enters and leaves."""
    leaves = summary.get("temperature", {}).get("bed_exit")
    if leaves is None:
        return []
    enters = "" if case.geometry.bed_inflow == "periodic" else f" that enters at {case.bed_temperature:.0f} K"
    way = summary.get("heating", {}).get("length")
    after = "" if way is None else f", most of the way made after {way * 1e3:.0f} mm"
    return [f"powder{enters} leaves at {leaves:.0f} K{after}"]
