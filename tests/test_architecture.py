"""The rooms of mpm and the direction of their imports: which may read which, and nobody the other way round.

Imports are read from the source with `ast`, those inside functions and under TYPE_CHECKING too. Fails when a module imports a room that its
own may not see, when a file stands in no room, or when two rooms come to see each other.
"""

import ast
import tomllib
from pathlib import Path

from mpm.revision import WITHOUT_NUMBERS

PACKAGE = Path(__file__).parents[1] / "mpm"
DOOR = {"__init__", "__main__", "session", "drawing", "optimise"}
"""Modules at the top that may see everything: what `import mpm` offers, `mpm plot` and `mpm optimise`."""
GROUND = {
    *("arrays", "constants", "conversion", "errors", "files", "help", "labels", "launcher", "markup", "metric", "parallel", "plain"),
    *("revision", "screen", "signals", "spelling", "units"),
}  # fmt: skip
"""Modules at the top that see nothing but each other."""
MODEL = {"case", "physics"}
PARTS = MODEL | {"motion", "mesh", "numerics", "flow"}
MAY_SEE = {
    "physics": set(),
    "numerics": set(),
    "case": {"physics"},
    "motion": MODEL,
    "mesh": MODEL | {"numerics"},
    "flow": MODEL | {"motion", "mesh", "numerics"},
    "transport": PARTS,
    "report": MODEL | {"motion", "mesh"},
    "output": MODEL | {"motion", "mesh", "report"},
    "advice": MODEL | {"motion", "mesh", "report", "output"},
    "pictures": MODEL | {"motion", "mesh", "report", "output", "advice"},
    "sweep": MODEL | {"report", "output", "advice", "pictures"},
    "page": MODEL | {"mesh", "report", "output", "advice", "pictures", "sweep"},
    "reactor": PARTS | {"transport", "report", "output", "advice", "pictures", "page"},
    "dem": MODEL,
    "guide": MODEL | {"report", "output", "dem", "sweep"},
    "cli": PARTS
    | {"report", "output", "advice", "pictures", "page", "sweep", "reactor", "dem", "guide", "door"},
}
"""Room: the rooms that it may import, beside the ground floor. No room is in the list of one that it lists."""


def modules() -> dict[str, Path]:
    found = {}
    for path in PACKAGE.rglob("*.py"):
        parts = path.relative_to(PACKAGE.parent).with_suffix("").parts
        found[".".join(parts[:-1] if parts[-1] == "__init__" else parts)] = path
    return found


MODULES = modules()


def room_of(module: str) -> str:
    """`mpm.flow.problem` -> flow; modules at the top are ground or door."""
    _, _, inside = module.partition(".")
    first = inside.split(".")[0]
    if first in MAY_SEE:
        return first
    return "ground" if first in GROUND else "door"


def imports(module: str) -> set[str]:
    """Modules of mpm that a module imports, wherever in it."""
    path = MODULES[module]
    package = module if path.name == "__init__.py" else module.rpartition(".")[0]
    found = set()
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            found |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            above = package.split(".")[: len(package.split(".")) + 1 - node.level] if node.level else []
            base = ".".join([*above, *([node.module] if node.module else [])])
            found |= {
                f"{base}.{alias.name}" if f"{base}.{alias.name}" in MODULES else base for alias in node.names
            }
    return {name for name in found if name in MODULES and name != module}


def test_every_module_stands_in_a_room() -> None:
    """Fails when a file is put at the top, where there is no room that says what it is for."""
    at_the_top = {path.stem for path in PACKAGE.glob("*.py")}
    assert at_the_top == DOOR | GROUND
    folders = {path.parent.name for path in PACKAGE.glob("*/*.py")}
    assert folders == set(MAY_SEE)


def test_imports_go_one_way() -> None:
    """Fails with the arrows that go against the direction."""
    breaches = [
        f"{module} imports {other}: {here} may not see {there}"
        for module in MODULES
        for other in sorted(imports(module))
        for here, there in [(room_of(module), room_of(other))]
        if here not in ("door", there) and there != "ground" and there not in MAY_SEE.get(here, set())
    ]
    assert breaches == []


def test_no_two_rooms_see_each_other() -> None:
    """Fails when the table itself allows a circle."""
    order: list[str] = []
    left = {room: seen - {"door"} for room, seen in MAY_SEE.items()}
    while left:
        free = [room for room, seen in left.items() if seen <= set(order)]
        assert free, f"a circle among {sorted(left)}"
        order += free
        left = {room: seen for room, seen in left.items() if room not in free}


def test_files_do_not_import_each_other_in_a_circle() -> None:
    """Fails when two files need each other, be it for a type alone: neither can be read without the other."""
    left = {module: imports(module) for module in MODULES}
    while free := {m for m, seen in left.items() if not seen & left.keys()}:
        left = {module: seen for module, seen in left.items() if module not in free}
    while free := left.keys() - set().union(*left.values()):  # those that only lead to a circle
        left = {module: seen for module, seen in left.items() if module not in free}
    assert not left, f"a circle among {sorted(left)}"


def test_every_room_says_what_it_is_for() -> None:
    """Fails when a room has no sentence at its door."""
    for room in MAY_SEE:
        said = ast.get_docstring(ast.parse((PACKAGE / room / "__init__.py").read_text(encoding="utf-8")))
        assert said and said.splitlines()[0].endswith("."), room


def test_an_installation_has_every_package() -> None:
    """Fails when a package, or a package within one, is missing in the list of pyproject.toml: only a working copy would have it."""
    project = tomllib.loads((PACKAGE.parent / "pyproject.toml").read_text(encoding="utf-8"))
    packages = {".".join(p.parent.relative_to(PACKAGE.parent).parts) for p in PACKAGE.rglob("__init__.py")}
    assert packages <= set(project["tool"]["setuptools"]["packages"])


def test_what_changes_no_number_is_where_the_revision_looks_for_it() -> None:
    """Fails when a file that the digest of a run's sources leaves out has moved, so that the digest would count it."""
    gone = [name for name in WITHOUT_NUMBERS if not (PACKAGE / name).exists()]
    assert gone == ["cases"]  # which stand in the package when it is installed
