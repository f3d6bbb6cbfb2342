// An assignment: its texts, its goals, and which of them Python has found to be met.

import { h, onTyped } from "./dom.js";
import { remember, remembered } from "./memory.js";

export class TaskPanel {
  static optional = true; // the tab is hidden until there is an assignment

  constructor(lab, root) {
    this.lab = lab;
    this.root = root;
    this.title = h("h2", {}, "");
    this.points = h("p", { class: "facts", role: "status" });
    this.bar = h("progress", { "aria-label": "Points" });
    this.note = h("p", { class: "hint", hidden: true });
    this.list = h("div", { class: "tasks" });
    this.reset = h(
      "button",
      {
        title: "Forget which goals were reached",
        onclick: () => lab.ask("task.reset"),
      },
      "Reset",
    );
    this.student = h("input", {
      type: "text",
      class: "wide",
      maxLength: 100,
      "aria-label": "Your name",
    });
    onTyped(
      this.student,
      () => lab.ask("task.name", { name: this.student.value }),
      () => (this.student.value = this.task?.student ?? ""),
    );
    this.recorded = h("p", { class: "hint" });
    this.handing = h(
      "div",
      { hidden: true },
      h("label", { class: "line" }, "Your name ", this.student),
      this.recorded,
    );
    root.append(
      this.title,
      this.handing,
      this.points,
      this.bar,
      this.note,
      this.list,
      h("div", { class: "buttons" }, this.reset),
    );
  }

  take_task(task) {
    this.lab.showTab("task", Boolean(task));
    for (const { name } of this.lab.panels)
      if (name !== "task")
        this.lab.showTab(name, !task?.panels || task.panels.includes(name), "task");
    this.task = task;
    if (!task) return;
    this.handing.hidden = !task.file;
    this.recorded.textContent = task.file
      ? `Your work is recorded in ${task.file}: hand this file in.`
      : "";
    if (document.activeElement !== this.student) this.student.value = task.student;
    const key = JSON.stringify([
      task.title,
      task.steps.map((step) => [
        step.title,
        step.text,
        step.panel,
        step.goals.map((goal) => goal.text),
      ]),
    ]);
    if (key !== this.key) this.build(task, key);
    const goals = task.steps.flatMap((step) => step.goals),
      met = goals.filter((goal) => goal.met).length;
    this.title.textContent = task.title;
    this.points.textContent = goals.length
      ? `${number(task.points)} of ${number(task.most)} points, ${met} of ${goals.length} goals`
      : "";
    this.bar.hidden = !task.most;
    this.bar.max = task.most || 1;
    this.bar.value = task.points;
    this.note.textContent = task.note ?? "";
    this.note.hidden = !task.note;
    this.reset.disabled = !met;
    this.reset.hidden = Boolean(task.file); // what is recorded stays
    task.steps.forEach((step, k) => this.mark(step, this.steps[k]));
  }

  // The assignment is opened when it comes for the first time; a page that is loaded again stays where it was.
  build(task, key) {
    this.key = key;
    this.steps = task.steps.map((step, k) => this.step(step, k));
    this.list.replaceChildren(...this.steps.map((step) => step.root));
    const first = task.steps.findIndex((step) => step.goals.some((goal) => !goal.met));
    this.steps[Math.max(0, first)].root.open = true;
    if (remembered("assignment", "") === task.title) return;
    remember("assignment", task.title);
    this.lab.openPanel("task");
  }

  step({ title, text, panel, goals }, k) {
    const count = h("small");
    const marks = goals.map((goal, j) => this.goal(goal, k, j));
    const paragraphs = text
      .split(/\n[ \t]*\n/)
      .map((one) => one.trim())
      .filter(Boolean)
      .map((one) => h("p", {}, one));
    const open =
      panel &&
      h(
        "div",
        { class: "buttons" },
        h(
          "button",
          { onclick: () => this.lab.openPanel(panel) },
          `Open panel ${this.lab.panelTitle(panel)}`,
        ),
      );
    const root = h(
      "details",
      {},
      h("summary", {}, h("span", {}, `${k + 1}. ${title}`), count),
      paragraphs,
      open,
      goals.length
        ? h(
            "ul",
            { class: "goals" },
            marks.map((mark) => mark.root),
          )
        : null,
    );
    return { root, count, marks };
  }

  goal({ text, points, number: asked }, step, goal) {
    const sign = h("span", { class: "sign", "aria-hidden": "true" }),
      word = h("span", { class: "word" });
    const root = h(
      "li",
      {},
      sign,
      h(
        "span",
        {},
        text,
        points === 1 ? null : h("small", {}, ` (${number(points)} points)`),
        asked ? this.answer(text, step, goal) : null,
      ),
      word,
    );
    return { root, sign, word, met: null };
  }

  // A number that a goal asks for.
  answer(text, step, goal) {
    const input = h("input", { type: "text", class: "number", "aria-label": `Number: ${text}` });
    const send = async () => {
      const answer = await this.lab.ask("task.number", { step, goal, text: input.value });
      if (answer) input.setAttribute("aria-invalid", String(!answer.right));
    };
    input.addEventListener("keydown", (event) => event.key === "Enter" && send());
    return h("span", { class: "line" }, input, h("button", { onclick: send }, "Check"));
  }

  mark({ goals }, { count, marks }) {
    goals.forEach(({ met, text }, i) => {
      const mark = marks[i];
      if (met && mark.met === false && this.root.hidden) this.lab.tell(`Done: ${text}`);
      mark.met = met;
      mark.sign.textContent = met ? "✓" : "○";
      mark.word.textContent = met ? "done" : "to do";
      mark.root.classList.toggle("met", met);
    });
    count.textContent = goals.length
      ? `${goals.filter((goal) => goal.met).length} of ${goals.length}`
      : "";
  }
}

// Points without digits that say nothing.
function number(value) {
  return String(Number(value.toFixed(2)));
}
