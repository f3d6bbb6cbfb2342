// The edge of an area that a person drags, or moves with arrow keys.

const STEP = 24; // px that an arrow key moves it

// edge: the element that is held; keys: the two arrow keys, of which the second makes the area larger.
// sizeAt(event): size of the area where the pointer is, px; size(): its present size; take(size): what sets it.
export function draggedEdge(edge, { keys, sizeAt, size, take }) {
  edge.addEventListener("pointerdown", (event) => {
    edge.setPointerCapture(event.pointerId);
    const move = (moved) => take(sizeAt(moved));
    const end = () => edge.removeEventListener("pointermove", move);
    edge.addEventListener("pointermove", move);
    edge.addEventListener("lostpointercapture", end, { once: true });
  });
  edge.addEventListener("keydown", (event) => {
    const direction = keys.indexOf(event.key);
    if (direction < 0) return;
    event.preventDefault();
    event.stopPropagation();
    take(size() + (direction ? STEP : -STEP));
  });
}
