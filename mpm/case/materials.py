"""Porous materials: the table `[material.NAME]` of a case, and the materials that need no table.

Built-in values are those of the thesis, chapter 5: porosity, permeability and tortuosity factors from table 5.4
(permeability is printed in "um^-2", um^2 is meant), surface to volume ratio, site density and solids from table
5.3, particle size and sphericity of the glass beads (GL56) from table 3.2. Tables 5.3 and 5.4 disagree about the
surface: 5.3, with which the thesis computed, has 58,000 1/m (bed) and 100,000 1/m (frit); 5.4 has 73,000 and
62,000 1/m per total volume. Felt and mesh keep the frit value of 5.3, the only one it gives. Where the thesis contradicts itself the
tables are taken: the sphericity is 0.79 (0.80 under table 5.4), the mesh has its larger factor through the plane (its smaller, says the
text). docs/source.md lists such places.
"""

from __future__ import annotations

from typing import Annotated, Any, Self

from pydantic import BeforeValidator, ConfigDict, PlainSerializer, WithJsonSchema, model_validator

from mpm.case.model import Frozen, nothing_required
from mpm.constants import AVOGADRO
from mpm.physics.porous import (
    bosanquet,
    knudsen_diffusivity,
    kozeny_carman,
    particle_surface,
    slip_factor,
)
from mpm.units import (
    Conductivity,
    Coverage,
    Density,
    Diameter,
    Dimension,
    HeatCapacity,
    Kozeny,
    PerLength,
    Porosity,
    Positive,
    Sphericity,
    describe,
    in_range,
    reject,
    worked_out,
)

SITE_DENSITIES = {
    "thesis": 6.92e-8,
    "one-per-24-square-angstrom": 1.0 / (24e-20 * AVOGADRO),
}
"""Named site densities [mol/m2]. The thesis divides by "24 nm2" per site; the chemistry says 24 square angstrom,
which gives 100 times as many sites: with it nothing titrates at the doses of the thesis."""

_SITES = Dimension("mol/m^2", "a site density", "6.92e-8 mol/m^2", above=0.0)
_AREA = Dimension("m^2", "a permeability", "4.25 um^2", above=0.0)
_NUMBER = Dimension("", "a tortuosity factor", "1.48", above=0.0)


def _site_density(value: Any) -> float:
    if isinstance(value, str) and value in SITE_DENSITIES:
        return SITE_DENSITIES[value]
    if isinstance(value, str) and not any(character.isdigit() for character in value.split(" ")[0]):
        names = ", ".join(SITE_DENSITIES)
        raise reject(
            repr(value), f"{_SITES.accepted}, or a preset: {names}", given=value, known=list(SITE_DENSITIES)
        )
    return _SITES.read(value)


def _per_direction(dimension: Dimension) -> tuple[Any, ...]:
    """Annotations of a property that is one value, or two: along the reactor and through the layer."""

    def read(value: Any) -> tuple[float, float]:
        if not isinstance(value, (list, tuple)):
            both = dimension.read(value)
            return both, both
        if len(value) != 2:
            raise reject(describe(value), f"{dimension.accepted}, or two of them: along x, then along y")
        return dimension.read(value[0]), dimension.read(value[1])

    def write(pair: tuple[float, float]) -> Any:
        return dimension.write(pair[0]) if pair[0] == pair[1] else [dimension.write(value) for value in pair]

    one = {"type": "string" if dimension.unit else "number", "examples": [dimension.example]}
    schema = {
        "anyOf": [one, {"type": "array", "items": one, "minItems": 2, "maxItems": 2}],
        **dimension.about,
    }
    return BeforeValidator(read), PlainSerializer(write, when_used="json"), WithJsonSchema(schema)


# The inner type of the pairs is a bare float: `read` has converted it already.
_PairOfAreas = Annotated[tuple[float, float], *_per_direction(_AREA)]
_PairOfNumbers = Annotated[tuple[float, float], *_per_direction(_NUMBER)]
_Sites = Annotated[
    float,
    BeforeValidator(_site_density),
    PlainSerializer(_SITES.write, when_used="json"),
    WithJsonSchema(
        {
            "type": "string",
            **_SITES.about,
            "examples": [_SITES.example, *SITE_DENSITIES],
            "presets": [*SITE_DENSITIES],
        }
    ),
]


PACKED_SPHERES = 5.0
"""Kozeny's constant of packed spheres (Carman 1937)."""


class Material(Frozen):
    """A rigid porous solid, homogeneous within its layer. Pairs are (along the reactor, through the layer)."""

    model_config = ConfigDict(json_schema_extra=nothing_required)

    porosity: Porosity
    """share of the layer's volume between the particles, which gas fills"""
    permeability: _PairOfAreas = worked_out(
        "Kozeny-Carman from porosity, particle_diameter, sphericity and kozeny_constant", (0.0, 0.0)
    )
    """how easily gas flows through the layer (Darcy): one value, or two, along the reactor and through the layer"""
    tortuosity_factor: _PairOfNumbers = worked_out("Bruggeman: porosity^-0.5", (0.0, 0.0))
    """tau^2 in the effective diffusivity, porosity D / tau^2: one value, or two, along the reactor and through the layer"""
    surface_to_volume: PerLength = worked_out("6 (1 - porosity) / (sphericity particle_diameter)")
    """reactive surface per total volume of the layer: with site_density it decides how much precursor the layer takes up"""
    site_density: _Sites = SITE_DENSITIES["thesis"]
    """reactive sites per surface, a value or a preset: "thesis" is one site per 24 nm^2, "one-per-24-square-angstrom" 100 times as many"""
    initial_coverage: dict[str, Coverage] = worked_out(
        "all sites are the mechanism's first one, the fresh surface", {}, example={"OH": 1.0}
    )
    """share of the sites in each state when the solids come in; they sum to 1"""
    viscosity_ratio: Positive = 1.0
    """effective viscosity over that of the gas in the Brinkman term, which counts within a few pores of the layer's faces"""
    density: Density | None = None
    """density of the solid itself, without pores: for minimum fluidisation in `mpm check`"""
    particle_diameter: Diameter | None = None
    """mean diameter of the particles: for permeability and surface_to_volume where these are left out, and for fluidisation"""
    sphericity: Sphericity = 1.0
    """surface of a sphere of the particle's volume over the particle's surface; 1: spheres"""
    kozeny_constant: Kozeny | None = worked_out(
        "5, packed spheres, where particle_diameter has to give the permeability", None
    )
    """constant of Kozeny-Carman, with which particle_diameter gives the permeability"""
    heat_capacity: HeatCapacity | None = None
    """of the solid, by mass; read where there is a table [energy]"""
    conductivity: Conductivity | None = None
    """thermal conductivity of the solid itself; read where there is a table [energy]"""
    effective_conductivity: Conductivity | None = None
    """thermal conductivity of solid and gas together, measured, in place of energy.conductivity_model"""
    pore_diameter: Diameter | None = None
    """width of the pores, for gas so thin that its molecules meet walls as often as each other: slip (more permeability) and Knudsen
    diffusion (less diffusivity); left out: neither"""

    def slip_permeability(self, free_path: float) -> tuple[float, float]:
        """Permeability [m2] for a gas of mean free path `free_path` [m]: `permeability` where no pore_diameter is given (Klinkenberg)."""
        if self.pore_diameter is None:
            return self.permeability
        factor = slip_factor(free_path, self.pore_diameter)
        return self.permeability[0] * factor, self.permeability[1] * factor

    def pore_diffusivity(self, diffusivity: float, molar_mass: float, temperature: float) -> float:
        """Diffusivity [m2/s] between the walls of the pores of a species with `diffusivity` in free gas: the same without pore_diameter.

        Porosity and tortuosity come on top of it (`mpm.physics.porous.effective_diffusivity`).
        """
        if self.pore_diameter is None or diffusivity == 0.0:
            return diffusivity
        return bosanquet(diffusivity, knudsen_diffusivity(self.pore_diameter, molar_mass, temperature))

    @model_validator(mode="after")
    def _fill_in(self) -> Self:
        given, d = self.model_fields_set, self.particle_diameter
        surface = None if d is None else particle_surface(self.porosity, d, self.sphericity)
        if self.kozeny_constant is not None and surface is not None and "permeability" in given:
            k = kozeny_carman(
                porosity=self.porosity, surface_to_volume=surface, constant=self.kozeny_constant
            )
            if any(abs(given_k - k) > 1e-9 * k for given_k in self.permeability):  # a resolved case has both
                raise reject(
                    f"kozeny_constant, which makes {k:.4g} m^2, beside another permeability",
                    "one of them",
                    key="kozeny_constant",
                )
        if "permeability" not in given:
            if surface is None:
                raise reject(
                    "nothing",
                    'a permeability, e.g. "4.25 um^2", or a particle_diameter, with which sphericity and kozeny_constant give one',
                    key="permeability",
                )
            constant = self.kozeny_constant or PACKED_SPHERES
            k = kozeny_carman(porosity=self.porosity, surface_to_volume=surface, constant=constant)
            self._fill(permeability=(in_range("permeability", k, "m^2"),) * 2, kozeny_constant=constant)
        if "tortuosity_factor" not in given:
            self._fill(tortuosity_factor=(self.porosity**-0.5,) * 2)
        if "surface_to_volume" not in given:
            if surface is None:
                raise reject(
                    "nothing",
                    'a surface per total volume, e.g. "58000 1/m", or a particle_diameter',
                    key="surface_to_volume",
                )
            self._fill(surface_to_volume=in_range("surface_to_volume", surface, "1/m"))
        if self.initial_coverage and abs(sum(self.initial_coverage.values()) - 1.0) > 1e-9:
            raise reject(
                f"coverages that sum to {sum(self.initial_coverage.values()):g}",
                "coverages that sum to 1",
                key="initial_coverage",
            )
        return self


_STEEL = {"density": "8030 kg/m^3", "heat_capacity": "503 J/kg/K", "conductivity": "16.3 W/m/K"}

BUILT_IN: dict[str, dict[str, Any]] = {
    "glass_beads": {
        "porosity": 0.46,
        "permeability": "4.25 um^2",
        "tortuosity_factor": 1.48,
        "surface_to_volume": "58000 1/m",
        "particle_diameter": "56 um",
        "sphericity": 0.79,
        "density": "2500 kg/m^3",
        "heat_capacity": "871 J/kg/K",
        "conductivity": "1.3 W/m/K",
    },
    "sintered_powder": {
        "porosity": 0.37,
        "permeability": "2.76 um^2",
        "tortuosity_factor": [2.85, 2.68],
        "surface_to_volume": "100000 1/m",
        **_STEEL,
    },
    "frit_felt": {
        "porosity": 0.68,
        "permeability": "3.66 um^2",
        "tortuosity_factor": [1.675, 1.40],
        "surface_to_volume": "100000 1/m",
        **_STEEL,
    },
    "frit_mesh": {
        "porosity": 0.40,
        "permeability": "17.93 um^2",
        "tortuosity_factor": [1.775, 2.52],
        "surface_to_volume": "100000 1/m",
        **_STEEL,
    },
}
"""Tables of the built-in materials, as a case file would write them. In-plane tortuosity factors are the means of the
two directions of table 5.4 (the powder's 2.86 and 2.83 make 2.85)."""
