"""PETSc, MPI and the finite-element stack; knows no reactor."""
