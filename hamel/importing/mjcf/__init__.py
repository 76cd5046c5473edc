def robot(root, name, floating):
    root.refuse("MJCF is not read yet")
