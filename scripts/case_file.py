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
