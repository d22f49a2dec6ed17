"""How C sends messages: what it needs to know of the library that mpi4py speaks to, and of a box and its neighbours."""

from __future__ import annotations

import ctypes
from functools import cache
from typing import Any

import numpy as np

from mpm.errors import MpmError
from mpm.numerics.box import Box
from mpm.numerics.compiled import pointer

from mpi4py import MPI  # isort: skip  (after the finite-element stack)

HANDLE = MPI._sizeof(MPI.Comm)
"""Bytes of a handle of MPI: those of an integer or of a pointer, whichever the library takes."""


@cache
def addresses() -> dict[str, int]:
    """Those of the functions of MPI that box.c calls, by the names that it has for them. Raises MpmError where they cannot be found."""
    library = ctypes.CDLL(MPI.__file__)
    names = {"isend": "MPI_Isend", "recv": "MPI_Recv", "wait": "MPI_Wait", "allreduce": "MPI_Allreduce"}
    try:
        found = {key: ctypes.cast(getattr(library, name), ctypes.c_void_p) for key, name in names.items()}
    except AttributeError as error:
        raise MpmError(
            f"{MPI.__file__}: this build of mpi4py hides the functions of MPI ({error})"
        ) from error
    return {key: address.value or 0 for key, address in found.items()}


class Neighbourhood:
    """A `box` as C of `module` knows it, in `known`, with room for messages of `room` numbers."""

    def __init__(self, module: Any, box: Box, room: int):
        seams, comm = box.seams, box.comm
        self._buffers = [np.zeros(max(room, 1)) for _ in range(3)]
        sent_start, sent_end, taken = map(pointer, self._buffers)
        handles = (MPI._handleof(one) for one in (comm, MPI.DOUBLE, MPI.SUM))
        self.known = module.ffi.new("Box *")
        known, cast = self.known, module.ffi.cast
        known.rows, known.columns = box.shape
        known.rank, known.ranks = comm.rank, comm.size
        known.neighbour = [-1 if seam is None else seam.rank for seam in seams]
        known.facing = [0 if seam is None else seam.side for seam in seams]
        known.earlier = [seam is not None and seam.earlier for seam in seams]
        known.communicator, known.number, known.sum = (cast("long", handle) for handle in handles)
        known.sent, known.taken = [sent_start, sent_end], taken
        for name, address in addresses().items():
            setattr(known, name, cast("void *", address))

    def check(self) -> None:
        """Raise what MPI has told of."""
        error, self.known.error = self.known.error, 0
        if error:
            raise MPI.Exception(error)
