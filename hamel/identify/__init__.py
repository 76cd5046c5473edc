"""Parameters from measured motion: which ones a model's motion can tell, motions that tell them,
and their values."""
