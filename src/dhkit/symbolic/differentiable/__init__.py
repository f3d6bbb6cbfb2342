"""Mechanics as CasADi expressions: frames, energies, recursive and composite-body dynamics, friction and loads."""
