// The clock of an animation and its controls.

export class Player {
  // show(time) is called whenever the time on show changes.
  constructor(root, { show }) {
    this.root = root;
    this.show = show;
    this.duration = 0;
    this.time = 0;
    this.playing = false;
    for (const name of ["play", "time", "clock", "speed", "loop"])
      this[`${name}Control`] = root.querySelector(`#${name}`);
    this.playControl.addEventListener("click", () => this.toggle());
    this.timeControl.addEventListener("input", () => {
      this.pause();
      this.seek(Number(this.timeControl.value));
    });
    this.loopControl.addEventListener("click", () => this.repeat(!this.loop));
  }

  get active() {
    return !this.root.hidden;
  }

  get loop() {
    return this.loopControl.getAttribute("aria-pressed") === "true";
  }

  reveal() {
    this.root.hidden = false;
  }

  load(duration) {
    this.duration = duration;
    this.timeControl.max = duration;
    this.timeControl.step = duration / 1000;
    this.seek(0);
    if (!matchMedia("(prefers-reduced-motion: reduce)").matches) this.play();
  }

  unload() {
    this.pause();
    this.root.hidden = true;
  }

  play() {
    if (this.time >= this.duration) this.seek(0);
    this.last = null;
    this.set(true);
  }

  pause() {
    this.set(false);
  }

  toggle() {
    this.playing ? this.pause() : this.play();
  }

  repeat(on) {
    this.loopControl.setAttribute("aria-pressed", String(on));
  }

  step(seconds) {
    this.pause();
    this.seek(this.time + seconds);
  }

  // Called for every picture; now in ms.
  tick(now) {
    if (!this.playing) return;
    const elapsed = this.last === null ? 0 : (now - this.last) / 1000;
    this.last = now;
    let time = this.time + elapsed * Number(this.speedControl.value);
    if (time >= this.duration) {
      if (this.loop) time %= this.duration;
      else this.pause();
    }
    this.seek(time);
  }

  seek(time) {
    this.time = Math.max(0, Math.min(this.duration, time));
    this.timeControl.value = this.time;
    const digits = this.duration < 100 ? 2 : 0;
    const clock = `${this.time.toFixed(digits)} / ${this.duration.toFixed(digits)} s`;
    this.clockControl.textContent = clock;
    this.timeControl.setAttribute("aria-valuetext", clock);
    this.show(this.time);
  }

  set(playing) {
    this.playing = playing;
    this.root.classList.toggle("playing", playing);
    this.playControl.setAttribute("aria-label", playing ? "Pause" : "Play");
  }
}
