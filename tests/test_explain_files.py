"""`mpm explain` of keys that stand in sweep, powder and mechanism files."""

import pytest

from mpm.cli import main
from mpm.errors import InputError
from mpm.guide.explain import explain
from mpm.guide.otherfiles import find_other_keys, other_keys


def test_every_key_of_every_kind_of_file_is_explained() -> None:
    """Fails when a key of one of these files has no meaning to show, or cannot be found by its name."""
    keys = other_keys()
    assert {key.file for key in keys} == {"sweep", "powder", "mechanism"} and len(keys) > 60
    assert [key.name for key in keys if not key.description] == []
    assert [key.name for key in keys if key not in find_other_keys(key.name)] == []


@pytest.mark.parametrize(
    ("name", "said"),
    [
        ("sweep.axis", "keys        key, name, values"),
        ("box.stiffness", "default     30 N/m"),
        ("linspace", "sweep.axis.linspace, of sweep files"),
        ("mode", "one of      grid, zip, sample"),
    ],
)
def test_what_is_said_of_them(name: str, said: str, capsys: pytest.CaptureFixture[str]) -> None:
    """Fails when a sweep's or a powder's key is unknown to the verb that explains keys."""
    assert main(["explain", name]) == 0
    assert said in capsys.readouterr().out


def test_a_misspelt_key_of_a_sweep_is_guessed() -> None:
    """Fails when only keys of cases are offered."""
    with pytest.raises(InputError, match=r"did you mean sweep\.axis\.linspace\?"):
        explain("sweep.axis.lnspace")
