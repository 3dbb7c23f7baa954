"""Choice of ``integrator="auto"``: the cheapest method and substeps that keep the angle's error below a given accuracy.
"""
