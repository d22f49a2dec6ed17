"""Laws of gases, powders and reactions without a mesh, a file or MPI: numbers or arrays in, the same out."""
