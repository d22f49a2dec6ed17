"""docs/reproduction.md: the table of verdicts, a paragraph for every row that does not simply hold, and the pictures."""

from __future__ import annotations

from typing import Any

from meshes import MESHES
from mpm.files import write_atomically
from reproduction import ROWS
from reproduction.row import HOLDS
from reproduction.store import ROOT, Lab

DOCUMENT = ROOT / "docs" / "reproduction.md"
FIGURES = ROOT / "docs" / "figures"

INTRODUCTION = """# What the thesis reports, measured

Chapter 5.4.2 of the thesis that this model goes back to describes its results in words; the numbers of its figures are not
printed. Each of its statements is a row here, with a measurement that decides about it. Verdicts are computed from the measured numbers:

    python scripts/reproduce.py               # all rows: about an hour on two cores
    python scripts/reproduce.py R9            # one row
    python scripts/reproduce.py --coarse R9   # the same on the coarsest mesh
    python scripts/reproduce.py --finest R9   # on the thesis' own mesh, for R9, R10, R13 to R21, R23
    python scripts/reproduce.py --list

Runs are kept under `results/reproduce`, each an ordinary run directory that `mpm plot` and ParaView read; what was stopped goes
on. The base cases are [cases/thesis](../cases/thesis): 473 K, Gamma 0.30, 16 Hz, 60 deg, bed 1.3 cm/s, ports 4.0 mm at 3.5 cm/s,
Y_TMA = 1e-3 in one zone and 2e-4/7.5e-5 in the full cycle. *Box* is the bed from the left end of a zone to its
precursor port's centreline. Lengths upstream of a port are positive.

What is assumed because the thesis does not print it, and where the model departs from its equations: [source.md](source.md).

"""


CRITERIA = """## How the criteria came about

The statements are qualitative, so each needed a criterion, and some were changed after results had been seen. Read these verdicts
with that in mind:

* **R15** was first judged at 20 s, where it fails (unreacted share 0.286 against 0.442). It is now judged in the steady state, where it
  holds: this change turned the verdict.
* **R23** measured the front across the seam of the strip by mistake; corrected, and given a sign, it holds. Before: in part.
* **R8** took its mesh error from the two coarsest meshes, which let the ordering by Gamma pass; from the two finer ones it does not. The
  check of the bed speed at 2.5 s was added after the curves had been seen.
* **R13** was a fit of three segments, of which no condition held; times at 10 and 90 % of the rise replaced it.
* **R6** had three definitions of the front's distance (in part with the first, not reproduced with the others), **R4** had its checks
  regrouped after "not reproduced" on a coarse mesh, and **R3** was given a strip with closed ends beside the periodic one.
* The burst of CVD that a delay lowers (**R20**) exists at a port of 2.2 mm only; at 4.0 mm the rate climbs monotonically.

All rows were measured with one revision of the program, on 2026-11-26, after the shear at the face of the moving bed had been corrected
([CHANGELOG](../CHANGELOG.md)): gas at its surface now moves with the powder. Compared with the measurement before it, of 2026-11-23, that
turned four verdicts. R14 holds now. In R17 the overshoot in zone 1 at 4.0 mm is gone, but that row was on the thesis' mesh before and is
on the medium one now, so the mesh may have a part in it. In R20 the delay leaves a burst at 2.2 mm. In R8 the order by Gamma holds with
inlets at rest in the lab. A stored run is named by its case, not by the program: delete `results/reproduce` to
measure with another revision.
Explanations in the paragraphs for R14, R16 to R18 and R21 are interpretations that have not been tested on their own.

"""


def meshes_text() -> str:
    """One line on what the mesh names mean."""
    parts = []
    for name, mesh in MESHES.items():
        layers = ("plenum", "frit", "bed", "headspace")
        rows = [int(mesh[f"geometry.layer.{layer}.cells"]) for layer in layers]
        parts.append(f"*{name}*: columns of {mesh['geometry.cell_width']}, {' + '.join(map(str, rows))} rows")
    return (
        "Meshes: "
        + "; ".join(parts)
        + ". Fidelities: *averaged* (cycle-mean flow), *resolved* (every phase, periodic flow), *start-up* (every phase, flow marched from "
        "an impulsive start). Flow rows use the flow alone.\n\n"
    )


def write_report(lab: Lab, pictures: bool) -> None:
    """Write the document from the rows that have been measured, and draw the pictures anew when asked."""
    from reproduction.pictures import PICTURES, draw
    from reproduction.streamlines import STREAMS, draw_streams

    if pictures:
        lab.only_stored = True
        draw(lab, FIGURES)
        draw_streams(lab, FIGURES)
    rows = {name: found for name in ROWS if (found := measured(lab, name)) is not None}
    text = INTRODUCTION + meshes_text() + table(rows) + CRITERIA + paragraphs(rows)
    text += "## Pictures\n\n"
    for name, (_, caption) in {**STREAMS, **PICTURES}.items():
        file = next((f for f in (f"{name}.png", f"{name}.gif") if (FIGURES / f).exists()), None)
        if file is not None:
            text += f"![{caption}](figures/{file})\n\n*{caption}*\n\n"
    write_atomically(DOCUMENT, text.rstrip() + "\n")


def measured(lab: Lab, name: str) -> dict[str, Any] | None:
    """What a row measured, None when it has not been."""
    try:
        return lab.kept(name)
    except FileNotFoundError:
        return None


def table(rows: dict[str, dict[str, Any]]) -> str:
    """The table of all rows; one that has not been measured says so."""
    lines = [
        "| | figure | statement | expected | measured | verdict | mesh: fidelity | command |",
        "|---|---|---|---|---|---|---|---|",
    ]
    for name, row in ROWS.items():
        found = rows.get(name)
        cells = [name, row.figure, row.statement, row.expected]
        cells += (
            [found["measured"], f"**{found['verdict']}**", found["used"]]
            if found
            else ["", "not measured", ""]
        )
        cells.append(f"`scripts/reproduce.py {name}`")
        lines.append("| " + " | ".join(cell.replace("|", "\\|") for cell in cells) + " |")
    holds = sum(found["verdict"] == HOLDS for found in rows.values())
    fails = sum(found["verdict"].startswith("not") for found in rows.values())
    summary = (
        f"Of {len(rows)} rows measured {holds} are reproduced, {fails} are not, and "
        f"{len(rows) - holds - fails} are reproduced in part or under a condition."
    )
    return "## Verdicts\n\n" + summary + "\n\n" + "\n".join(lines) + "\n\n"


def paragraphs(rows: dict[str, dict[str, Any]]) -> str:
    """Why a row does not hold, or holds only under a condition."""
    text = "## Rows that do not hold as they stand\n\n"
    for name, found in rows.items():
        if found["verdict"] != HOLDS and found["why"]:
            text += f"**{name}, {ROWS[name].statement}.** {found['why']}\n\n"
    return text
