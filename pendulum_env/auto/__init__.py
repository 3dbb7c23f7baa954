"""Choice of ``integrator="auto"``: the cheapest method and substeps with an angle error below a requested accuracy."""
