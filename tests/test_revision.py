"""Which program has made a result: the digest of the sources that decide its numbers."""

from pathlib import Path

import pytest

from mpm import revision


def test_the_digest_follows_what_decides_numbers(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Fails when an edited law, or one under another name, leaves the digest as it was, or a picture changes it."""
    digest = revision.digest.__wrapped__  # past the cache
    monkeypatch.setattr(revision, "PACKAGE", tmp_path)
    law, picture = tmp_path / "physics" / "law.py", tmp_path / "pictures" / "map.py"
    for file in (law, picture):
        file.parent.mkdir()
        file.write_text("x = 1\n")
    before = digest()
    assert len(before) == 8 and int(before, 16) >= 0
    picture.write_text("x = 2\n")
    assert digest() == before
    law.write_text("x = 2\n")
    edited = digest()
    law.rename(law.with_name("other.py"))
    assert len({before, edited, digest()}) == 3


def test_the_revision_names_version_and_digest() -> None:
    """Fails when what summary.json and `mpm --version` say does not tell one source from another."""
    assert f"({revision.digest()})" in revision.revision()
