"""sweep: one model, many motions: what varies, what is kept, and chunks of both that any executor
can run."""
