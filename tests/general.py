"""Mechanisms with any rate law, written in Python, and cases that have them: what tests of reports and advice share."""

from collections.abc import Mapping

from mpm.case.case import Case
from mpm.physics.mechanism import Mechanism
from mpm.physics.rates import Arrhenius, Law
from mpm.physics.reaction import SurfaceReaction
from mpm.physics.substances import Site, Species


def law(constant: float | None, orders: Mapping[str, float], sites: Mapping[str, float]) -> Law:
    """A law of concentrations and shares, with a constant per area."""
    return Law(
        constant=None if constant is None else Arrhenius(constant), gas_orders=orders, site_orders=sites
    )


def surface(
    key: str,
    nu: Mapping[str, float],
    forward: Law,
    backward: Law | None = None,
    gases: Mapping[str, float] | None = None,
    film: Mapping[str, float] | None = None,
    equilibrium: float | None = None,
) -> SurfaceReaction:
    """A surface reaction that changes sites by `nu` and gases by `gases` per event."""
    left = " + ".join(f"{-n:g} {name}" for name, n in {**(gases or {}), **nu}.items() if n < 0)
    return SurfaceReaction(
        key=key,
        equation=f"{left} {'->' if backward is None else '<=>'} ...",
        forward=forward,
        backward=backward,
        equilibrium=None if equilibrium is None else Arrhenius(equilibrium),
        nu_gas=gases or {},
        nu_site=nu,
        film=film or {},
    )


def mechanism(
    *reactions: SurfaceReaction, species: tuple[Species, ...], sites: tuple[Site, ...]
) -> Mechanism:
    """All of it on the surface; films are what the reactions make."""
    films = dict.fromkeys(name for r in reactions for name in r.film)
    return Mechanism(
        name="test",
        species=species,
        sites=sites,
        films=tuple(Site(name, {}) for name in films),
        surface_reactions=reactions,
        gas_reactions=(),
    )


def with_mechanism(case: Case, mechanism: Mechanism) -> Case:
    """The same case with other reactions: its tables keep those of its file."""
    changed = case.model_copy()
    changed._mechanism = mechanism
    return changed


def pair_on_two_places() -> Mechanism:
    """A2 sits down on two places as one group (AA) or as two (A), reversibly; A etches the film F, which holds one A."""
    return Mechanism(
        name="pair",
        species=(Species("A2", 0.04, {"A": 2.0}), Species("A3", 0.06, {"A": 3.0})),
        sites=(Site("*", {}), Site("A", {"A": 1.0}), Site("AA", {"A": 2.0}, places=2.0)),
        films=(Site("F", {"A": 1.0}),),
        surface_reactions=(
            surface("whole", {"*": -2.0, "AA": 1.0}, law(1.0, {"A2": 1.0}, {"*": 2.0}), gases={"A2": -1.0}),
            surface(
                "split",
                {"*": -2.0, "A": 2.0},
                law(2.0, {"A2": 1.0}, {"*": 2.0}),
                law(1.0, {}, {"A": 2.0}),
                gases={"A2": -1.0},
            ),
            surface(
                "etch", {"A": -2.0, "*": 2.0}, law(1.0, {}, {"A": 2.0}), gases={"A3": 1.0}, film={"F": -1.0}
            ),
        ),
        gas_reactions=(),
    )


SITTING = """
name = "sitting"
[species.TMA]
formula = "Al(CH3)3"
molar_mass = "72.09 g/mol"
[site.OH]
[site."TMA*"]
formula = "OHAl(CH3)3"
[reaction.sits]
equation = "OH + TMA <=> TMA*"
A = "0.9 m/s"
reverse = { A = "1e-4 mol/m^2/s" }
"""
"""TMA sits down on OH and comes off again, K = 9000 m3/mol."""


def _amounts(*elements: str) -> dict[str, dict[str, float]]:
    return {"elements": {e: float(elements.count(e)) for e in set(elements)}}


SIX_GASES = {
    "chemistry": {
        "mechanism": "inline",
        "name": "six gases",
        "species": {
            name: {"molar_mass": f"{20.0 * len(atoms)!r} g/mol", **_amounts(*atoms)}
            for name, atoms in {"A": "Q", "B": "Z", "C": "QZ", "D": "QQ", "E": "ZZ", "F": "QQZ"}.items()
        },
        "site": {"free": _amounts(), "sA": _amounts("Q"), "sB": _amounts("Z"), "sAB": _amounts("Q", "Z")},
        "reaction": {
            "r1": {"equation": "A + free <=> sA", "A": "2 m/s", "reverse": {"A": "500 1/s"}},
            "r2": {"equation": "B + free <=> sB", "A": "1 m/s", "reverse": {"A": "50 1/s"}},
            "r3": {
                "equation": "sA + sB <=> sAB + free",
                "A": "1e11 m^2/mol/s",
                "reverse": {"A": "1e9 m^2/mol/s"},
            },
            "r4": {"equation": "sAB <=> C + free", "A": "300 1/s", "reverse": {"A": "0.5 m/s"}},
            "r5": {
                "equation": "2 sA <=> D + 2 free",
                "A": "1e9 m^2/mol/s",
                "reverse": {"A": "1e5 m^5/mol^2/s"},
            },
            "r6": {
                "equation": "2 sB <=> E + 2 free",
                "A": "1e9 m^2/mol/s",
                "reverse": {"A": "1e6 m^5/mol^2/s"},
            },
            "r7": {"equation": "A + C <=> F", "A": "1 m^3/mol/s", "reverse": {"A": "0.1 1/s"}},
            "r8": {"equation": "A + sB <=> sAB", "A": "0.1 m/s", "reverse": {"A": "10 1/s"}},
        },
    },
    "geometry.inlet.tma.mass_fractions": {"A": 3e-4, "B": 2e-4},
}
"""Six gases, four kinds of site, eight reactions that all go both ways, in the single zone: changes of its case."""
