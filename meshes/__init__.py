"""Quadrilateral meshes with named sets, written and read by meshio."""
