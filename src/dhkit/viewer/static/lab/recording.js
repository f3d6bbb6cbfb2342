// A video of the scene while an animation plays, as WebM.

const RATE = 30; // pictures per second
const FORMATS = ["video/webm;codecs=vp9", "video/webm;codecs=vp8", "video/webm", "video/mp4"];

// The format that this browser records, or null.
export function videoFormat() {
  if (!globalThis.MediaRecorder) return null;
  return FORMATS.find((format) => MediaRecorder.isTypeSupported(format)) ?? null;
}

// Play an animation once from its beginning, and return the video.
export async function recorded(canvas, player) {
  const recorder = new MediaRecorder(canvas.captureStream(RATE), { mimeType: videoFormat() });
  const parts = [];
  recorder.addEventListener("dataavailable", ({ data }) => parts.push(data));
  const stopped = new Promise((done) => recorder.addEventListener("stop", done));
  const loops = player.loop;
  player.repeat(false);
  player.seek(0);
  recorder.start();
  player.play();
  while (player.playing) await new Promise(requestAnimationFrame);
  recorder.stop();
  await stopped;
  player.repeat(loops);
  return new Blob(parts, { type: recorder.mimeType });
}
