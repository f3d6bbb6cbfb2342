// What a slow machine can do without: after a run of late pictures the scene is drawn more plainly, for good.

const LATE = 42; // ms between pictures of a motion
const PATIENCE = 6; // late pictures more than timely ones
const PAUSE = 400; // ms: nothing moved in between

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
    this.last = 0;
  }

  // Called for every picture that was drawn; now in ms.
  drawn(now) {
    const interval = now - this.last;
    this.last = now;
    if (interval > PAUSE || !this.savings.length) return;
    this.late = Math.max(0, this.late + (interval > LATE ? 1 : -1));
    if (this.late < PATIENCE) return;
    this.save();
  }

  save() {
    this.late = 0;
    this.savings.shift()?.();
  }
}
