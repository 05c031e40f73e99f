"""Pictures of a posterior: what was measured, what is predicted and how sure it is, put together from pieces."""
