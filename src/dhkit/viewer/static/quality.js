// What a slow machine can do without: after a run of late pictures the scene is drawn more plainly, for good.

const LATE = 42; // ms from a picture to the browser's next frame
const PATIENCE = 6; // late pictures more than timely ones
const PAUSE = 400; // ms: the page was hidden, or busy with something else
const SETTLES = 1000; // ms from a new scene on: its programs are compiled, and pictures are late for that

// Whether this browser has no graphics processor to draw with.
export function drawnInSoftware() {
  const context = document.createElement("canvas").getContext("webgl");
  const about = context?.getExtension("WEBGL_debug_renderer_info");
  const name = about ? context.getParameter(about.UNMASKED_RENDERER_WEBGL) : "";
  context?.getExtension("WEBGL_lose_context")?.loseContext();
  return /swiftshader|llvmpipe|softpipe|software|basic render/i.test(name);
}

export class Quality {
  // savings: functions to call, one after the other, the least missed first.
  constructor(savings) {
    this.savings = [...savings];
    this.late = 0;
    this.picture = -Infinity; // ms, when the last frame began if it drew a picture
    this.settled = 0; // ms, from when on late pictures count
  }

  // Called for a new scene.
  begin() {
    this.settled = performance.now() + SETTLES;
  }

  // Called at the beginning of every frame of the browser; now in ms.
  frame(now) {
    const interval = now - this.picture;
    this.picture = -Infinity;
    if (interval > PAUSE || now < this.settled || !this.savings.length) return;
    this.late = Math.max(0, this.late + (interval > LATE ? 1 : -1));
    if (this.late >= PATIENCE) this.save();
  }

  // Called when a picture was drawn in the frame that began at this time.
  drawn(now) {
    this.picture = now;
  }

  saveAll() {
    while (this.savings.length) this.save();
  }

  save() {
    this.late = 0;
    this.savings.shift()?.();
  }
}
