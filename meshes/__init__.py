"""Build meshes and finite element problems as plain data."""
