"""Work on the repository itself: its shape, and the files of urdf/ and meshes/."""
