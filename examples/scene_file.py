"""Scene file.

A scene names layers; the layers that these need are added. A wrong name is an error that lists the known
ones.
"""

from pydantic import ValidationError

from handpipe.core.configuration import Scene

scene = Scene(layers=("bones", "fat"), frames="config/scenes/hand-preview.csv")
print("layers asked for:", ", ".join(scene.layers))
print("layers computed: ", ", ".join(scene.needed))
assert scene.needed[0] == "bones" and scene.needed[-1] == "fat"

try:
    Scene(layers=("bone",), frames="x.csv")
except ValidationError as error:
    print("refused:", error.errors()[0]["msg"])
else:
    raise AssertionError("the layer is unknown")
