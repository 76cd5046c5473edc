"""The keys of a model file and what can stand under them: what pydantic, the JSON Schema and the
reference page read."""
