"""Reads thousands of broken input files and reports every one that ends otherwise than in one line.

    python scripts/fuzz.py [--files 20000] [--seed 1] [--only case,sweep,powder,mechanism,data] [--keep DIR]

Valid files are broken in one to four places: keys deleted, doubled, renamed, moved; values of another type, size, sign, unit or
encoding; lines and bytes damaged. Each file is written, read as its verb reads it, and must be accepted or refused by an InputError of
one line. Cases and mechanisms that are accepted go through all of `mpm check` and come back from their own dump. The same seed makes the
same files. Numpy's warnings count as failures too: they would stand on the user's terminal.
"""

import argparse
import io
import math
import random
import signal
import sys
import tempfile
import tomllib
import traceback
import warnings
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import tomli_w
from rich.console import Console

from mpm.advice.checks import check_case
from mpm.advice.screen import print_report
from mpm.case.case import load_case
from mpm.case.marks import print_full
from mpm.case.sources import built_in_files
from mpm.dem.case import load_case as load_powder
from mpm.errors import InputError
from mpm.report.tables import print_mesh
from mpm.sweep.plan import combinations, plan
from mpm.sweep.sweepfile import read_sweep

ROOT = Path(__file__).parents[1]
FEW_POINTS = 8
"""Points of a sweep whose cases are all built."""
LONGEST = 30
"""Seconds after which a file counts as hanging."""

GEOMETRY = """[geometry]
length = "20 mm"
cell_width = "1 mm"
[[geometry.layer]]
name = "plenum"
height = "2 mm"
cells = 3
[[geometry.layer]]
name = "bed"
height = "3 mm"
cells = 4
material = "glass_beads"
moving = true
[[geometry.layer]]
name = "headspace"
height = "4 mm"
cells = 3
[[geometry.inlet]]
name = "dose"
center = "10 mm"
width = "4 mm"
velocity = "3.5 cm/s"
mass_fractions = { TMA = 2e-4 }
[[geometry.outlet]]
name = "out"
center = "15 mm"
width = "4 mm"
"""
OVER_BASE = """title = "over a base"
fidelity = "steady"
[geometry]
base = "single_zone"
cell_width = "2.33 mm"
layer = [ {name="plenum", cells=4}, {name="frit", cells=3, material="m"}, {name="bed", cells=4}, {name="headspace", cells=8, grading=1.1} ]
inlet = [ {name="tma", velocity="3 cm/s", mass_fractions={TMA=2e-4}, windows=[["0 s", "1 s"], ["2 s", "inf s"]]} ]
[material.m]
porosity = 0.4
particle_diameter = "30 um"
sphericity = 0.8
kozeny_constant = 5
[motion]
profile = "phases"
liftoff_phase = "97 deg"
contact_phase = "19 deg"
[gas]
carrier = "Ar"
diffusivity = { TMA = "2e-5 m^2/s", default = "1e-5 m^2/s" }
[chemistry.reaction.tma]
sticking = 0.01
Ea = "20 kJ/mol"
"""
HEATED = (
    GEOMETRY
    + """[[geometry.wall]]
side = "bottom"
end = "7 mm"
temperature = "200 degC"
[[geometry.wall]]
name = "roof"
side = "top"
end = "12 mm"
heat_transfer_coefficient = "10 W/m^2/K"
ambient = "300 K"
[material.glass_beads]
effective_conductivity = "0.2 W/m/K"
pore_diameter = "23 um"
[gas]
conductivity = "0.0454 W/m/K"
heat_capacity = "1040 J/kg/K"
[chemistry.reaction.tma]
heat_of_reaction = "-140 kJ/mol"
[chemistry.species.TMA]
enthalpy = "-86.5 kJ/mol"
heat_capacity = "155 J/mol/K"
[energy]
initial_temperature = "25 degC"
conductivity_model = "zehner_bauer_schluender"
flow_update = 0.02
buoyancy = false
"""
)
FILE_PROFILE = GEOMETRY + '[motion]\nprofile = "profile.csv"\n[time]\nend = "1 s"\nstep = "5 ms"\n'
SWEEPS = (
    """[sweep]
case = "single_zone"
mode = "grid"
where = ["w <= 0.004", "gamma < 0.5 or w > '3 mm'"]
columns = ["titration.*.exit_mean"]
pictures = ["titration.*.exit_mean"]
ranks = 1
[[sweep.axis]]
key = "geometry.inlet.tma.width"
name = "w"
values = ["2.2 mm", "4 mm"]
[[sweep.axis]]
key = "motion.gamma"
name = "gamma"
linspace = { start = 0.2, stop = 0.4, num = 2 }
[sweep.set]
"time.end" = "10 s"
fidelity = "steady"
[sweep.slurm]
queue = "short"
""",
    """[sweep]
case = "single_cycle"
mode = "sample"
samples = 4
method = "latin_hypercube"
seed = 3
title = "a sample"
[[sweep.axis]]
key = ["geometry.inlet.tma.velocity", "geometry.inlet.water.velocity"]
logspace = { start = "1 cm/s", stop = "4 cm/s" }
[[sweep.axis]]
key = "motion.profile"
values = ["thesis", "profile.csv"]
""",
)
POWDERS = (
    """title = "a frit"
powder = "GL56"
[waveform]
kind = "sine"
gamma = 0.30
frequency = "16 Hz"
angle = "60 deg"
angle_from = "vertical"
[box]
length = 8
depth = 4
height = 15
base = "frit"
frit_diameter = "25 um"
stiffness = "3 N/m"
[gas]
velocity = "0 m/s"
frame = "lab"
pressure = "101325 Pa"
temperature = "20 degC"
[run]
seeds = [1, 2]
cycles = 5
discard = 1
[profile]
mean_velocity = "1.3 cm/s"
""",
    """[powder]
diameter = "50 um"
density = "2500 kg/m^3"
deviation = "5 um"
friction = 0.4
ergun = [150, 1.75]
[waveform]
kind = "harmonics"
frequency = "16 Hz"
horizontal = [ { amplitude = "1.7 m/s^2", frequency = "16 Hz" } ]
vertical = [ { amplitude = "3 m/s^2", frequency = "16 Hz", phase = "10 deg" }, { amplitude = "1 m/s^2", frequency = "32 Hz" } ]
[box]
base = "sawtooth"
baffle_width = "0.5 mm"
baffle_height = "0.2 mm"
declination = "3 deg"
""",
    """powder = { base = "GL50", restitution = 0.9 }
[waveform]
kind = "accelerometer"
file = "record.csv"
harmonics = 2
unit = "g"
""",
    'powder = "GL50"\n[waveform]\nkind = "sawtooth"\ngamma = 0.5\nfrequency = "20 Hz"\nextension_ratio = 0.6\n'.replace(
        "\\\n", "\n"
    ),
    'powder = "GL50"\n[waveform]\nkind = "seed"\nharmonics = 2\ngamma = 0.4\n'.replace("\\\n", "\n"),
)
TITANIA = """name = "titania"
[species.TiCl4]
molar_mass = "189.68 g/mol"
[species.H2O]
molar_mass = "18.02 g/mol"
[species.HCl]
molar_mass = "36.46 g/mol"
elements = { H = 1, Cl = 1 }
[site.OH]
[site.OTiCl3]
molar_mass = "170 g/mol"
[film.TiO2]
density = "4000 kg/m^3"
molar_mass = "79.9 g/mol"
[reaction.chloride]
equation = "OH + TiCl4 -> OTiCl3 + HCl"
sticking = 0.02
[reaction.water]
equation = "OTiCl3 + 2 H2O -> OH + TiO2 + 3 HCl"
A = "150 cm/s"
Ea = "20 kJ/mol"
b = 0.5
reference_temperature = "473 K"
"""
PROFILE = (
    "# made by hand\nphase_deg,u_x_m/s,u_y_m/s,contact\n0,0.01,0,1\n90,0.02,0,1\n180,0.01,0,0\n270,0.0,0,0\n"
)
RECORD = "t,a_y,a_z\n" + "".join(
    f"{i / 512},{0.1 * ((i * 16 // 256) % 2 - 0.5)},{0.3 * ((i * 16 // 512) % 2 - 0.5)}\n" for i in range(256)
)
NUMBERS: tuple[Any, ...] = (
    0, 1, -1, 2, 3, 7, 1000, -0.0, 0.5, 1e-3, 1e-30, 5e-324, 1e30, 1e300, -1e300, 2**31, 2**63 - 1, -(2**63),
    float("inf"), float("-inf"), float("nan"), True, False,
)  # fmt: skip
UNITS = (
    "m", "mm", "um", "µm", "μm", "nm", "s", "ms", "Hz", "kHz", "m/s", "cm/s", "K", "degC", "°C", "ºC", "℃", "C", "deg", "rad", "Pa", "Torr",
    "mTorr", "bar", "kg/m^3", "g/mol", "kg/mol", "mol/m^2", "1/m", "m^2", "um^2", "µm²",
    "m^2/s", "Pa s", "sccm", "kJ/mol", "eV", "N/m", "J",
    "m^3/mol/s", "rpm", "", "%", "furlong", "m**", "/s", "m/", "m/0", "m^1e9", "(m", "delta_degC", "dB", "m^-1", "$", "[]", "m\u0000",
)  # fmt: skip
WORDS = (
    "", " ", "x", "nan", "inf", "none", "true", "thesis", "alumina", "inline", "TMA", "OH", "dose", "bed", "a.b", "a/b", "../x", "a\u0000b",
    "a\nb", "[/a]", "[red]", "{x}", "%s", "é", "日本", "\u202e", "\ud7ff", "😀", "A" * 300, "A" * 5000, "a b", "A + B -> C", "A => B", "->",
    "2 A -> 2 A", "1/2 A -> B", "$x$", "\x1b[2J", "-1 mm", "1,5 mm", "1e400 m", "1e-400 m", "1_000 mm", "+3 mm", "0x10 m", "1e5", "m 3",
    ".", "..", "/", "/dev/null", "/dev/zero/x", ".toml", "x.toml", "single_zone", "profile.csv", "record.csv", "N2", "GL56", "frit",
)  # fmt: skip


@dataclass(frozen=True)
class Kind:
    """One kind of file: valid examples, the name they are saved under, and what reads them."""

    name: str
    seeds: tuple[str, ...]
    file: str
    read: Callable[[Path], None]


def read_case(folder: Path, name: str = "case.toml") -> None:
    """Everything that `mpm check` and `mpm mesh` do with a case before they print, and the way back from the dump."""
    case = load_case(folder / name)
    console = Console(file=io.StringIO(), width=80, markup=False, emoji=False)
    print_report(case, check_case(case), console)
    print_full(case, console)
    if case.geometry.cells < 1e5:
        print_mesh(case, console)
    if load_case(tomllib.loads(case.to_toml())).content_hash() != case.content_hash():
        raise AssertionError("the dump is another case")


def read_sweep_file(folder: Path) -> None:
    sweep = read_sweep(folder / "sweep.toml")
    if sweep.samples <= FEW_POINTS and len(combinations(sweep)) <= FEW_POINTS:
        plan(sweep)


def read_powder(folder: Path) -> None:
    case = load_powder(folder / "powder.toml")
    case.build_waveform()
    case.diameters()
    load_powder(tomllib.loads(case.to_toml()))
    case.content_hash()


def read_mechanism(folder: Path) -> None:
    read_case(folder, "of_mechanism.toml")


def read_data(folder: Path) -> None:
    """A damaged profile or record, read by the valid files that name it."""
    try:
        read_case(folder, "of_profile.toml")
    except InputError:  # then it is a record, if anything
        load_powder(folder / "of_record.toml").build_waveform()


KINDS = {
    kind.name: kind
    for kind in (
        Kind("case", (GEOMETRY, OVER_BASE, HEATED, HEATED, FILE_PROFILE, "example"), "case.toml", read_case),
        Kind("sweep", SWEEPS, "sweep.toml", read_sweep_file),
        Kind("powder", POWDERS, "powder.toml", read_powder),
        Kind("mechanism", (TITANIA, "alumina"), "mechanism.toml", read_mechanism),
        Kind("data", (PROFILE, RECORD), "data.csv", read_data),
    )
}


def example(name: str) -> str:
    """The text of a valid file: itself, the test suite's example, or the built-in mechanism."""
    if name == "example":
        return (ROOT / "tests" / "example_case.toml").read_text(encoding="utf-8")
    if name == "alumina":
        return built_in_files("mechanisms")["alumina"].read_text(encoding="utf-8")
    return name


def junk(random: random.Random) -> Any:
    """A value that nobody expects."""
    choice = random.randrange(10)
    if choice < 3:
        return random.choice(NUMBERS)
    if choice < 6:
        return f"{random.choice(NUMBERS)!r} {random.choice(UNITS)}"
    if choice < 8:
        return random.choice(WORDS)
    inner = [] if random.random() < 0.3 else [junk(random) for _ in range(random.randrange(1, 4))]
    return inner if choice == 8 else {str(random.choice(WORDS) or "k"): value for value in inner}


def places(tree: Any, found: list[tuple[Any, Any]]) -> list[tuple[Any, Any]]:
    """(container, key) of every value of nested tables and lists."""
    for key, value in list(tree.items()) if isinstance(tree, dict) else list(enumerate(tree)):
        found.append((tree, key))
        if isinstance(value, dict | list):
            places(value, found)
    return found


def break_tree(tree: dict[str, Any], random: random.Random) -> None:
    """One change of keys or values."""
    everywhere = places(tree, [])
    if not everywhere:
        tree["x"] = junk(random)
        return
    container, key = random.choice(everywhere)
    value = container[key]
    match random.randrange(16):
        case 0:
            del container[key]
        case 1 | 2:
            container[key] = junk(random)
        case 3:
            container[key] = random.choice(([value], {"name": value}, {str(key): value}, {}, [], [[value]]))
        case 4:
            other, at = random.choice(everywhere)
            container[key] = other[at] if not _inside(other[at], container) else junk(random)
        case 5 if isinstance(container, dict):
            name = random.choice((f"{key}x", str(key).upper(), str(key)[:-1], f"{key}.{key}", *WORDS))
            container[name] = container.pop(key)
        case 6 if isinstance(container, list):
            container.append(value)
        case _ if isinstance(value, str) and value[:1].isdigit():
            container[key] = other_quantity(value, random)
        case _ if isinstance(value, int | float):
            container[key] = random.choice(NUMBERS)
        case _:
            container[key] = junk(random)


def stretch(tree: dict[str, Any], random: random.Random) -> None:
    """One number of another magnitude, which every check of types lets through."""
    numbers = [
        (container, key)
        for container, key in places(tree, [])
        if isinstance(container[key], int | float) or str(container[key])[:1].isdigit()
    ]
    if numbers:
        container, key = random.choice(numbers)
        number, _, unit = str(container[key]).partition(" ")
        factor = 10.0 ** random.choice(
            (-30, -12, -6, -3, -2, -1, -1, 0, 1, 1, 2, 3, 6, 12, 30)
        ) * random.choice((1, 2, 5))
        if unit:
            container[key] = f"{number}e{round(math.log10(factor))} {unit}"
        else:
            value = container[key] * factor if not isinstance(container[key], str) else 1.0
            container[key] = round(value) if isinstance(container[key], int) else value


def other_quantity(text: str, random: random.Random) -> Any:
    """Another number with the same unit, the same number with another, or a slip of the pen."""
    number, _, unit = text.partition(" ")
    if random.random() < 0.5:
        return f"{random.choice(NUMBERS)!r} {unit}"
    if random.random() < 0.5:
        return f"{number}e{random.randrange(-12, 13)} {unit}"
    slips = (
        number,
        unit,
        f"-{text}",
        f"{number}{unit}",
        f"{number},5 {unit}",
        f"{number} {random.choice(UNITS)}",
        1,
    )
    return random.choice(slips)


def _inside(tree: Any, container: Any) -> bool:
    """Whether `container` is a part of `tree`: then it must not be put into itself."""
    return tree is container or (
        isinstance(tree, dict | list)
        and any(container is value for at, key in places(tree, []) for value in (at, at[key]))
    )


def break_bytes(content: bytes, random: random.Random) -> bytes:
    """One change of lines or bytes."""
    place = random.randrange(len(content) + 1)
    lines = content.split(b"\n")
    match random.randrange(9):
        case 0:
            return content[:place]
        case 1:
            return content[:place] + bytes([random.randrange(256)]) + content[place + 1 :]
        case 2:
            return content[:place] + random.choice(WORDS).encode("utf-8", "replace") + content[place:]
        case 3:
            line = random.randrange(len(lines))
            return b"\n".join([*lines[:line], lines[line], *lines[line:]])
        case 4:
            line = random.randrange(len(lines))
            return b"\n".join(lines[:line] + lines[line + 1 :])
        case 5:
            random.shuffle(lines)
            return b"\n".join(lines)
        case 6:
            mark = random.choice((b"\xef\xbb\xbf", b"\xff\xfe", b"\xfe\xff", b"\xff\xfe\0\0"))
            return mark + content
        case 7:
            return content.decode("utf-8", "replace").encode(
                random.choice(("utf-16", "latin-1", "cp1252", "utf-32")), "replace"
            )
        case _:
            deep = random.choice(
                (
                    b"[" * 2000,
                    b"{a=" * 500,
                    b"9" * 5000,
                    b"x = " + b"[" * 100 + b"]" * 100 + b"\n",
                    b"a." * 3000,
                )
            )
            return content[:place] + deep + content[place:]


def broken(kind: Kind, random: random.Random) -> bytes:
    """One file of this kind, broken in one to four places."""
    text = example(random.choice(kind.seeds))
    times = random.choice((1, 1, 1, 2, 2, 3, 4))
    if kind.name == "data" or random.random() < 0.2:
        content = text.encode()
        for _ in range(times):
            content = break_bytes(content, random)
        return content
    tree = tomllib.loads(text)
    change = stretch if random.random() < 0.4 else break_tree
    for _ in range(times):
        change(tree, random)
    return tomli_w.dumps(tree).encode("utf-8", "replace")


def prepare(folder: Path) -> None:
    """The valid files that the broken ones name, or that name them."""
    for name, text in {
        "profile.csv": PROFILE,
        "record.csv": RECORD,
        "of_mechanism.toml": GEOMETRY.replace("{ TMA = 2e-4 }", "{ H2O = 2e-4 }")
        + '[chemistry]\nmechanism = "mechanism.toml"\n',
        "of_profile.toml": GEOMETRY + '[motion]\nprofile = "data.csv"\n',
        "of_record.toml": 'powder = "GL50"\n[waveform]\nkind = "accelerometer"\nfile = "data.csv"\n',
    }.items():
        (folder / name).write_text(text, encoding="utf-8")


def verdict(kind: Kind, content: bytes, folder: Path) -> tuple[str, str]:
    """`accepted`, `refused` or `failed`, and what was said."""
    (folder / kind.file).write_bytes(content)
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            kind.read(folder)
    except InputError as error:
        line = str(error)
        if line.count("\n") or not line.isprintable() or len(line) > 20_000:
            return "failed", f"a message that is not one printable line: {line!r}"
        return "refused", line
    except Exception:  # what is looked for: anything but an InputError
        return "failed", traceback.format_exc()
    return "accepted", ""


def main() -> int:
    parser = argparse.ArgumentParser(description="Read thousands of broken input files.")
    parser.add_argument("--files", type=int, default=20_000, help="how many, over all kinds")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--only", default=",".join(KINDS), help="kinds, with commas")
    parser.add_argument("--keep", type=Path, help="a directory for the files that failed")
    options = parser.parse_args()

    def hangs(*_: Any) -> None:
        raise TimeoutError(f"not read within {LONGEST} s")

    signal.signal(signal.SIGALRM, hangs)
    kinds = [KINDS[name] for name in options.only.split(",")]
    counts: Counter[tuple[str, str]] = Counter()
    places_of_failure: Counter[str] = Counter()
    with tempfile.TemporaryDirectory() as scratch:
        folder = Path(scratch)
        prepare(folder)
        for number in range(options.files):
            kind = kinds[number % len(kinds)]
            content = broken(kind, random.Random(f"{options.seed} {number}"))
            signal.alarm(LONGEST)
            status, text = verdict(kind, content, folder)
            signal.alarm(0)
            counts[kind.name, status] += 1
            if status != "failed":
                continue
            lines = text.strip().splitlines()
            where = next((line.strip() for line in reversed(lines) if "/mpm/" in line), "")
            what = f"{kind.name}: {lines[-1][:150]} | {where.rpartition('/mpm/')[2]}"
            if not places_of_failure[what] and options.keep is not None:
                options.keep.mkdir(parents=True, exist_ok=True)
                (options.keep / f"{number}_{kind.file}").write_bytes(content)
            places_of_failure[what] += 1
    for kind in kinds:
        print(
            f"{kind.name:<10}"
            + ", ".join(f"{counts[kind.name, s]} {s}" for s in ("accepted", "refused", "failed"))
        )
    for what, times in places_of_failure.most_common():
        print(f"{times:6d} {what}")
    return 1 if places_of_failure else 0


if __name__ == "__main__":
    sys.exit(main())
