// A view's page in a notebook's output: it only relays what Python sends to the page in its frame.

function render({ model, el }) {
  const frame = document.createElement("iframe"),
    waiting = [];
  let ready = false;
  frame.setAttribute("sandbox", "allow-scripts");
  frame.setAttribute("style", model.get("style"));
  frame.title = model.get("title");
  const relay = (message) =>
    ready ? frame.contentWindow.postMessage(message, "*") : waiting.push(message);
  const heard = ({ source, data }) => {
    if (source !== frame.contentWindow || data !== "ready") return;
    ready = true;
    for (const message of waiting.splice(0)) relay(message);
  };
  const load = () => {
    ready = false;
    frame.srcdoc = model.get("page");
  };
  const take = (content, buffers) => relay(buffers?.length ? bytes(buffers[0]) : content);
  addEventListener("message", heard);
  model.on("msg:custom", take);
  model.on("change:page", load);
  load();
  el.append(frame);
  return () => {
    removeEventListener("message", heard);
    model.off("msg:custom", take);
    model.off("change:page", load);
  };
}

function bytes(view) {
  return view.buffer ? view.buffer.slice(view.byteOffset, view.byteOffset + view.byteLength) : view;
}

export default { render };
