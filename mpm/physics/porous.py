"""What a porous medium makes of the laws of its gas: one number, or an array with a number for each row or cell."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray


def effective_diffusivity[Value: (float, NDArray[np.float64])](
    diffusivity: float | Value, porosity: Value, tortuosity_factor: Value
) -> Value:
    """D_eff = porosity D / tau^2 [m2/s], with D of free gas and tau^2 the tortuosity factor (TauFactor's, table 5.4 of the thesis).

    Both are 1 in free gas. The thesis prints D eps/tau with tau a ratio of lengths (5-6) and leaves the flux in its porous zones
    unreduced (5-12, 5-13): docs/source.md says what either changes.
    """
    return porosity * diffusivity / tortuosity_factor
