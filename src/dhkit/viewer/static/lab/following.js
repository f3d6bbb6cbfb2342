// A panel whose numbers Python gives for the state on show, of the arm or of an animation, while it is open.

export class FollowingPanel {
  // request: the name of what is asked for; show(numbers) is the panel's own.
  constructor(lab, request) {
    this.lab = lab;
    this.request = request;
  }

  take_arm(arm) {
    this.arm = arm;
    this.read();
  }

  take_joints({ q }) {
    if (!this.lab.page.player.active) this.read(q);
  }

  // An animation shows these values; null: it is over.
  moved(q) {
    this.read(q ? [...q] : this.lab.state.joints?.q);
  }

  shown(visible) {
    this.visible = visible;
    const { player, motion } = this.lab.page;
    if (visible && player.active && motion?.times) this.lab.page.showTime(player.time);
    else this.read();
  }

  async read(q = this.lab.state.joints?.q) {
    if (!this.visible || !q || q.length !== this.arm?.n) return;
    const { arm } = this,
      numbers = await this.lab.ask(this.request, { q });
    if (numbers && arm === this.arm) this.show(numbers);
  }
}
