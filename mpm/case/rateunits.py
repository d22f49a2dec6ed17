"""Units of rate and equilibrium constants follow from the orders of a reaction; a wrong one is one line with those that are right.

surface, of shares   mol/m^2/s (m^3/mol)^(sum eta)                         p = 0
surface, per site    the same over (mol/m^2)^(sum mu)                      p = sum mu
gas                  mol/m^3/s (m^3/mol)^(sum eta)
equilibrium          (mol/m^3)^(sum of nu of gases)
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from mpm.case.ratetables import powers_of, unit_text
from mpm.case.schema import number_text
from mpm.units import reject

_TYPICAL = {"m/s": "0.9", "1/s": "1e13", "m^3/mol/s": "1e-3", "mol/m^2/s": "1e-3"}
_TYPICAL_PER_SITE = {"1/s": "1e13", "m^2/mol/s": "1e17", "m^3/mol/s": "1e5"}
"""Numbers for examples, of constants that people write down."""


@dataclass(frozen=True)
class Orders:
    """Orders of one way of a reaction in gases and in sites; `on_surface` or in the gas."""

    gas: Mapping[str, float]
    site: Mapping[str, float]
    on_surface: bool

    @property
    def of_shares(self) -> dict[str, float]:
        """Powers of mol, m and s in the unit of A where coverages are shares (in the gas there is no other)."""
        eta = sum(self.gas.values())
        amount, length = 1.0 - eta, 3.0 * eta - (2.0 if self.on_surface else 3.0)
        return {"mol": amount, "m": length, "s": -1.0}

    @property
    def per_site(self) -> dict[str, float]:
        """The same where amounts of sites are per area."""
        mu, powers = sum(self.site.values()), self.of_shares
        return {"mol": powers["mol"] - mu, "m": powers["m"] + 2.0 * mu, "s": -1.0}

    @property
    def text(self) -> str:
        """`order 1 in H2O, 2 in *`."""
        parts = [f"{order:g} in {name}" for name, order in {**self.gas, **self.site}.items() if order]
        return f"order {', '.join(parts)}" if parts else "order 0"

    @property
    def accepted(self) -> str:
        """Units that A may have, each with an example."""
        of_shares, per_site = unit_text(self.of_shares), unit_text(self.per_site)
        number = _TYPICAL.get(of_shares, "1")
        first = f'a rate constant of {self.text}, from 0, in {of_shares}, e.g. "{number} {of_shares}"'
        if not self.on_surface or of_shares == per_site:
            return first
        number = _TYPICAL_PER_SITE.get(per_site, "1")
        return f'{first}, of coverages as shares, or per site in {per_site}, e.g. "{number} {per_site}"'

    def fits(self, text: str) -> bool:
        """Whether A has one of these units."""
        _, powers = powers_of(text)
        return _same(powers, self.of_shares) or (self.on_surface and _same(powers, self.per_site))

    def read(self, text: str, key: str, advice: str = "") -> tuple[float, float]:
        """A in SI units and the power p of the site density in the rate; the validator error with both units for another one.

        `advice` ends it, where something else than the unit may be what is wrong.
        """
        value, powers = powers_of(text)
        if _same(powers, self.of_shares):
            return value, 0.0
        if self.on_surface and _same(powers, self.per_site):
            return value, sum(self.site.values())
        raise reject(f"'{number_text(value)} {unit_text(powers)}'", f"{self.accepted}{advice}", key=key)


def _same(powers: Mapping[str, float], wanted: Mapping[str, float]) -> bool:
    return all(abs(powers[name] - wanted[name]) < 1e-6 for name in wanted)


def read_equilibrium(value: str | float, gases: float, key: str) -> float:
    """K in SI units; its unit counts the gases that a reaction makes, less those that it takes."""
    wanted = {"mol": gases, "m": -3.0 * gases, "s": 0.0}
    unit = unit_text(wanted)
    if isinstance(value, float):
        if not unit:
            return value
    else:
        number, powers = powers_of(value)
        if _same(powers, wanted):
            return number
        value = f"{number_text(number)} {unit_text(powers)}"
    made = (
        f"the reaction makes {gases:+g} molecules of gas" if gases else "as many molecules of gas come as go"
    )
    accepted = (
        f'an equilibrium constant in {unit}, e.g. "0.5 {unit}"'
        if unit
        else "a number without a unit, e.g. 0.5"
    )
    raise reject(f"{value!r}, where {made}", accepted, key=key)
