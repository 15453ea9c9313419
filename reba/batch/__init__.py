"""Many recordings: in processes or on a Dask cluster, into a dataset that resumes where it stopped."""
