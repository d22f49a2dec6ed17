"""Values on their way into JSON."""

import json
import math

import numpy as np
import pytest

from mpm.errors import MpmError
from mpm.plain import json_text, plain


def test_what_is_not_finite_is_left_out_and_told() -> None:
    """Fails when NaN reaches a file, a list keeps a hole that shifts its entries, or a loss is told of another place."""
    lost: list[tuple[str, float]] = []
    value = {
        "array": np.arange(3.0),
        "count": np.int64(3),
        "flag": True,
        "none": None,
        "inner": {"speed": np.float64(math.inf), "name": "bed"},
        "list": [1.0, math.nan],
    }
    found = plain(value, "summary.json", lambda where, number: lost.append((where, number)))
    assert found == {"array": [0.0, 1.0, 2.0], "count": 3, "flag": True, "inner": {"name": "bed"}}
    assert [where for where, _ in lost] == ["summary.json: inner: speed", "summary.json: list[1]"]
    assert json.loads(json_text(value)) == found
    with pytest.raises(MpmError, match="what: set is not a number"):
        plain({"what": {1}})
