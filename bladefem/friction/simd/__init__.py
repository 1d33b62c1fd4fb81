"""The 2-D Coulomb kernel written for vectors of lanes; the plain law is one folder up."""
