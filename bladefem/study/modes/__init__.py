"""Studies of the modes: surveys, Campbell, convergence, stresses, linear responses."""
