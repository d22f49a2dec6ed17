"""The sketch of the strip: everything in it, where it belongs, at any width."""

from pathlib import Path

import pytest

from mpm.advice.sketch import ASCII, BOXES, pen_for, sketch
from mpm.case.case import Case, load_case

FOUR = Path(__file__).parents[1] / "meshes" / "four_cycles.toml"
WIDTHS = [40, 60, 80, 140]


def case_of(name: str) -> Case:
    """A case by name: a built-in, or the zone with ports at both ends."""
    if name == "four_cycles":
        return load_case(FOUR)
    if name != "ends":
        return load_case(name)
    return load_case(
        "single_zone",
        {"geometry.outlet.zone1.center": "5 mm", "geometry.inlet.tma.center": "137.7 mm", "geometry.periodic": False},
    )  # fmt: skip


@pytest.mark.parametrize("pen", [BOXES, ASCII])
@pytest.mark.parametrize("width", WIDTHS)
@pytest.mark.parametrize("name", ["single_zone", "single_cycle", "four_cycles", "ends"])
def test_everything_is_in_the_sketch(name: str, width: int, pen: object) -> None:
    """Fails when a line is too long, a name is cut or overwritten, or a layer, port or end is missing."""
    case = case_of(name)
    lines = sketch(case, width, pen)  # type: ignore[arg-type]
    assert max(map(len, lines)) <= width
    words = " ".join(" ".join(lines).split())
    geometry = case.geometry
    for layer in geometry.layers:
        assert f"{layer.name}: {layer.height * 1e3:g} mm" in words
    for port in (*geometry.inlets, *geometry.outlets):
        assert f"{port.name} (" in words
    assert f"{geometry.length * 1e3:g} mm" in words
    assert ("comes back at the left" in words) == geometry.periodic
    assert ("ends: walls" in words) != geometry.periodic


@pytest.mark.parametrize("width", WIDTHS)
@pytest.mark.parametrize("name", ["single_zone", "single_cycle", "four_cycles", "ends"])
def test_ports_stand_where_they_are(name: str, width: int) -> None:
    """Fails when an opening is more than a character away from its port, points the wrong way, or a port has none."""
    case = case_of(name)
    lines = sketch(case, width)
    walls = {
        "top": next(line for line in lines if line.startswith("┌")),
        "bottom": next(line for line in lines if line.startswith("└")),
    }
    scale = (width - 2) / case.geometry.length
    inlets = case.geometry.inlets
    for port in (*inlets, *case.geometry.outlets):
        upwards = (port.side == "bottom") == (port in inlets)
        middle = 1 + int(port.center * scale)
        assert ("↑" if upwards else "↓") in walls[port.side][middle - 1 : middle + 2]
    openings = sum(line.count("↑") + line.count("↓") for line in walls.values())
    widths = sum(port.width for port in (*inlets, *case.geometry.outlets))
    ports = len(inlets) + len(case.geometry.outlets)
    assert abs(openings - widths * scale) <= ports


def test_names_hang_at_their_ports() -> None:
    """Fails when the leader of a name does not begin at its port, or the name does not follow the leader."""
    lines = sketch(case_of("single_zone"), 80)
    wall = next(i for i, line in enumerate(lines) if line.startswith("└"))
    for name in ("purge", "tma"):
        place = lines[wall + 2].index(name)
        assert lines[wall + 1][place] == "│" and lines[wall][place] == "↑"


def test_zones_and_the_way_of_the_bed(tmp_path: Path) -> None:
    """Fails when a zone's name is missing where there is room, or a bed that moves left, or not at all, is drawn as moving right."""
    zones = [f"zone{i}" for i in range(1, 9)]
    assert any(
        line.startswith(" |") and all(zone in line for zone in zones) for line in sketch(load_case(FOUR), 60)
    )
    assert "moves right at 1.3 cm/s →→→" in "\n".join(sketch(case_of("single_zone"), 60))
    still = load_case("single_zone", {"motion.bed_velocity": "0 m/s"})
    assert "does not move" in "\n".join(sketch(still, 60))
    rows = "".join(f"{phase},-0.01,0,1\n" for phase in range(0, 360, 5))
    (tmp_path / "p.csv").write_text(f"phase_deg,u_x_m/s,u_y_m/s,contact\n{rows}")
    left = load_case("single_zone", {"motion.profile": str(tmp_path / "p.csv")})
    assert "moves left at 1 cm/s <<<" in "\n".join(sketch(left, 60, ASCII))


def test_long_names_are_wrapped_or_listed() -> None:
    """Fails when a name that fits nowhere beside its port is cut."""
    name = "the_port_with_a_name_that_is_longer_than_the_strip_is_wide"
    tables = {
        "geometry": {
            "length": "10 mm",
            "cell_width": "1 mm",
            "layer": [{"name": "bed", "height": "1 mm", "cells": 2}],
            "inlet": [{"name": name, "center": "9.5 mm", "width": "1 mm", "side": "top"}],
            "outlet": [{"name": "out", "center": "0.5 mm", "width": "1 mm", "side": "bottom"}],
        }
    }
    lines = sketch(load_case(tables), 40)
    assert any(line.split() == [name] or f"1 {name} (N2)" in line for line in lines)
    assert "↓" in lines[1] and "out (out)" in "\n".join(lines)


@pytest.mark.parametrize(
    ("encoding", "pen"), [("utf-8", BOXES), ("ascii", ASCII), ("latin-1", ASCII), ("?", ASCII)]
)
def test_the_pen_fits_the_encoding(encoding: str, pen: object) -> None:
    assert pen_for(encoding) == pen
    if pen is ASCII:
        "\n".join(sketch(case_of("single_zone"), 80, ASCII)).encode("ascii")
