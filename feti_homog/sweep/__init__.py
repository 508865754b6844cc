"""Many cases from one file: expanded, run here or in a job array, collected into one table."""
