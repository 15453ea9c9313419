"""Random poses: class boxes of a domain, their distribution given a REBA class, and poses with true scores."""
