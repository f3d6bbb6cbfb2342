"""The robots of the library, each in its first configuration."""

from PIL import Image, ImageDraw

import dhkit

TILE = 220
LABEL = 20
BACKGROUND = "#f4f5f7"
names = dhkit.robots()
columns = 5
rows = -(-len(names) // columns)
picture = Image.new("RGB", (columns * TILE, rows * TILE), BACKGROUND)
for k, name in enumerate(names):
    with dhkit.Arm.load(name).view() as view:
        tile = view.picture(size=(TILE, TILE - LABEL))
    left, top = k % columns * TILE, k // columns * TILE
    ImageDraw.Draw(picture).text((left + 8, top + 4), name, fill="#3a4252", font_size=14)
    picture.paste(tile, (left, top + LABEL))
