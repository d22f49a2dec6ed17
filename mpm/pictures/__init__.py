"""Pictures, movies, ParaView scripts, and how objects show themselves in a notebook."""
