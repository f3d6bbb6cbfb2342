"""A box after three rotations and translations about fixed and current axes, as the course's first assignment."""

import numpy as np
from matplotlib.figure import Figure
from mpl_toolkits.mplot3d.art3d import Poly3DCollection

import dhkit

SIZE = np.array([0.4, 0.2, 0.1])
corners = SIZE * [[x, y, z] for x in (0, 1) for y in (0, 1) for z in (0, 1)]
faces = [[0, 1, 3, 2], [4, 5, 7, 6], [0, 1, 5, 4], [2, 3, 7, 6], [0, 2, 6, 4], [1, 3, 7, 5]]

turned = dhkit.pose((0, 0, 0), euler=(0, 0, 30), degrees=True)
moved = turned @ dhkit.pose((0, 0.45, 0))
tilted = moved @ dhkit.pose((0, 0, 0), euler=(60, 0, 0), degrees=True)

picture = Figure(figsize=(7, 5), layout="constrained")
axes = picture.add_subplot(projection="3d")
for T, color in zip(
    (np.eye(4), turned, moved, tilted), ("#c9ced6", "#8fb6ff", "#4f83d6", "#d9480f"), strict=True
):
    points = corners @ T[:3, :3].T + T[:3, 3]
    axes.add_collection3d(
        Poly3DCollection(points[faces], facecolor=color, edgecolor="#3a4252", alpha=0.9)
    )
axes.view_init(elev=28, azim=-35)
axes.set(
    xlim=(-0.4, 0.5),
    ylim=(-0.1, 0.8),
    zlim=(0, 0.4),
    xlabel="x [m]",
    ylabel="y [m]",
    zlabel="z [m]",
)
axes.set_box_aspect((9, 9, 4))
