"""What an inlet that blows cold gas does to temperatures and coverage, the powder entering hot."""

from __future__ import annotations

from heat_sections.store import COLD, HOT, STEADY, Numbers, both, case_of, markdown, measured_on, run

BLOWN = "3.5 cm/s"
SAME_MOLES = f"{3.5 * COLD / HOT:.6g} cm/s"
"""The speed at which 298 K carries the moles that 3.5 cm/s carries at 473 K."""
VARIANTS: dict[str, tuple[tuple[str, ...], str]] = {
    "all at 473 K": ((), BLOWN),
    "purge at 298 K, 3.5 cm/s": (("purge",), BLOWN),
    "TMA at 298 K, 3.5 cm/s": (("tma",), BLOWN),
    "both at 298 K, 3.5 cm/s": (("purge", "tma"), BLOWN),
    "both at 298 K, 2.2 cm/s: as many moles": (("purge", "tma"), SAME_MOLES),
}
COLUMNS = (
    ("temperature.plenum.min", "coldest gas of the plenum, K", ".0f"),
    ("temperature.frit.min", "coldest of the frit, K", ".2f"),
    ("temperature.bed.min", "coldest of the bed, K", ".2f"),
    ("temperature.bed_exit", "powder leaves at, K", ".2f"),
    ("titration.tma.box_mean", "coated before the TMA port", ".3f"),
    ("titration.tma.exit_min", "coated at the exit, worst row", ".4f"),
    ("utilisation.tma", "TMA used", ".3f"),
)


def cold(variant: str, mesh: str) -> Numbers:
    """The zone of cases/heating.toml with powder that enters at 473 K, steady."""
    inlets, speed = VARIANTS[variant]
    changes = {"geometry.bed_temperature": f"{HOT} K"}
    for name in inlets:
        changes |= {
            f"geometry.inlet.{name}.temperature": f"{COLD} K",
            f"geometry.inlet.{name}.velocity": speed,
        }
    label = f"inlets-{list(VARIANTS).index(variant)}-{mesh}"
    return run(label, case_of("heating", mesh, STEADY, changes))


def table(meshes: tuple[str, ...]) -> str:
    """By what is cold: temperatures, coverage, and TMA fed over that of the hot case."""
    lines = []
    fed = cold("all at 473 K", meshes[0])["species.TMA.fed"]
    for variant in VARIANTS:
        found = [cold(variant, mesh) for mesh in meshes]
        cells = [both([n[name] for n in found], digits) for name, _, digits in COLUMNS]
        lines.append([variant, f"{found[0]['species.TMA.fed'] / fed:.3f}", *cells])
    return f"{measured_on(meshes)}\n\n" + markdown(
        ["inlets", "TMA fed", *(head for _, head, _ in COLUMNS)], lines
    )
