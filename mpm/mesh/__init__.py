"""Where everything is: the grid of a case, its gmsh file, and the distributed mesh, the holder of lengths and volumes."""
