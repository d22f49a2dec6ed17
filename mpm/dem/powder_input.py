"""The powder of a powder file: `[powder]`, a built-in one or one's own."""

from dataclasses import replace
from typing import Annotated, Any

from pydantic import Field, field_validator, model_validator

from mpm.case.model import Frozen
from mpm.units import Density, Diameter, Dimension, Length, NonNegative, Positive, reject

from .powder import POWDERS, Powder

Stiffness = Annotated[float, Dimension("N/m", "a spring stiffness", "30 N/m", above=0.0)]
Hamaker = Annotated[float, Dimension("J", "a Hamaker constant", "3.1e-20 J", at_least=0.0)]
Spread = Annotated[float, Dimension("m", "a standard deviation", "13.9 um", at_least=0.0)]
Restitution = Annotated[float, Dimension("", "a coefficient of restitution", "0.97", above=0.0, at_most=1.0)]


class PowderInput(Frozen):
    """A built-in powder by name (`powder = "GL56"`), or one described or overridden key by key."""

    base: Annotated[str | None, Field(json_schema_extra={"enum": [*POWDERS]})] = None
    """a built-in powder to start from: GL50, GL29, GL56, GL223 or SS231; keys given here lie over it"""
    diameter: Diameter | None = None
    """mean diameter of the particles"""
    deviation: Spread | None = None
    """standard deviation of the diameters, by number"""
    density: Density | None = None
    """density of the solid"""
    sphericity: Annotated[float, Dimension("", "a sphericity", "0.79", above=0.0, at_most=1.0)] | None = None
    """surface of a sphere of the particle's volume over the particle's surface, in the drag"""
    friction: NonNegative | None = None
    """coefficient of friction between particles"""
    wall_friction: NonNegative | None = None
    """coefficient of friction between particle and base"""
    restitution: Restitution | None = None
    """coefficient of restitution between particles"""
    wall_restitution: Restitution | None = None
    """coefficient of restitution between particle and base"""
    hamaker: Hamaker | None = None
    """Hamaker constant between particles; 0: no cohesion"""
    wall_hamaker: Hamaker | None = None
    """Hamaker constant between particle and base"""
    asperity: Length | None = None
    """height of the roughness in the Rumpf force"""
    stiffness: Stiffness | None = None
    """spring stiffness of the real material, to which cohesion is scaled"""
    ergun: tuple[Positive, Positive] | None = None
    """factors A and B of the drag law"""

    @field_validator("base")
    @classmethod
    def known(cls, value: str | None) -> str | None:
        if value is not None and value not in POWDERS:
            raise reject(repr(value), "one of " + ", ".join(POWDERS), given=value, known=list(POWDERS))
        return value

    @model_validator(mode="after")
    def complete(self) -> "PowderInput":
        if self.base is None:
            for key in ("diameter", "density"):
                if getattr(self, key) is None:
                    raise reject("nothing", "this key, or base = one of " + ", ".join(POWDERS), key=key)
        return self

    def build(self) -> Powder:
        given: dict[str, Any] = {k: v for k, v in self if k != "base" and v is not None}
        if self.base is not None:
            powder = POWDERS[self.base]
            if not given:
                return powder
            # The fluidisation test was of the powder as it is, not of a changed one.
            return replace(powder, name=f"{self.base} (changed)", measured_umf=None, **given)
        defaults: dict[str, Any] = {"deviation": 0.0, "sphericity": 1.0, "source": "given in the powder file"}
        return Powder(name="powder", **{**defaults, **given})
