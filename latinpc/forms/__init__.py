"""Form finding: shapes in equilibrium, from force densities or from natural lengths."""
