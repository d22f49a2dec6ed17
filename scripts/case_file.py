"""Write docs/case_file.md, the reference of the case file, from what `mpm explain` knows: python scripts/case_file.py"""

from __future__ import annotations

from pathlib import Path

from mpm.case.keys import Key, all_keys, keys_of

HEAD = """\
# The case file

A case is a TOML file. Every value that has a dimension is a string with its unit (`"3.5 cm/s"`), and what is left out has a default.
`mpm new FILE` writes a case with all keys in it, `mpm explain KEY` says on the screen what stands here, and more: an example, which
fidelities read a key, and which keys belong together. In `--set` and in sweeps a key is written with dots, list entries by their names:
`geometry.inlet.tma.velocity`.

This file is written by `scripts/case_file.py` from the descriptions in the program.

## Temperature

Without a table `[energy]` all is at `gas.temperature`, always. With it, even an empty one, gas and solids have a temperature field:

```toml
[geometry]
base = "single_zone"
bed_temperature = "25 degC"        # powder that enters; left out, as everywhere below: gas.temperature

[[geometry.wall]]                  # the frit's plate is heated left of the purge port, from x = 0
side = "bottom"
end = "30 mm"
temperature = "200 degC"

[[geometry.wall]]                  # the roof loses heat to the room
name = "roof"
side = "top"
end = "90 mm"
heat_transfer_coefficient = "10 W/m^2/K"
ambient = "25 degC"

[[geometry.inlet]]
name = "purge"
temperature = "300 K"              # of the gas that it blows, at its velocity

[energy]
conductivity_model = "zehner_bauer_schluender"
```

* A temperature has a unit: `"473 K"`, `"200 degC"` (or °C), `"392 degF"`. A bare number is refused.
* A wall is a stretch of a side with one condition: `temperature`, `heat_flux` (into the strip), or `heat_transfer_coefficient` with
  `ambient`. `start` and `end` count along x, at the ends of a closed strip (`geometry.periodic = false`, `side = "left"` or `"right"`)
  from the bottom upwards; left out, they are those of the whole side. Walls overlap neither each other nor ports: a heated plate with
  ports in it is several walls, from port to port. What has no wall is insulated. A wall without a name is called after its side:
  `bottom`, `bottom2` ...
* `geometry.layer.NAME.heating` is heat that is set free in a layer from without.
* Every porous layer needs `density`, `heat_capacity` and `conductivity` of its material (the built-in ones have them), or an
  `effective_conductivity` that was measured in place of the last. For glass beads in nitrogen the models lie a factor of nine apart, from
  0.08 (series) to 0.72 W/m/K (parallel, the default, which is the thesis'); `mpm check` names the one that is used.
* Heats of reaction follow from `enthalpy` (of formation, 298.15 K) of all species, sites and films that a reaction changes, or are given as
  `heat_of_reaction`. Some enthalpies of a reaction without the others are refused; where there is none its heat is 0, and `mpm check`
  says so.
* Typed properties of the gas hold at `gas.temperature`, from where they follow the carrier's own laws; diffusivities follow T^1.75.
* `gas.mixture = true`: density, viscosity and diffusivities are those of the mixture, for feeds that are not dilute.
  `species.NAME.viscosity` is that of a species alone; without it the species counts as carrier there. The number of moles that reactions
  make does not move the gas.
* Where solids come in fresh, the seam of a periodic strip conducts no heat between solids: powder that leaves does not touch what enters.
  Dispersion by vibration (`transport.vibrational_dispersion`) is that of species, not of heat.
* `material.NAME.pore_diameter`, with temperature or without: gas that is thin enough slips at the walls of the pores, K (1 + 8 l/d), and
  meets them as often as other molecules, 1/D = 1/D_m + 1/D_K. In wide pores nothing changes.

## Reactions

A mechanism is a file of species, sites, films and reactions, or these tables in the case itself:

```toml
[geometry]
base = "single_zone"

[chemistry]
mechanism = "inline"

[chemistry.species.H2O]
molar_mass = "18.02 g/mol"

[chemistry.species.O2]
molar_mass = "32.00 g/mol"

[chemistry.site."*"]                 # the first is the fresh surface; a star is a place, which has no atoms

[chemistry.site."H2O*"]

[chemistry.site.O2bridge]            # holds two places
formula = "O2"
sites = 2

[chemistry.reaction.water]           # both ways, by two constants; or equilibrium_constant = "0.5 m^3/mol", or from enthalpy and entropy
equation = "H2O + * <=> H2O*"
sticking = 0.01
reverse = { A = "1e13 1/s", Ea = "80 kJ/mol" }
coverage = { "H2O*" = { E = "5 kJ/mol" } }

[chemistry.reaction.oxygen]
equation = "O2 + 2 * -> O2bridge"
A = "0.2 m/s"
orders = { "*" = 2 }

[[geometry.inlet]]
name = "tma"
mass_fractions = { H2O = 1e-4 }
```

* `->` goes one way, `<=>` both. Elements and the number of places on the surface must balance. A site on both sides is a surface that
  stays: growth that does not end, or a catalyst. A film on the left is as thick as needed and does not slow a reaction.
* r = k ∏ C^η ∏ θ^μ, in mol of events per m² of surface and s, or per m³ of gas: C in mol/m³, θ the share of places. One way the orders
  are 1 in each reactant whatever its coefficient; both ways they are the coefficients, for only then both rest at one equilibrium.
  `orders` says otherwise (0 to 4, also of gases and sites that are no reactants); the way back of an equilibrium then changes by as much.
* The unit of `A` follows from the orders, and says what is meant. Of shares: `m/s` for one gas, `mol/m^2/s` for none. Per site, as
  Chemkin and Cantera mean it: `1/s` for a site alone, `m^2/mol/s` for two, `m^3/mol/s` for a gas and a site; it meets the material's own
  `site_density`. In the gas `1/s`, `m^3/mol/s`, `m^6/mol^2/s`; orders that are no integers have such units, `m^2.5/mol^0.5/s`.
* A way back without a constant follows from `enthalpy` and `entropy` (298.15 K) or `nasa` polynomials of all that the reaction changes,
  gases at `reference_pressure` (1 bar): K = exp(-ΔG/RT) (p0/RT)^Δn.
* `mechanism = "ptcombust.yaml"` is a file in Cantera's format, beside the case or one that Cantera has (`pip install 'mpm[chemistry]'`),
  with its `phase`. What takes part in its reactions is taken over, the site with the largest coverage in the phase's state first;
  constants per site meet the material's `site_density`, which should be the file's. Reactions are called after their `id`, else R1, R2
  ... and those in the gas G1, G2 ... in the order of the file; `gas_reactions = false` leaves these out. What has no counterpart here
  (falloff, M, Blowers-Masel, charges, polynomials of coverage) is refused by name.
"""


def reference() -> str:
    """The text of the document."""
    sections = [HEAD, "## At the top", *_table("")]
    for key in all_keys():
        if key.is_table and any(not below.is_table for below in keys_of(key.name)):
            sections += ["", f"## `{_header(key)}`", "", f"{_sentence(key.description)}.", *_table(key.name)]
    return "\n".join(sections) + "\n"


def _header(key: Key) -> str:
    if not key.entries:
        return f"[{key.name}]"
    return f"[[{key.name}]]" if "[[" in key.kind else f"[{key.name}.NAME]"


def _sentence(text: str) -> str:
    return text[:1].upper() + text[1:]


def _table(name: str) -> list[str]:
    rows = [
        f"| `{key.last}` | {_cell(key.description)} | {_cell(_takes(key))} | {_cell(_default(key))} |"
        for key in keys_of(name)
        if not key.is_table
    ]
    return ["", "| key | meaning | takes | default |", "|---|---|---|---|", *rows]


def _takes(key: Key) -> str:
    names = ", ".join(f"`{choice}`" for choice in key.choices)
    if not names:
        return f"{key.kind}, e.g. `{key.example}`" if key.example != key.default else key.kind
    return f"{key.kind}: {names}" if key.free else names


def _default(key: Key) -> str:
    if key.required or key.worked_out:
        return key.default_text
    return f"`{key.default}`" if key.default else ""


def _cell(text: str) -> str:
    return text.replace("|", "\\|").replace("<", "&lt;")


if __name__ == "__main__":
    (Path(__file__).parents[1] / "docs" / "case_file.md").write_text(reference(), encoding="utf-8")
