"""build: from a model file to a verified module in a folder.

`pipeline` is the one page to read; `stages` holds its steps, which other verbs take too. `module`
compiles and loads, `folder` puts a module in its place, `store` holds what need not be made twice.
"""
