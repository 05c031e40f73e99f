"""What a run leaves behind: tables, figures and the HTML report."""
