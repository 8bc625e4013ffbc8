"""The atlas: what a vehicle can do, exactly, before it is built.

Rotors that turn from a least to a largest speed attain a convex set of wrenches whose facets are
known in closed form. So tilt, force, push, moment, margin, acceleration and payload are read off
exactly, with their gradients, in microseconds.

Facets are found in `fullam.model.attainable`: they depend on the rotors alone.

Modules, inner ones first:
    loads      what the rotors have to hold: weight, centre of mass, tool wrench
    rays       how far from a wrench in a direction, and to the nearest bound
    tilt       how far the vehicle can lean: rose, worst, best, intervals
    hover      the rotor speeds of least effort
    envelope   all of it for one arm pose
    batches    tilts for many arm poses at once
    contacts   where a figure ends
    gradients  how it changes with the vehicle, and what is true at kinks
    failures   all of it for every single failed rotor
"""
