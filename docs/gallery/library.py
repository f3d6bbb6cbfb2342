"""The robots of the library, each in its first configuration."""

from PIL import Image, ImageDraw

import dhkit

TILE = 220
names = dhkit.robots()
columns = 5
rows = -(-len(names) // columns)
picture = Image.new("RGB", (columns * TILE, rows * TILE), "white")
for k, name in enumerate(names):
    with dhkit.Arm.load(name).view() as view:
        tile = view.picture(size=(TILE - 10, TILE - 10))
    ImageDraw.Draw(tile).text((8, 6), name, fill="#3a4252", font_size=14)
    picture.paste(tile, (k % columns * TILE + 5, k // columns * TILE + 5))
