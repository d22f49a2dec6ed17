"""How the command line explains itself: whole sentences at any width, verbs in the order in which they are used, an example for each.

A verb's text is its docstring. Lines of it that begin with `mpm` or `mpirun` are examples: the command, two blanks or more, what it does.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping, Sequence
from typing import Any, ClassVar

import typer
from typer.core import TyperCommand, TyperGroup

GROUPS = {
    "Before a run": ("new", "list", "explain", "check", "mesh", "mechanism", "schema"),
    "Run": ("run", "resume", "watch"),
    "After a run": ("report", "plot", "paraview", "compare"),
    "Many runs": ("sweep", "optimise"),
    "Powder": ("dem",),
}
"""The verbs in the order in which people meet them; others come last."""
_EXAMPLE = re.compile(r"((?:mpm|mpirun) .*?)(?:\s{2,}(.*))?")
HELP_NAMES = {"help_option_names": ["-h", "--help"]}


class Verb(TyperCommand):
    """A verb whose help shows its examples before its arguments and options."""

    def collect_usage_pieces(self, ctx: Any) -> list[str]:
        return [*(_name(a, ctx) for a in self.get_params(ctx) if _is_argument(a)), "[OPTIONS]"]

    def format_help(self, ctx: Any, formatter: Any) -> None:
        self.format_usage(ctx, formatter)
        _write_text(self.help or "", formatter)
        _write_parameters(self, ctx, formatter)


class Verbs(TyperGroup):
    """A program of several verbs; its help lists them in `groups` with their whole first sentences."""

    groups: ClassVar[Mapping[str, Sequence[str]]] = GROUPS

    def collect_usage_pieces(self, ctx: Any) -> list[str]:
        return ["VERB ..."]

    def format_help(self, ctx: Any, formatter: Any) -> None:
        self.format_usage(ctx, formatter)
        _write_text(self.help or "", formatter)
        found = ((name, self.get_command(ctx, name)) for name in self.list_commands(ctx))
        left = {name: command for name, command in found if command is not None and not command.hidden}
        for heading, names in [*self.groups.items(), ("Others" if self.groups else "Verbs", tuple(left))]:
            rows = [(name, _sentence(left.pop(name))) for name in names if name in left]
            if rows:
                with formatter.section(heading):
                    formatter.write_dl(rows)
        _write_parameters(self, ctx, formatter)


class App(typer.Typer):
    """An application of `Verb`s."""

    def command[Function: Callable[..., Any]](
        self, name: str | None = None, **options: Any
    ) -> Callable[[Function], Function]:
        return super().command(name, **{"cls": Verb, **options})


def example_of(text: str) -> str:
    """The first example in the text of a verb; empty without one."""
    found = (_EXAMPLE.fullmatch(line.strip()) for line in text.splitlines())
    return next((match[1] for match in found if match), "")


def missing(error: Any) -> str | None:
    """What is said when a verb lacks an argument; None for an error of another kind."""
    parameter, ctx = getattr(error, "param", None), getattr(error, "ctx", None)
    if type(error).__name__ != "MissingParameter" or parameter is None or ctx is None:
        return None
    example = example_of(ctx.command.help or "")
    shown = f"; for example: {example}" if example else ""
    path = ctx.command_path
    return f"{path}: {_name(parameter, ctx)} is missing: {parameter.help}{shown} ({path} -h explains more)"


def _sentence(command: Any) -> str:
    """The first paragraph of a command's help."""
    return " ".join((command.help or "").partition("\n\n")[0].split()).removesuffix(".")


def _is_argument(parameter: Any) -> bool:
    return bool(parameter.param_type_name == "argument")


def _name(parameter: Any, ctx: Any) -> str:
    """An argument as it is written in a usage line: `CASE`, `[VERB]`, `DIR...`."""
    name = parameter.metavar or parameter.name.upper()
    name += "..." if parameter.nargs != 1 and not name.endswith("...") else ""
    return name if parameter.required else f"[{name}]"


def _write_text(text: str, formatter: Any) -> None:
    """Paragraphs, and examples with their comments in a column or, where that is too wide, above them."""
    for paragraph in text.split("\n\n"):
        lines = [line.strip() for line in paragraph.replace("\b", "").splitlines() if line.strip()]
        if not lines:
            continue
        formatter.write_paragraph()
        examples = [_EXAMPLE.fullmatch(line) for line in lines]
        with formatter.indentation():
            if not all(examples):
                formatter.write_text(" ".join(lines))
                continue
            pairs = [(match[1], match[2]) for match in examples if match]
            wide = max((len(command) for command, _ in pairs), default=0)
            longest = wide + max((len(comment or "") for _, comment in pairs), default=0) + 4
            for command, comment in pairs:
                if comment and longest > formatter.width - 2:
                    formatter.write_text(f"# {comment}")
                beside = (
                    f"{command:{wide}}  # {comment}"
                    if longest <= formatter.width - 2 and comment
                    else command
                )
                formatter.write(f"  {beside}\n")


def _write_parameters(command: Any, ctx: Any, formatter: Any) -> None:
    """Arguments and options with their whole descriptions."""
    parameters = [p for p in command.get_params(ctx) if not p.hidden]
    arguments = [(_name(p, ctx), p.help or "") for p in parameters if _is_argument(p)]
    options = [_option(p) for p in parameters if not _is_argument(p)]
    for heading, rows in (("Arguments", arguments), ("Options", options)):
        if rows:
            with formatter.section(heading):
                formatter.write_dl(rows, col_max=26)


def _option(parameter: Any) -> tuple[str, str]:
    """An option's names with what they take, and its description with its default."""
    names = ", ".join(sorted(parameter.opts, key=len))
    if not parameter.is_flag:
        names += f" {parameter.metavar or parameter.name.upper()}"
    if "--help" in parameter.opts:
        return names, "this text"
    default = parameter.default
    shown = parameter.show_default and isinstance(default, (int, float, str)) and not parameter.is_flag
    return names, (parameter.help or "").removesuffix(".") + (f" (default: {default})" if shown else "")
