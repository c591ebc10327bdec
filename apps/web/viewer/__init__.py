"""Write the page that shows a run: its views turn, and take other colours."""
