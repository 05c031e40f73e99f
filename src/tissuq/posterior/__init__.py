"""The posterior as a user meets it: fitted, summarised, warned about, drawn from and saved."""
