"""What `mpm check` says of the conventions of a case: the switches that are not this model's own, in words, and those that do not fit."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import TYPE_CHECKING, Any

from mpm.case.conventions import PRESETS, SWITCHES, conventions_of, switches

if TYPE_CHECKING:
    from mpm.case.case import Case

WORDS: Mapping[tuple[str, Any], str] = {
    ("transport.scheme", "upwind"): "species and heat by first-order upwinding, which adds |u| h/2 to diffusion",
    ("transport.scheme", "central"): "species and heat by central differences, by upwinding where a cell has |u| h/D above 2",
    ("transport.backflow_rows", 2): "an outlet draws back in the mean of two rows of cells",
    ("porous.diffusion", "free"): "pores leave diffusion as it is: D, not eps D/tau^2",
    ("porous.diffusion", "printed"): "diffusion in pores eps D/tau, not eps D/tau^2",
    ("porous.inertia", "superficial"): "gas in pores weighs eps rho du/dt + rho u.grad u, not (rho/eps) du/dt + (rho/eps^2) u.grad u",
    ("porous.reaction_volume", "total"): "gas reactions run in the whole volume of a porous layer, R, not in its gas, eps R",
    ("motion.drag_reference", "superficial"): "a moving bed drags towards u = v_s, not eps v_s: 1/eps times as much gas in its pores",
    ("geometry.inlet_diffusion", True): "inlets let species diffuse in and back out, too",
}  # fmt: skip
"""Each value that is not this model's own, with its equation."""


def differing(case: Case) -> dict[str, str]:
    """What a case does otherwise than this model does by itself, in words by the dotted key of the switch."""
    return {key: WORDS[key, value] for key, value in switches(case).items() if (key, value) in WORDS}


def convention_numbers(case: Case) -> dict[str, Any]:
    """The table `conventions` of `mpm check --json`: that of summary.json, and what differs in words."""
    return {**conventions_of(case), "differing": differing(case)}


def convention_caveats(case: Case) -> list[str]:
    """Drag and inertia that do not belong together: the gas would then know how fast its observer goes.

    Where gas leaves a bed it brings its velocity along: u/eps or u, by `porous.inertia`. Both are v_s above and below the face of a bed
    that drags towards u = eps v_s or u = v_s, and only then (tests/test_conventions.py, all solids moving at v). Mixed, the gas beside the
    bed is off by 0.6 to 1.4 % of v_s where it seeps at 0.2 cm/s, by 9 to 19 % at 3 cm/s.
    """
    mixed = (case.motion.drag_reference == "superficial") != (case.porous.inertia == "superficial")
    if not mixed or not _drags(case):
        return []
    reference, inertia = case.motion.drag_reference, case.porous.inertia
    solid = case.geometry.moving_layer
    eps = solid.solid.porosity if solid is not None else 1.0
    share = eps if reference == "pore" else 1.0 / eps
    return [
        f'motion.drag_reference = "{reference}" does not go with porous.inertia = "{inertia}": gas that leaves the bed brings '
        f"{share:.3g} times the bed's velocity along instead of all of it, and the flow depends on the frame of the observer; "
        'take "pore" with "interstitial", or "superficial" with "superficial"'
    ]


def idle_switches(case: Case) -> Iterator[tuple[str, str]]:
    """Switches that somebody set otherwise than the preset of the case does and that nothing reads, each with the reason; the preset itself
    where every switch is typed, as in the case.toml of a run, and none as it would have it."""
    usual = PRESETS[case.conventions]
    own = {key: usual.get(key, _default(case, key)) for key in SWITCHES}
    if "conventions" in case.model_fields_set and all(switches(case)[key] != own[key] for key in SWITCHES):
        yield "conventions", "every switch is typed, and otherwise"
    for key, why in _unread(case).items():
        table, _, last = key.partition(".")
        if last in case.typed(table) and switches(case)[key] != own[key]:
            yield key, why


def _default(case: Case, key: str) -> Any:
    table, _, last = key.partition(".")
    return type(getattr(case, table)).model_fields[last].get_default()


def _unread(case: Case) -> dict[str, str]:
    geometry = case.geometry
    found: dict[str, str] = {}
    if all(layer.material is None for layer in geometry.layers):
        found |= {key: "no layer is porous" for key in SWITCHES if key.startswith("porous.")}
    elif not case.mechanism.gas_reactions:
        found["porous.reaction_volume"] = "nothing reacts in the gas"
    if geometry.moving_layer is None:
        found["motion.drag_reference"] = "no layer moves"
    elif not _drags(case):
        found["motion.drag_reference"] = "the bed is at rest"
    if not geometry.outlets:
        found["transport.backflow_rows"] = "there is no outlet"
    if not geometry.inlets:
        found["geometry.inlet_diffusion"] = "there is no inlet"
    return found


def _drags(case: Case) -> bool:
    """Whether a bed moves past the mesh at any time of the run."""
    if case.geometry.moving_layer is None:
        return False
    return case.conveying_velocity != 0.0 or (case.follows_cycle and case.motion.gamma > 0.0)
