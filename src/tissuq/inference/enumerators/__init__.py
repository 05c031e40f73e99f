"""How a posterior is summed up: weighted settings of the nonlinear parameters, everything else Gaussian at each."""
