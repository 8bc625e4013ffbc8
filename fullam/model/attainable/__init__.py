"""The wrenches that rotors attain, as a list of half-spaces.

Modules, inner ones first:
    machine    functions on flat arrays, compiled where numba is installed
    exterior   the vector orthogonal to five others in six dimensions
    faces      all faces of the attainable wrenches, one by one
    facets     what they mean: half-spaces of wrenches; they depend on the rotors alone
"""
