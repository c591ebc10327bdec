"""Run many sheets: a table of jobs, workers, what a person sees, and the data set of it."""
