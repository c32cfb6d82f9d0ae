"""The mechanism: modes, inverse and forward solutions, Jacobians, singularities, workspace."""
