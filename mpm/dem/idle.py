"""Keys of a powder file that somebody typed and that nothing reads in this case."""

from collections.abc import Iterator

from .case import DemCase

_BAFFLE = ("baffle_height", "baffle_width")


def idle_keys(case: DemCase) -> Iterator[str]:
    """Sentences `key, key: why they have no effect`."""
    box, powder = case.box, case.build_powder()
    given, of_powder = box.model_fields_set, case.powder.model_fields_set
    for names, table, idle, why in (
        (("frit_diameter", *_BAFFLE), "box", box.base == "flat", "box.base is flat"),
        (_BAFFLE, "box", box.base == "frit", "box.base is frit"),
        (("reduced_cohesion",), "box", not box.cohesion, "box.cohesion is false"),
        (("size_classes",), "box", powder.deviation == 0.0, "all particles have one diameter"),
        (("hamaker", "wall_hamaker", "asperity"), "powder", not box.cohesion, "box.cohesion is false"),
        (
            ("stiffness",),
            "powder",
            not (box.cohesion and box.reduced_cohesion),
            "the contacts have box.stiffness",
        ),
        (("ergun",), "powder", case.gas is None, "there is no [gas]"),
    ):
        keys = [name for name in names if name in (given if table == "box" else of_powder)]
        if idle and keys:
            yield f"{', '.join(f'{table}.{name}' for name in keys)}: {why}"
