"""What the gas carries and the solids keep: fluxes, one step of all species, coverage."""
