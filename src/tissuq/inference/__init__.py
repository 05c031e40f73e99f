"""How a posterior is found: exactly where possible, sampled where needed."""
