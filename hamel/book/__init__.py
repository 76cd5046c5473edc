"""A book of mechanisms: a chapter for every model, each generated; ordered by topic, with contents
and an index."""
